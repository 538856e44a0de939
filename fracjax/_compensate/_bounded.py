r"""The best drive within limits: Gauss–Newton, each step a convex problem solved by splitting.

    min_u ½‖F(u) - r‖² + ½‖τ² g ü‖²    within    low ≤ u ≤ high,   |u_n - u_{n-1}| ≤ slew · dt

F is the model, linearised at the last drive; r is the desired response; g = stroke/drive span; τ is
the smoothing time.  The alternating direction method of multipliers holds copies z of u and of its
differences within their limits, with multipliers y and a penalty ρ:

    (JᵀJ + RᵀR + ρ AᵀA) u = Jᵀb + Aᵀ(ρ z - y),     z = clip(A u + y/ρ),     y += ρ (A u - z)

The first equation is solved by conjugate gradients, which need only products with J and Jᵀ.
Source: Stellato, Banjac, Goulart, Bemporad & Boyd, Math. Prog. Comp. 12 (2020) 637.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.scipy.sparse.linalg import cg

from .._computing import compiled
from .._operators import History
from .._solve import Progress
from ._plant import Plant
from ._unbounded import Solution, respond

_LINEARISATIONS = 8
"""Most Gauss–Newton steps; chosen by judgement."""
_GAIN = 1e-3
"""Converged when one more linearisation lowers the cost by less than this share; by judgement."""
_SPLITS = 400
"""Most alternations per linearised problem; chosen by judgement."""
_RELAXATION = 1.6
"""Over-relaxation of the copies, the value that the source recommends."""
_PENALTY = 1.0
"""ρ, for drives in spans and responses in strokes; chosen by judgement."""
_CONJUGATE_STEPS = 20
"""Most steps of conjugate gradients per alternation; chosen by judgement."""
_SPLIT_TOLERANCE = 1e-6
"""Copies that agree to this share of the drive's span end the alternation; by judgement."""
_RAMP_SHARE = 100
"""A ramp over the whole span in a hundredth of the trajectory weighs as much as the span itself."""


class Bounds(NamedTuple):
    """Limits on the drive and on its change per sample [drive]; infinite means no limit."""

    low: float
    high: float
    change: float

    def admits(self, drive: np.ndarray, history: History) -> bool:
        """Whether a drive (N,) stays within the limits, up to rounding."""
        slack = 1e-9 * np.ptp(drive)
        levels = drive.min() >= self.low - slack and drive.max() <= self.high + slack
        first = {"rest": 0.0, "constant": drive[0], "periodic": drive[-1]}[history]
        fastest = np.abs(np.diff(drive, prepend=first)).max()
        return bool(levels and fastest <= self.change + slack)

    def apply(self, drive: np.ndarray, history: History) -> np.ndarray:
        """The drive (N,) that an amplifier with these limits puts out, sample after sample."""
        limited = np.clip(drive, self.low, self.high)
        if not np.isfinite(self.change):
            return limited
        laps = 2 if history == "periodic" else 1
        last = limited[-1] if history == "periodic" else limited[0]
        if history == "rest":
            last = 0.0
        for _ in range(laps):
            for n, level in enumerate(limited):
                last = min(max(level, last - self.change), last + self.change)
                limited[n] = last
        return limited


def changes(drive: Array, history: History) -> Array:
    """Differences (N,) of a drive (N,) from sample to sample.

    The first is taken from zero (rest), from itself (constant) or from the last one (periodic).
    """
    first = {"rest": 0 * drive[:1], "constant": drive[:1], "periodic": drive[-1:]}[history]
    return drive - jnp.concatenate([first, drive[:-1]])


class Evaluated(NamedTuple):
    """A drive (N,), its response (N,), and the cost that is minimised, in strokes squared."""

    cost: float
    drive: np.ndarray
    response: np.ndarray


class Problem(NamedTuple):
    """The scaled problem: `desired` (N,) in strokes, `low` and `high` (2N,) limits of the copies.

    The copies are the drive in spans and, times `stretch`, its differences; `roughness`: τ² in
    samples squared.
    """

    desired: Array
    low: Array
    high: Array
    stretch: Array
    roughness: Array


def optimise_within(
    plant: Plant,
    start: Solution,
    desired: np.ndarray,
    stroke: float,
    bounds: Bounds,
    smoothing: float,
    progress: Progress,
) -> Solution:
    """The drive of least squared error within bounds; the start need not be within them.

    `desired` (N,) and `stroke` are in the response's unit, `smoothing` is τ in samples.  With
    `constant` history the first sample stays as the trajectory starts, since the drive is assumed
    to have held it for ever before.  The search has converged when one more linearisation lowers
    the cost by less than 0.1 %.
    """
    history, count = plant.history, len(desired)
    span = float(np.ptp(start.drive))
    stretch = count / _RAMP_SHARE
    fastest = bounds.change * stretch
    low = np.repeat([bounds.low, -fastest], count) / span
    high = np.repeat([bounds.high, fastest], count) / span
    if history == "constant":
        # The drive has always held its first sample: moving it would change the prior history.
        low[0] = high[0] = np.clip(start.drive[0], bounds.low, bounds.high) / span
    task = Problem(
        jnp.asarray(desired / stroke),
        jnp.asarray(low),
        jnp.asarray(high),
        jnp.asarray(stretch),
        jnp.asarray(smoothing**2),
    )

    def evaluate(drive: np.ndarray) -> Evaluated:
        response = np.asarray(respond(plant, drive))
        bend = smoothing**2 * np.diff(drive, 2) / span
        error = (response - desired) / stroke
        return Evaluated(float(error @ error + bend @ bend), drive, response)

    best = evaluate(bounds.apply(start.drive, history))
    iterations, converged, state = start.iterations, False, None
    scales = jnp.asarray(span), jnp.asarray(stroke)
    for _ in range(_LINEARISATIONS):
        progress("optimising the drive within the limits")
        drive, state, splits = _solve_by_splitting(
            plant, jnp.asarray(best.drive), task, scales, state
        )
        iterations += int(splits)
        clipped = np.clip(np.asarray(drive), low[:count] * span, high[:count] * span)
        candidate = evaluate(bounds.apply(clipped, history))
        converged = candidate.cost > (1 - _GAIN) * best.cost
        best = min(best, candidate, key=lambda evaluated: evaluated.cost)
        if converged:
            break
    return Solution(best.drive, best.response, iterations, converged, "bounded least squares")


@compiled
def _solve_by_splitting(
    plant: Plant,
    drive: Array,
    task: Problem,
    scales: tuple[Array, Array],
    state: tuple[Array, Array] | None,
) -> tuple[Array, tuple[Array, Array], Array]:
    """The drive (N,) that solves the linearised problem, copies and multipliers (2N,), and steps.

    `scales`: the drive's span and the response's stroke; `state`: the copies and multipliers at
    which the previous linearisation ended, None for the first.
    """
    history, (span, stroke) = plant.history, scales
    start = drive / span

    def scaled(level: Array) -> Array:
        return plant(level * span) / stroke

    def bent(level: Array) -> Array:
        return task.roughness * jnp.diff(level, 2)

    def copies(level: Array) -> Array:
        return jnp.concatenate([level, task.stretch * changes(level, history)])

    response, push = jax.linearize(scaled, start)
    pull = jax.linear_transpose(push, start)
    copies_transposed = jax.linear_transpose(copies, start)
    bent_transposed = jax.linear_transpose(bent, start)
    target = pull(task.desired - response + push(start))[0]

    def curvature(level: Array) -> Array:
        tracking = pull(push(level))[0] + bent_transposed(bent(level))[0]
        return tracking + _PENALTY * copies_transposed(copies(level))[0]

    def unfinished(carry: tuple[Array, ...]) -> Array:
        return (carry[3] < _SPLITS) & (carry[4] > _SPLIT_TOLERANCE)

    def step(carry: tuple[Array, ...]) -> tuple[Array, ...]:
        level, held, multiplier, splits, _ = carry
        right_side = target + copies_transposed(_PENALTY * held - multiplier)[0]
        level, _ = cg(curvature, right_side, level, tol=1e-8, maxiter=_CONJUGATE_STEPS)
        copied = copies(level)
        relaxed = _RELAXATION * copied + (1 - _RELAXATION) * held
        before, held = held, jnp.clip(relaxed + multiplier / _PENALTY, task.low, task.high)
        change = jnp.maximum(jnp.abs(copied - held).max(), jnp.abs(held - before).max())
        return level, held, multiplier + _PENALTY * (relaxed - held), splits + 1, change

    if state is None:
        held = jnp.clip(copies(start), task.low, task.high)
        state = held, jnp.zeros_like(held)
    initial = (start, *state, jnp.zeros((), int), jnp.full((), jnp.inf))
    level, held, multiplier, splits, _ = jax.lax.while_loop(unfinished, step, initial)
    return level * span, (held, multiplier), splits
