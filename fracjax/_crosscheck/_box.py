"""A model's objective over the unit cube, where searches between bounds move.

Each coordinate is a parameter's share of the way between its bounds, on the parameter's own scale;
a logarithmic one moves evenly in its logarithm.
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

AT_ONCE = 8  # of a population, evaluated side by side
_ROOM = 3.0


class Found(NamedTuple):
    """Where a search ended in the unit cube (n,), the objective there, and how often it looked."""

    position: Array
    cost: Array
    evaluations: Array


def dimension(block: AbstractBlock) -> int:
    """How many numbers a search over the block's shapes moves."""
    return sum(size for _, size in layout_of(block).shapes)


def objective(block: AbstractBlock, problems: tuple[AbstractProblem, ...]) -> Objective:
    """χ² over the unit cube, gains and own terms at their best; ∞ where the model breaks down."""

    def cost(position: Array) -> Array:
        _, residual, _ = project(with_shapes_at(block, position), problems)
        return jnp.nan_to_num(jnp.sum(residual**2), nan=jnp.inf, posinf=jnp.inf)

    return cost


@compiled
def with_gradient(
    block: AbstractBlock, problems: tuple[AbstractProblem, ...], position: Array
) -> tuple[Array, Array]:
    """χ² and its gradient (n,) at a point of the unit cube.

    The residual is orthogonal to what Kaufman's derivative leaves out: the gradient is exact.
    """

    def residual(position: Array) -> tuple[Array, Array]:
        found = projected_residual(with_shapes_at(block, position), problems)
        return found, found

    derivative, found = jax.jacfwd(residual, has_aux=True)(position)
    return jnp.sum(found**2), 2 * derivative.T @ found


def with_bounded_shapes(block: AbstractBlock, fitted: AbstractBlock) -> AbstractBlock:
    """The block with bounds for the gains that are not eliminated, because another stands before
    them or something nonlinear after: ±3 times the fitted value, or the block's own if larger."""
    parameters, found = named_parameters(block), named_parameters(fitted)
    bounded = {}
    for name, _ in layout_of(block).shapes:
        p = parameters[name]
        if not p.bounded:
            reach = _ROOM * np.maximum(np.abs(found[name].value), np.abs(p.value))
            bounded[name] = Parameter(p.value, p.unit, lower=-reach, upper=reach)
    return replace_parameters(block, bounded)


def with_bounded_gains(block: AbstractBlock, problems: tuple[Problem, ...]) -> AbstractBlock:
    """The block with its gains bounded and searched for, no longer eliminated, as in the papers.

    The bounds are ±3 times the gain with which its own column alone would span the response, or
    ±3 times the block's own gain where that is larger.
    """
    layout = layout_of(block)
    columns = np.asarray(jacobian(block, problems)[0])
    response = np.concatenate([p.response for p in problems])
    counts = np.concatenate([p.weights for p in problems]) > 0
    parameters, bounded = named_parameters(block), {}
    at = dimension(block)
    for name, size in layout.gains:
        p = parameters[name]
        ratio = np.ptp(response[counts]) / np.ptp(columns[counts, at : at + size], axis=0)
        reach = _ROOM * np.maximum(ratio.reshape(np.shape(p.value)), np.abs(p.value))
        bounded[name] = Parameter(p.value, p.unit, lower=-reach, upper=reach)
        at += size
    return replace_parameters(block, bounded)
