"""The drive without limits: fixed-point iteration, then Levenberg–Marquardt without a Jacobian."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jax import Array

from .._blocks import AbstractBlock
from .._computing import compiled
from .._operators import Grid
from .._solve import Progress
from ._plant import Plant

TOLERANCE = 1e-6
_ROUNDS, _SLOWEST = 30, 0.8
_STEPS, _BATCHES, _LITTLE = 10, 8, 0.9
# Each step is solved no further than it can be trusted.
_SOLVER = optx.LevenbergMarquardt(
    rtol=1e-10, atol=1e-10, linear_solver=lx.LSMR(rtol=1e-4, atol=1e-12, max_steps=200)
)


class Reached(NamedTuple):
    """A drive (N,) with its response (N,), how many times the model was asked, and the end."""

    drive: np.ndarray
    response: np.ndarray
    iterations: int
    converged: bool
    method: str


class Inverted(eqx.Module):
    """The plant after the block that nearly undoes it: from what is asked for to what comes.

    Nearly the identity, and so as good as preconditioned for whatever solves for the motion (N,)
    that must be asked for.
    """

    plant: Plant
    inverse: AbstractBlock

    def drive(self, asked: Array) -> Array:
        grid = Grid(self.plant.step, self.plant.history)
        return self.inverse(asked - self.plant.offset, grid)

    def __call__(self, asked: Array) -> Array:
        return self.plant(self.drive(asked))


@compiled
def respond(plant: Plant, drive: np.ndarray | Array) -> Array:
    """The plant's response (N,)."""
    return plant(jnp.asarray(drive))


@compiled
def _ask(system: Inverted, asked: Array) -> tuple[Array, Array]:
    drive = system.drive(asked)
    return drive, system.plant(drive)


@compiled
def _improve(system: Inverted, asked: Array, desired: Array, stroke: Array) -> tuple:
    """Some steps of Levenberg–Marquardt, everything in strokes; where it ended and whether done."""

    def miss(scaled: Array, _: None) -> Array:
        return (system(scaled * stroke) - desired) / stroke

    found = optx.least_squares(miss, _SOLVER, asked / stroke, max_steps=_STEPS, throw=False)
    done = found.result == optx.RESULTS.successful
    return found.value * stroke, found.stats["num_steps"], done


def follow(system: Inverted, desired: np.ndarray, stroke: float, progress: Progress) -> Reached:
    """The drive whose response is `desired` (N,), to 1e-6 of the stroke, or nearest to it.

    Asking for what was missed once more, again and again, contracts while the inverse is near
    enough.  Where it does not, Levenberg–Marquardt goes on from the best.
    """
    asked = best = jnp.asarray(desired)
    least = last = np.inf
    drive = response = asked
    iterations = 0
    while iterations < _ROUNDS:
        iterations += 1
        drive, response = _ask(system, asked)
        missed = jnp.asarray(desired) - response
        error = float(jnp.abs(missed).max()) / stroke
        if error < least:
            least, best = error, asked
        if error <= TOLERANCE:
            method = "closed form" if iterations == 1 else "fixed point"
            return Reached(np.asarray(drive), np.asarray(response), iterations, True, method)
        if not error < _SLOWEST * last:
            break
        last, asked = error, asked + missed
    if least == np.inf:
        return Reached(np.asarray(drive), np.asarray(response), iterations, False, "closed form")
    return _by_least_squares(system, best, jnp.asarray(desired), stroke, iterations, progress)


def _by_least_squares(
    system: Inverted,
    asked: Array,
    desired: Array,
    stroke: float,
    iterations: int,
    progress: Progress,
) -> Reached:
    """Levenberg–Marquardt from a motion asked for (N,); done too where ten steps gain little."""
    before, done = np.inf, False
    drive = response = asked
    for _ in range(_BATCHES):
        progress("inverting by Levenberg–Marquardt")
        asked, steps, done = _improve(system, asked, desired, jnp.asarray(stroke))
        iterations += int(steps)
        drive, response = _ask(system, asked)
        error = float(jnp.linalg.norm(response - desired))
        reached = float(jnp.abs(response - desired).max()) <= TOLERANCE * stroke
        done = bool(done) or reached or error > _LITTLE * before
        before = error
        if done:
            break
    method = "Levenberg–Marquardt"
    return Reached(np.asarray(drive), np.asarray(response), iterations, done, method)
