"""Rows of a stack: recordings to be solved, and what is known of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, Problem, layout_of
from ._elimination import eliminate
from ._interpolation import shapes_at, unit_gains
from ._lockstep import NEGLIGIBLE, Arrival, Rows, descend_together
from ._responses import held
from ._result import Solved


class Row(NamedTuple):
    """A recording to be solved in a stack.

    Attributes:
        preparation: of this recording alone.
        block: the block with its bounds and fixed parameters.
        positions: (S, n) the starts' positions.
    """

    preparation: Preparation
    block: AbstractBlock
    positions: np.ndarray

    @property
    def problem(self) -> Problem:
        """The recording's problem."""
        return self.preparation.problems()[0]


class BestArrivals(NamedTuple):
    """Where the descents of R rows have ended.

    Attributes:
        positions: (R, n) of the shapes, where χ² is least.
        converged: (R,) whether that descent has converged.
        costs: (R, S) χ² where each start has ended.
        evaluations: (R,) how often the objective was computed.
    """

    positions: np.ndarray
    converged: np.ndarray
    costs: np.ndarray
    evaluations: np.ndarray

    @classmethod
    def of(cls, arrival: Arrival, starts: int) -> BestArrivals:
        """The best of the starts of each row."""
        costs = arrival.costs.reshape(-1, starts)
        best = np.nan_to_num(costs, nan=np.inf).argmin(axis=1)
        chosen = np.arange(len(costs)) * starts + best
        evaluations = arrival.evaluations.reshape(-1, starts).sum(axis=1)
        return cls(arrival.positions[chosen], arrival.converged[chosen], costs, evaluations)


class Optima(NamedTuple):
    """The optima of R rows.

    Attributes:
        arrivals: where their descents have ended.
        gains: (R, g) in their units.
        responses: (R, L) without the own terms.
        derivatives: per row, what computes (p, L), the derivatives of the response by each
            parameter.
        triangles: (R, p + q, p + q), the inner products of the whitened derivatives by parameters
            and own terms.
        accurate: (R,) whether the responses are those of the full model.
    """

    arrivals: BestArrivals
    gains: np.ndarray
    responses: np.ndarray
    derivatives: Sequence[Callable[[], np.ndarray]]
    triangles: np.ndarray
    accurate: np.ndarray


def descend_rows(
    block: AbstractBlock, problems: Rows, starts: np.ndarray, negligible: float = NEGLIGIBLE
) -> BestArrivals:
    """The descents of R rows from starts (R, S, n), which end as those of `descend_together`."""
    rows, count, shapes = starts.shape
    every = np.repeat(np.arange(rows), count)
    arrival = descend_together(
        block, [problems], every, starts.reshape(-1, shapes), negligible=negligible
    )
    return BestArrivals.of(arrival, count)


def slopes_at(block: AbstractBlock, positions: np.ndarray) -> np.ndarray:
    """The derivative (R, n, 1) of each shape's value by its position (R, n)."""
    layout = layout_of(block)
    parameters = named_parameters(set_values(block, shapes_at(block, layout, positions)))
    return np.stack([parameters[name].slope() for name, _ in layout.shapes], axis=1)


def blocks_at(
    block: AbstractBlock, positions: np.ndarray, gains: np.ndarray
) -> list[AbstractBlock]:
    """The block at each row's positions (R, n) and gains (R, g)."""
    layout = layout_of(block)
    by_name = {n: g[:, None] for (n, _), g in zip(layout.gains, gains.T, strict=True)}
    values = shapes_at(block, layout, positions) | by_name
    shapes = {name: np.shape(p.value) for name, p in named_parameters(block).items()}
    return [
        set_values(block, {name: v[row].reshape(shapes[name]) for name, v in values.items()})
        for row in range(len(gains))
    ]


def solved_rows(rows: Sequence[Row], optima: Optima) -> list[Solved | None]:
    """The rows at their optima; None where one is not the full model's, or no optimum."""
    arrivals, results = optima.arrivals, []
    blocks = blocks_at(rows[0].block, arrivals.positions, optima.gains)
    for at, row in enumerate(rows):
        if not (optima.accurate[at] and arrivals.converged[at]):
            results.append(None)
            continue
        problem = row.problem
        difference = problem.whiten(problem.response - optima.responses[at])
        own, residual, _ = eliminate(problem.whiten(problem.own), difference)
        simulation = optima.responses[at] + problem.own @ own
        cost = float(residual @ residual)
        results.append(
            Solved(
                preparation=row.preparation,
                block=blocks[at],
                own=(own,),
                simulations=(simulation[: len(row.preparation.takes[0].recording)],),
                cost=cost,
                converged=True,
                start_costs=tuple(np.maximum(arrivals.costs[at], cost).tolist()),
                samples=int(np.count_nonzero(problem.weights)),
                evaluations=int(arrivals.evaluations[at]),
                blocks=(blocks[at],),
                whitened=(residual,),
                free=optima.triangles.shape[2],
                derivative=optima.derivatives[at],
                triangle=optima.triangles[at],
            )
        )
    return results


def constants_of(
    block: AbstractBlock, positions: np.ndarray, problems: Sequence[Problem]
) -> np.ndarray:
    """What the constant part of each row's drive adds to its response (R, 1 + g) at positions (R,
    n): with gains of zero, and by each gain.
    """
    layout, grid = layout_of(block), problems[0].grid
    drives = np.stack([np.asarray(problem.drive) for problem in problems], axis=1)
    there = set_values(block, shapes_at(block, layout, positions))
    units = [held(set_values(there, gains), drives, grid) for gains in unit_gains(layout)]
    return np.concatenate([units[0], *(unit - units[0] for unit in units[1:])], axis=1)
