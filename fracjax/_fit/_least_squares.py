r"""Least squares by variable projection, every start in one compiled program.

A model is y = Φ(θ) c + y_0(θ) with gains c, and each recording's own terms, entering linearly.  For
each θ the gains follow from a linear least-squares problem, so that Levenberg–Marquardt runs over θ
alone:

    min_θ ‖ W (y - y_0(θ) - Φ(θ) c(θ)) ‖²,     c(θ) = argmin_c ‖ W (y - y_0(θ) - Φ(θ) c) ‖

Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413.  θ is fitted through a sine that
keeps it within its bounds.
"""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array

from .._blocks import AbstractBlock, linear_gains
from .._parameters import named_parameters, set_values
from ._problem import Problem

_STEPS = 12
_RIDGE = 1e-9
_SOLVER = optx.LevenbergMarquardt(rtol=1e-6, atol=1e-8)


class Layout(NamedTuple):
    """Names and sizes of the parameters a fit moves: shapes iterated, gains eliminated."""

    shapes: tuple[tuple[str, int], ...]
    gains: tuple[tuple[str, int], ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """One name per number that is fitted: `name`, or `name[k]` of a vector."""
        return tuple(
            name if size == 1 else f"{name}[{k}]"
            for name, size in self.shapes + self.gains
            for k in range(size)
        )


def layout_of(block: AbstractBlock) -> Layout:
    gains = linear_gains(block)
    free = {n: int(np.size(p.value)) for n, p in named_parameters(block).items() if not p.fixed}
    return Layout(
        tuple((n, size) for n, size in free.items() if n not in gains),
        tuple((n, free[n]) for n in gains),
    )


def split(block: AbstractBlock, names: tuple[tuple[str, int], ...], vector: Array) -> dict:
    parameters = named_parameters(block)
    values, at = {}, 0
    for name, size in names:
        values[name] = vector[at : at + size].reshape(jnp.shape(parameters[name].value))
        at += size
    return values


def _concatenate(pieces: list) -> Array:
    return jnp.concatenate([jnp.ravel(p) for p in pieces]) if pieces else jnp.zeros(0)


def unconstrained(block: AbstractBlock) -> Array:
    """The block's shapes as one vector of angles."""
    parameters = named_parameters(block)
    shapes = layout_of(block).shapes
    return _concatenate([parameters[n].to_unconstrained(parameters[n].value) for n, _ in shapes])


def with_shapes(block: AbstractBlock, angles: Array) -> AbstractBlock:
    parameters = named_parameters(block)
    values = split(block, layout_of(block).shapes, angles)
    return set_values(block, {n: parameters[n].from_unconstrained(z) for n, z in values.items()})


def with_gains(block: AbstractBlock, gains: Array) -> AbstractBlock:
    return set_values(block, split(block, layout_of(block).gains, gains))


def _own_columns(problems: tuple[Problem, ...]) -> list[Array]:
    """Per recording the columns (L, Σq) of all recordings' own terms, the others' being zero."""
    counts = [p.own.shape[1] for p in problems]
    ends = np.cumsum(counts)
    return [
        jnp.zeros((p.own.shape[0], sum(counts))).at[:, end - count : end].set(p.own)
        for p, count, end in zip(problems, counts, ends, strict=True)
    ]


def _linear_system(block: AbstractBlock, problem: Problem, own: Array) -> tuple[Array, Array]:
    """Whitened columns (L, gains + own) and whitened remainder (L,) of one recording."""
    count = sum(size for _, size in layout_of(block).gains)
    at_zero, along = jax.linearize(
        lambda gains: problem.simulate(with_gains(block, gains)), jnp.zeros(count)
    )
    columns = [jax.vmap(along)(jnp.eye(count)).T] if count else []
    columns = jnp.concatenate([*columns, own], axis=1)
    return problem.whiten(columns), problem.whiten(problem.response - at_zero)


def project(block: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[Array, Array, Array]:
    """Best gains and own terms at the block's shapes, the whitened residual (ΣL,), and an
    orthonormal basis (ΣL, gains + own) of what they span."""
    own = _own_columns(problems)
    systems = [_linear_system(block, p, o) for p, o in zip(problems, own, strict=True)]
    columns = jnp.concatenate([s[0] for s in systems])
    target = jnp.concatenate([s[1] for s in systems])
    # Columns of unit length, and a ridge far below the noise, where two of them coincide.
    lengths = jnp.sqrt(jnp.sum(columns**2, axis=0)) + 1e-300
    scaled = jnp.concatenate([columns / lengths, _RIDGE * jnp.eye(columns.shape[1])])
    q, r = jnp.linalg.qr(scaled)
    basis = q[: target.shape[0]]
    solution = jax.scipy.linalg.solve_triangular(r, basis.T @ target) / lengths
    return solution, target - columns @ solution, basis


def projected_residual(block: AbstractBlock, problems: tuple[Problem, ...]) -> Array:
    """The residual of `project`, with Kaufman's derivative: -(1 - QQᵀ) (∂Φ/∂θ) c.

    Gains and basis are held while differentiating; the term left out is of the order of the
    residual itself (Kaufman, BIT 15 (1975) 49), and no derivative runs through the QR.
    """
    solution, _, basis = jax.lax.stop_gradient(project(block, problems))
    fitted, terms = _at(block, solution, problems)
    residual = jnp.concatenate(
        [
            p.whiten(p.response - p.simulate(fitted) - term)
            for p, term in zip(problems, terms, strict=True)
        ]
    )
    return residual - basis @ (basis.T @ residual)


def _at(
    block: AbstractBlock, solution: Array, problems: tuple[Problem, ...]
) -> tuple[AbstractBlock, list[Array]]:
    """The block with its gains, and per recording its own terms (L,), at a solution."""
    count = solution.shape[0] - sum(p.own.shape[1] for p in problems)
    return with_gains(block, solution[:count]), [
        o @ solution[count:] for o in _own_columns(problems)
    ]


class Solution(NamedTuple):
    """Logits (S, n), sums of squares (S,), steps (S,) and success (S,) of every start."""

    angles: Array
    cost: Array
    steps: Array
    success: Array


@eqx.filter_jit
def solve(starts: AbstractBlock, active: np.ndarray, problems: tuple[Problem, ...]) -> Solution:
    """A few steps from every active start; `starts` is a block with a leading axis (S, …).

    The steps are limited so that hopeless starts cost little; take the promising ones up again.
    """

    def one(block: AbstractBlock) -> Solution:
        start = unconstrained(block)
        # In units of the start's own residual the damping of Levenberg–Marquardt begins at a
        # sensible size, whatever the signals' units and length.
        size = jnp.linalg.norm(projected_residual(with_shapes(block, start), problems)) + 1e-300

        def residual(angles, _):
            return projected_residual(with_shapes(block, angles), problems) / size

        if start.size == 0:
            return Solution(start, size**2, jnp.zeros((), int), jnp.ones((), bool))
        found = optx.least_squares(residual, _SOLVER, start, max_steps=_STEPS, throw=False)
        cost = jnp.asarray(2 * found.state.f_info.as_min()) * size**2
        return Solution(
            found.value,
            jnp.nan_to_num(cost, nan=jnp.inf, posinf=jnp.inf),
            found.stats["num_steps"],
            found.result == optx.RESULTS.successful,
        )

    def skipped(block: AbstractBlock) -> Solution:
        start = unconstrained(block)
        return Solution(start, jnp.full((), jnp.inf), jnp.zeros((), int), jnp.zeros((), bool))

    return jax.lax.map(lambda job: jax.lax.cond(job[1], one, skipped, job[0]), (starts, active))


@eqx.filter_jit
def moved(starts: AbstractBlock, angles: np.ndarray) -> AbstractBlock:
    """Every start with the shapes that its angles (S, n) stand for."""
    return jax.vmap(with_shapes)(starts, jnp.asarray(angles))


@eqx.filter_jit
def finish(
    block: AbstractBlock, angles: Array | np.ndarray, problems: tuple[Problem, ...]
) -> tuple:
    """The fitted block, the recordings' own coefficients (Σq,), and their simulations (L,)."""
    shaped = with_shapes(block, jnp.asarray(angles))
    solution, _, _ = project(shaped, problems)
    fitted, terms = _at(shaped, solution, problems)
    simulations = tuple(p.simulate(fitted) + t for p, t in zip(problems, terms, strict=True))
    return fitted, solution[-sum(p.own.shape[1] for p in problems) :], simulations


def stack(blocks: list[AbstractBlock]) -> AbstractBlock:
    """Blocks of one structure as one block with a leading axis."""
    return jax.tree_util.tree_map(lambda *leaves: np.stack(leaves), *blocks)


@eqx.filter_jit
def jacobian(block: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[Array, Array]:
    """Derivative (ΣL, shapes + gains + own) of the simulation in physical values: as it is, and
    whitened with left-out samples zero."""
    layout = layout_of(block)
    names = layout.shapes + layout.gains
    parameters = named_parameters(block)
    values = _concatenate([parameters[n].value for n, _ in names])

    def simulate(vector: Array) -> tuple[Array, ...]:
        moved = set_values(block, split(block, names, vector))
        return tuple(p.simulate(moved) for p in problems)

    raw = [
        jnp.concatenate([columns, own], axis=1)
        for columns, own in zip(jax.jacfwd(simulate)(values), _own_columns(problems), strict=True)
    ]
    whitened = [p.whiten(columns) for p, columns in zip(problems, raw, strict=True)]
    return jnp.concatenate(raw), jnp.concatenate(whitened)


@eqx.filter_jit
def simulate_all(blocks: AbstractBlock, problems: tuple[Problem, ...]) -> tuple[Array, Array]:
    """Simulations (K, ΣL) of K blocks of one structure, as they are and whitened."""

    def one(block: AbstractBlock) -> tuple[Array, Array]:
        simulations = [p.simulate(block) for p in problems]
        whitened = [p.whiten(s) for p, s in zip(problems, simulations, strict=True)]
        return jnp.concatenate(simulations), jnp.concatenate(whitened)

    return jax.lax.map(one, blocks)
