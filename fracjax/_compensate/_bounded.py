r"""The best drive within limits: Gauss–Newton, each step a convex problem solved by splitting.

    min_u ½‖F(u) - r‖² + ½‖τ² g ü‖²    within    low ≤ u ≤ high,   |u_n - u_{n-1}| ≤ slew · dt

F linearised at the last drive, r the desired response, g = stroke/drive span, τ the smoothing time.
The alternating direction method keeps copies z of u and of its differences within their limits:

    (JᵀJ + RᵀR + ρ AᵀA) u = Jᵀb + Aᵀ(ρ z - y),     z = clip(A u + y/ρ),     y += ρ (A u - z)

The first line is solved by conjugate gradients through products with J and Jᵀ alone.
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
from ._unbounded import Reached, respond

_ROUNDS, _GAIN = 8, 1e-3
_SPLITS, _RELAXED, _PENALTY = 400, 1.6, 1.0
_CONJUGATE_STEPS, _SETTLED = 20, 1e-6


class Bounds(NamedTuple):
    """Limits on the drive and on its change per sample, infinite where there are none [drive]."""

    low: float
    high: float
    change: float

    def admits(self, drive: np.ndarray, history: History) -> bool:
        """Whether a drive (N,) keeps within them, to rounding."""
        slack = 1e-9 * np.ptp(drive)
        levels = drive.min() >= self.low - slack and drive.max() <= self.high + slack
        return bool(
            levels and jnp.abs(changes(jnp.asarray(drive), history)).max() <= self.change + slack
        )

    def applied(self, drive: np.ndarray, history: History) -> np.ndarray:
        """A drive (N,) as a driver with these limits passes it on, sample after sample."""
        passed = np.clip(drive, self.low, self.high)
        if not np.isfinite(self.change):
            return passed
        laps = 2 if history == "periodic" else 1
        last = passed[-1] if history == "periodic" else passed[0]
        if history == "rest":
            last = 0.0
        for _ in range(laps):
            for n, level in enumerate(passed):
                last = min(max(level, last - self.change), last + self.change)
                passed[n] = last
        return passed


def changes(drive: Array, history: History) -> Array:
    """From sample to sample (N,): of the first from zero, from itself, or from the last."""
    first = {"rest": 0 * drive[:1], "constant": drive[:1], "periodic": drive[-1:]}[history]
    return drive - jnp.concatenate([first, drive[:-1]])


class Judged(NamedTuple):
    """A drive (N,) with its response (N,), and what is minimised, in strokes squared."""

    cost: float
    drive: np.ndarray
    response: np.ndarray


class Task(NamedTuple):
    """What is wanted: (N,) in strokes of a plant driven in spans, limits (2N,) of the copies."""

    desired: Array
    low: Array
    high: Array
    stretch: Array
    roughness: Array


def best_within(
    plant: Plant,
    start: Reached,
    desired: np.ndarray,
    stroke: float,
    bounds: Bounds,
    smoothing: float,
    progress: Progress,
) -> Reached:
    """The drive of least squared error within bounds, from a drive that need not keep to them.

    `smoothing`: τ in samples.  With `constant` history the first sample, held for ever before,
    stays what the trajectory starts from.  It has converged when one more linearisation gains less
    than 0.1 %.
    """
    history, count = plant.history, len(desired)
    span = float(np.ptp(start.drive))
    # Differences are weighed so that a ramp through the whole span in a hundredth of the record
    # counts as much as the span.
    stretch = count / 100
    fastest = bounds.change * stretch
    low = np.repeat([bounds.low, -fastest], count) / span
    high = np.repeat([bounds.high, fastest], count) / span
    if history == "constant":
        # What was held for ever before is where the trajectory starts, and no means to an end.
        low[0] = high[0] = np.clip(start.drive[0], bounds.low, bounds.high) / span
    task = Task(
        jnp.asarray(desired / stroke),
        jnp.asarray(low),
        jnp.asarray(high),
        jnp.asarray(stretch),
        jnp.asarray(smoothing**2),
    )

    def judged(drive: np.ndarray) -> Judged:
        response = np.asarray(respond(plant, drive))
        bend = smoothing**2 * np.diff(drive, 2) / span
        missed = (response - desired) / stroke
        return Judged(float(missed @ missed + bend @ bend), drive, response)

    best = judged(bounds.applied(start.drive, history))
    iterations, converged, state = start.iterations, False, None
    scales = jnp.asarray(span), jnp.asarray(stroke)
    for _ in range(_ROUNDS):
        progress("looking for the best drive within the limits")
        drive, state, splits = _split(plant, jnp.asarray(best.drive), task, scales, state)
        iterations += int(splits)
        kept = np.clip(np.asarray(drive), low[:count] * span, high[:count] * span)
        found = judged(bounds.applied(kept, history))
        converged = found.cost > (1 - _GAIN) * best.cost
        best = min(best, found, key=lambda one: one.cost)
        if converged:
            break
    return Reached(best.drive, best.response, iterations, converged, "bounded least squares")


@compiled
def _split(
    plant: Plant,
    drive: Array,
    task: Task,
    scales: tuple[Array, Array],
    state: tuple[Array, Array] | None,
) -> tuple[Array, tuple[Array, Array], Array]:
    """The linearised problem's drive (N,), and the copies and multipliers (2N,) it ended with, and
    how often it split.

    `scales`: the drive's span and the response's stroke; `state`: where the last one ended.
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
    back = jax.linear_transpose(copies, start)
    unbend = jax.linear_transpose(bent, start)
    aim = pull(task.desired - response + push(start))[0]

    def curvature(level: Array) -> Array:
        return pull(push(level))[0] + unbend(bent(level))[0] + _PENALTY * back(copies(level))[0]

    def goes_on(carry: tuple[Array, ...]) -> Array:
        return (carry[3] < _SPLITS) & (carry[4] > _SETTLED)

    def step(carry: tuple[Array, ...]) -> tuple[Array, ...]:
        level, held, multiplier, splits, _ = carry
        right = aim + back(_PENALTY * held - multiplier)[0]
        level, _ = cg(curvature, right, level, tol=1e-8, maxiter=_CONJUGATE_STEPS)
        copied = copies(level)
        now = _RELAXED * copied + (1 - _RELAXED) * held
        before, held = held, jnp.clip(now + multiplier / _PENALTY, task.low, task.high)
        apart = jnp.maximum(jnp.abs(copied - held).max(), jnp.abs(held - before).max())
        return level, held, multiplier + _PENALTY * (now - held), splits + 1, apart

    if state is None:
        held = jnp.clip(copies(start), task.low, task.high)
        state = held, jnp.zeros_like(held)
    begin = (start, *state, jnp.zeros((), int), jnp.full((), jnp.inf))
    level, held, multiplier, splits, _ = jax.lax.while_loop(goes_on, step, begin)
    return level * span, (held, multiplier), splits
