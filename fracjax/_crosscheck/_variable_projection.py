"""Least squares with the gains eliminated, as one differentiable and compiled function.

A model is y = Φ(θ) c + y_0(θ), in which the gains c, and each recording's own terms, enter
linearly.  For each θ they follow from a linear least-squares problem, so that a search runs over θ
alone:

    min_θ ‖ W (y - y_0(θ) - Φ(θ) c(θ)) ‖²,     c(θ) = argmin_c ‖ W (y - y_0(θ) - Φ(θ) c) ‖

Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jax import Array

from .._blocks import AbstractBlock
from .._prepare import AbstractProblem, layout_of, own_columns, with_gains
from .._solve import eliminate


def _linear_system(
    block: AbstractBlock, problem: AbstractProblem, own: Array
) -> tuple[Array, Array]:
    """Whitened columns (L, gains + own) and response minus that at zero gains (L,)."""
    count = sum(size for _, size in layout_of(block).gains)
    at_zero, along = jax.linearize(
        lambda gains: problem.simulate(with_gains(block, gains)), jnp.zeros(count)
    )
    columns = [jax.vmap(along)(jnp.eye(count)).T] if count else []
    columns = jnp.concatenate([*columns, own], axis=1)
    return problem.whiten(columns), problem.whiten(problem.response - at_zero)


def project(
    block: AbstractBlock, problems: tuple[AbstractProblem, ...]
) -> tuple[Array, Array, Array]:
    """Optimal gains and own terms for the block, the whitened residual, and an orthonormal basis.

    The residual is (ΣL,); the basis (ΣL, gains + own) spans the whitened columns.
    """
    own = own_columns(problems)
    systems = [_linear_system(block, p, o) for p, o in zip(problems, own, strict=True)]
    columns = jnp.concatenate([s[0] for s in systems])
    target = jnp.concatenate([s[1] for s in systems])
    return eliminate(columns, target, jnp)


def projected_residual(block: AbstractBlock, problems: tuple[AbstractProblem, ...]) -> Array:
    """The residual of `project`, with Kaufman's derivative: -(1 - QQᵀ) (∂Φ/∂θ) c.

    Gains and basis are constant in the derivative.  The omitted term is of the order of the
    residual (Kaufman, BIT 15 (1975) 49), and the QR factorisation need not be differentiated.
    """
    solution, _, basis = jax.lax.stop_gradient(project(block, problems))
    count = solution.shape[0] - sum(p.own.shape[1] for p in problems)
    fitted = with_gains(block, solution[:count])
    residual = jnp.concatenate(
        [
            p.whiten(p.response - p.simulate(fitted) - own @ solution[count:])
            for p, own in zip(problems, own_columns(problems), strict=True)
        ]
    )
    return residual - basis @ (basis.T @ residual)
