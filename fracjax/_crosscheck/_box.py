"""A model's objective over the unit cube, in which the bounded searches move.

Each coordinate is a parameter's share of the interval between its bounds, on the parameter's own
scale: for a logarithmic parameter, of the interval between their logarithms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._computing import compiled
from .._parameters import Parameter, named_parameters, replace_parameters
from .._prepare import AbstractProblem, Problem, layout_of, with_shapes_at
from .._solve import jacobian
from ._variable_projection import project, projected_residual

Objective = Callable[[Array], Array]

BATCH_SIZE = 8
"""Members of a population that are evaluated in one vectorised call; it decides speed only."""
_BOUND_FACTOR = 3.0
"""Bounds of a gain that has none, as a multiple of its expected size; chosen by judgement."""


class SearchResult(NamedTuple):
    """The end of a search.

    `position` (n,) is its best point in the unit cube, `cost` the objective there, and
    `evaluations` the number of evaluations of the objective.
    """

    position: Array
    cost: Array
    evaluations: Array


def dimension(block: AbstractBlock) -> int:
    """Number of coordinates of a search: components of the block's free shape parameters."""
    return sum(size for _, size in layout_of(block).shapes)


def objective(block: AbstractBlock, problems: tuple[AbstractProblem, ...]) -> Objective:
    """χ² over the unit cube (n,), with optimal gains and own terms; ∞ where it is not finite."""

    def cost(position: Array) -> Array:
        _, residual, _ = project(with_shapes_at(block, position), problems)
        return jnp.nan_to_num(jnp.sum(residual**2), nan=jnp.inf, posinf=jnp.inf)

    return cost


@compiled
def cost_and_gradient(
    block: AbstractBlock, problems: tuple[AbstractProblem, ...], position: Array
) -> tuple[Array, Array]:
    """χ² and its gradient (n,) at a point (n,) of the unit cube.

    The residual is orthogonal to the term that Kaufman's derivative omits, so the gradient is
    exact.
    """

    def residual(position: Array) -> tuple[Array, Array]:
        value = projected_residual(with_shapes_at(block, position), problems)
        return value, value

    derivative, value = jax.jacfwd(residual, has_aux=True)(position)
    return jnp.sum(value**2), 2 * derivative.T @ value


def with_bounded_shapes(block: AbstractBlock, fitted: AbstractBlock) -> AbstractBlock:
    """The block with bounds for those gains that cannot be eliminated.

    These have another gain in front of them, or a nonlinear part behind them.  Their bounds are ±3
    times the fitted value, or ±3 times the block's own value if that is larger.
    """
    parameters, fitted_parameters = named_parameters(block), named_parameters(fitted)
    bounded = {}
    for name, _ in layout_of(block).shapes:
        p = parameters[name]
        if not p.bounded:
            limit = _BOUND_FACTOR * np.maximum(
                np.abs(fitted_parameters[name].value), np.abs(p.value)
            )
            bounded[name] = Parameter(p.value, p.unit, lower=-limit, upper=limit)
    return replace_parameters(block, bounded)


def with_bounded_gains(block: AbstractBlock, problems: tuple[Problem, ...]) -> AbstractBlock:
    """The block with its gains bounded and searched for instead of eliminated, as in the papers.

    The bounds are ±3 times the gain with which the gain's own column would span the response, or ±3
    times the block's own gain if that is larger.
    """
    layout = layout_of(block)
    columns = np.asarray(jacobian(block, problems)[0])
    response = np.concatenate([p.response for p in problems])
    used = np.concatenate([p.weights for p in problems]) > 0
    parameters, bounded = named_parameters(block), {}
    at = dimension(block)
    for name, size in layout.gains:
        p = parameters[name]
        ratio = np.ptp(response[used]) / np.ptp(columns[used, at : at + size], axis=0)
        limit = _BOUND_FACTOR * np.maximum(ratio.reshape(np.shape(p.value)), np.abs(p.value))
        bounded[name] = Parameter(p.value, p.unit, lower=-limit, upper=limit)
        at += size
    return replace_parameters(block, bounded)
