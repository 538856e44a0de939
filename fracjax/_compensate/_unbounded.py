"""The drive without limits: fixed-point iteration, then Levenberg–Marquardt.

The Jacobian is never formed: LSMR needs only its products with vectors.
"""

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
"""Largest error of a trajectory that counts as followed, as a share of the stroke; by judgement."""
_FIXED_POINT_STEPS = 30
"""Most steps of the fixed-point iteration; chosen by judgement."""
_SLOWEST_CONTRACTION = 0.8
"""The fixed-point iteration goes on while each step reduces the error to less than this share of
the last one; chosen by judgement."""
_STEPS, _BATCHES = 10, 8
"""Steps of Levenberg–Marquardt per compiled call, and most calls; chosen by judgement."""
_LITTLE = 0.9
"""It ends when one call reduces the error to no less than this share; chosen by judgement."""
# The linear problem of a step is solved only loosely, as the linearisation is not exact either.
_SOLVER = optx.LevenbergMarquardt(
    rtol=1e-10, atol=1e-10, linear_solver=lx.LSMR(rtol=1e-4, atol=1e-12, max_steps=200)
)


class Solution(NamedTuple):
    """A drive (N,), its response (N,), the number of iterations, whether they converged, and how.

    Drive and response are in the model's units; `method` is its name as the report prints it.
    """

    drive: np.ndarray
    response: np.ndarray
    iterations: int
    converged: bool
    method: str


class InvertedPlant(eqx.Module):
    """The plant in series after its approximate inverse: from a reference motion to the response.

    This is nearly the identity, so that the search for the reference (N,) [response] whose response
    is the desired one is well conditioned.
    """

    plant: Plant
    inverse: AbstractBlock

    def drive(self, reference: Array) -> Array:
        """The drive (N,) of the approximate inverse for a reference motion (N,)."""
        grid = Grid(self.plant.step, self.plant.history)
        return self.inverse(reference - self.plant.offset, grid)

    def __call__(self, reference: Array) -> Array:
        """The response (N,) to the drive for a reference motion (N,)."""
        return self.plant(self.drive(reference))


@compiled
def respond(plant: Plant, drive: np.ndarray | Array) -> Array:
    """The plant's response (N,) [response] to a drive (N,) [drive]."""
    return plant(jnp.asarray(drive))


@compiled
def _drive_and_response(system: InvertedPlant, reference: Array) -> tuple[Array, Array]:
    """Drive (N,) and response (N,) for a reference motion (N,)."""
    drive = system.drive(reference)
    return drive, system.plant(drive)


@compiled
def _levenberg_marquardt(
    system: InvertedPlant, reference: Array, desired: Array, stroke: Array
) -> tuple[Array, Array, Array]:
    """Some steps from a reference (N,): the new reference, the number of steps, whether converged.

    The problem is solved in strokes; `reference`, `desired` (N,) and `stroke` are in the response's
    unit.
    """

    def error(scaled: Array, _: None) -> Array:
        return (system(scaled * stroke) - desired) / stroke

    solution = optx.least_squares(error, _SOLVER, reference / stroke, max_steps=_STEPS, throw=False)
    converged = solution.result == optx.RESULTS.successful
    return solution.value * stroke, solution.stats["num_steps"], converged


def find_drive(
    system: InvertedPlant, desired: np.ndarray, stroke: float, progress: Progress
) -> Solution:
    """The drive whose response is `desired` (N,) to 1e-6 of the stroke, or as near as possible.

    Each step of the fixed-point iteration adds the remaining error to the reference motion, which
    contracts if the inverse is accurate enough.  If it does not contract, Levenberg–Marquardt goes
    on from the best reference.  `desired` and `stroke` are in the response's unit.
    """
    # In NumPy: each operation of JAX outside a compiled function is a program to compile.
    reference = best = np.asarray(desired)
    least = last = np.inf
    drive = response = reference
    iterations = 0
    while iterations < _FIXED_POINT_STEPS:
        iterations += 1
        drive, response = map(np.asarray, _drive_and_response(system, reference))
        missing = desired - response
        error = float(np.abs(missing).max()) / stroke
        if error < least:
            least, best = error, reference
        if error <= TOLERANCE:
            method = "closed form" if iterations == 1 else "successive correction"
            return Solution(drive, response, iterations, True, method)
        if not error < _SLOWEST_CONTRACTION * last:
            break
        last, reference = error, reference + missing
    if least == np.inf:
        return Solution(drive, response, iterations, False, "closed form")
    return _by_least_squares(system, best, desired, stroke, iterations, progress)


def _by_least_squares(
    system: InvertedPlant,
    reference: np.ndarray,
    desired: np.ndarray,
    stroke: float,
    iterations: int,
    progress: Progress,
) -> Solution:
    """Levenberg–Marquardt from a reference (N,) until it converges or ten steps gain little."""
    before, done = np.inf, False
    drive = response = reference
    for _ in range(_BATCHES):
        progress("inverting by Levenberg–Marquardt")
        moved, steps, done = _levenberg_marquardt(system, reference, desired, np.float64(stroke))
        reference, iterations = np.asarray(moved), iterations + int(steps)
        drive, response = map(np.asarray, _drive_and_response(system, reference))
        error = float(np.linalg.norm(response - desired))
        accurate = float(np.abs(response - desired).max()) <= TOLERANCE * stroke
        done = bool(done) or accurate or error > _LITTLE * before
        before = error
        if done:
            break
    method = "Levenberg–Marquardt"
    return Solution(drive, response, iterations, done, method)
