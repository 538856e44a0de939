"""Recordings of one grid in their own samples, for descents in lock-step (`_lockstep`).

The rows of the full model are computed together in NumPy, without compilation: a chain takes one
transfer function at each point and at each of its shapes moved, and one inverse transform for each
of them and each gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from .._blocks import AbstractBlock
from .._operators import Grid
from .._prepare import Problem, layout_of
from ._chains import Chain, transfer
from ._elimination import eliminate
from ._lockstep import (
    ChainColumns,
    Dependence,
    Rows,
    by_gain,
    chain_at,
    change_by_shapes,
    combine,
    dependences,
    total_of,
    with_one,
)
from ._responses import speeds
from ._row import BestArrivals, Optima, constants_of, slopes_at
from ._transformed import Transformed

_DIFFERENCE = 1e-5
"""Step of one-sided differences: an error of this order slows no descent, and rounding is less."""
_LARGEST = 20_480
"""Samples of all drives computed together, measured on drives of 1,700 to 10,000 samples."""


@dataclass(frozen=True, eq=False)
class Direct(Rows):
    """R recordings' problems in samples (L,), all on one grid.

    Attributes:
        problems: the recordings.
        own: per recording, orthonormal rows (q, L) that span its whitened own terms.
        response: (R, L), reduced.
        grid: step [s] and history of the simulation.
        at_once: few points, so that what is computed for them stays in the processor's cache.
    """

    problems: Sequence[Problem]
    own: Sequence[np.ndarray]
    response: np.ndarray
    grid: Grid
    at_once: int

    @classmethod
    def of(cls, problems: Sequence[Problem]) -> Direct:
        """The rows of recordings."""
        own = [
            np.ascontiguousarray(np.linalg.qr(problem.whiten(np.asarray(problem.own)))[0].T)
            for problem in problems
        ]
        responses = np.stack([np.asarray(problem.response) for problem in problems])[:, None]
        reduced = _reduced(problems, own, responses)[:, 0]
        first = problems[0]
        return cls(problems, own, reduced, first.grid, max(_LARGEST // len(first.drive), 1))

    @property
    def _every(self) -> int:
        return self.problems[0].oversampling

    @cached_property
    def _drives(self) -> np.ndarray:
        return np.stack([np.asarray(problem.drive) for problem in self.problems], axis=1)

    @cached_property
    def _driven(self) -> Transformed:
        return Transformed.of(self._drives, self.grid, short=True)

    @cached_property
    def _speeds(self) -> dict[int, np.ndarray]:
        return {}

    def _speed(self, every: int) -> np.ndarray:
        """The absolute rates (R, ⌈M/every⌉) of the drives."""
        if every not in self._speeds:
            self._speeds[every] = speeds(self._drives, self.grid, every)
        return self._speeds[every]

    def reduced(self, rows: np.ndarray, signals: np.ndarray) -> np.ndarray:
        """Signals (K, c, L) of rows (K,), whitened, without what the own terms absorb."""
        return _reduced([self.problems[at] for at in rows], [self.own[at] for at in rows], signals)

    def chain_around(
        self,
        block: AbstractBlock,
        at: int,
        depend: Dependence,
        rows: np.ndarray,
        positions: np.ndarray,
    ) -> ChainColumns:
        """What chain `at` adds to the responses at points (K, n), up to constants, not whitened."""
        # Inwards, so that both ends of the differences are within the bounds.
        steps = np.where(positions < 0.5, _DIFFERENCE, -_DIFFERENCE)
        around = np.repeat(positions[:, None], 1 + len(depend.shapes), axis=1)
        for k, shape in enumerate(depend.shapes):
            around[:, 1 + k, shape] += steps[:, shape]
        flat = around.reshape(-1, positions.shape[1])
        chain = chain_at(block, layout_of(block), at, flat, depend)
        size = depend.units, len(rows), around.shape[1]
        values = by_gain(self._respond(chain, rows, size), depend)
        moved = tuple(
            np.swapaxes(values[:, :, 1 + k] - values[:, :, 0], 0, 1) / steps[:, None, [shape]]
            for k, shape in enumerate(depend.shapes)
        )
        return ChainColumns(depend, np.swapaxes(values[:, :, 0], 0, 1), moved)

    def _respond(self, chain: Chain, rows: np.ndarray, size: tuple[int, int, int]) -> np.ndarray:
        """The responses (u, K, c, L) of a chain, at K c shapes and u gains, to the drives of rows
        (K,).
        """

        def after(block: AbstractBlock, driven: Transformed, spectra: Any, every: int) -> Any:
            values = transfer(block, driven.zeta, self.grid)
            values = np.broadcast_to(values, (size[0], size[1] * size[2], driven.zeta.size))
            transforms = (values.reshape(*size, -1) * spectra).reshape(-1, driven.zeta.size)
            return driven.back(transforms, every).reshape(*size, -1)

        fine = self._every if chain.after is None else 1
        signals = after(chain.before, self._driven, self._driven.drives[rows][:, None], fine)
        if chain.rated:
            signals *= self._speed(fine)[rows][:, None]
        if chain.after is None:
            return signals
        between = Transformed.of(signals.reshape(-1, signals.shape[-1]).T, self.grid, short=True)
        spectra = between.drives.reshape(*size, -1)
        return after(chain.after, between, spectra, self._every)

    def optima(self, block: AbstractBlock, arrivals: BestArrivals) -> Optima:
        """What is known of the rows where their descents have ended."""
        depends, layout = dependences(block, self.grid), layout_of(block)
        constants = constants_of(block, arrivals.positions, self.problems)
        slopes = slopes_at(block, arrivals.positions)
        gains, responses, derivatives, triangles = [], [], [], []
        for at in range(0, len(self.problems), self.at_once):
            rows = np.arange(at, min(at + self.at_once, len(self.problems)))
            positions = arrivals.positions[rows]
            columns, target, chains = combine(block, depends, self, rows, positions)
            some = eliminate(columns.swapaxes(1, 2), target)[0]
            here = total_of(chains, len(layout.gains)) + constants[rows, :, None]
            changes = change_by_shapes(chains, some, len(layout.shapes)) / slopes[rows]
            gains.append(some)
            responses.append((with_one(some)[:, None] @ here)[:, 0])
            for row, *parts in zip(rows, changes, here[:, 1:], strict=True):
                problem, derivative = self.problems[int(row)], np.concatenate(parts)
                every = problem.whiten(np.concatenate([derivative, problem.own.T]).T)
                derivatives.append(partial(np.asarray, derivative))
                triangles.append(np.linalg.qr(every, mode="r"))
        return Optima(
            arrivals=arrivals,
            gains=np.concatenate(gains),
            responses=np.concatenate(responses),
            derivatives=derivatives,
            triangles=np.stack(triangles),
            accurate=np.ones(len(self.problems), bool),
        )


def _reduced(
    problems: Sequence[Problem], own: Sequence[np.ndarray], signals: np.ndarray
) -> np.ndarray:
    """Signals (K, c, L) of K problems, whitened, without what their own terms (q, L) absorb."""
    result = np.empty_like(signals)
    for at, (problem, terms) in enumerate(zip(problems, own, strict=True)):
        white = problem.whiten(signals[at].T).T
        np.subtract(white, (white @ terms.T) @ terms, out=result[at])
    return result


def thinned(problem: Problem, every: int) -> Problem:
    """A problem with every so many of its samples, on their grid, the noise taken as white."""
    taps = np.zeros_like(problem.whitening)
    taps[0] = problem.whitening[0]
    return replace(
        problem,
        drive=problem.drive[::every],
        response=problem.response[::every],
        weights=problem.weights[::every],
        own=problem.own[::every],
        whitening=taps,
        grid=Grid(np.asarray(every * problem.grid.step), problem.grid.history),
    )
