"""The time grid a block runs on, and how a recorded drive is carried onto a finer one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.interpolate import Akima1DInterpolator, CubicSpline, interp1d

History = Literal["rest", "constant", "periodic"]
HISTORIES: tuple[History, ...] = get_args(History)


class Grid(eqx.Module):
    """Uniform grid with what is assumed before its first sample.

    `step` [s].  `history` says what the drive did for t < 0: `rest` (zero), `constant`
    (its first value, for ever: the Caputo convention) or `periodic` (the samples are whole steady
    periods).
    """

    step: float | np.ndarray | Array
    history: History = eqx.field(static=True, default="constant")

    def before(self, signal: Array) -> Array:
        """What a signal (N,) was just before its first sample."""
        return {"rest": jnp.zeros(()), "constant": signal[0], "periodic": signal[-1]}[self.history]

    def origin(self, signal: Array) -> Array:
        """What a signal (N,) is counted from: zero where it began at rest, or its first sample."""
        return jnp.zeros(()) if self.history == "rest" else signal[0]

    def changes(self, signal: Array) -> Array:
        """How far a signal goes from sample to sample (N,), the first from before it."""
        return jnp.diff(signal, prepend=self.before(signal))


# A staircase changes rarely, and from one sample to the next; a ramp's changes follow each other.
_STAIRCASE_SHARE = 0.05
_INTERPOLATORS = {
    "linear": lambda t, u: interp1d(t, u),
    "akima": lambda t, u: Akima1DInterpolator(t, u, method="makima"),
    "cubic": CubicSpline,
}


def _is_staircase(drive: np.ndarray) -> bool:
    changes = np.abs(np.diff(drive)) > 1e-9 * np.ptp(drive)
    isolated = not np.any(changes[1:] & changes[:-1])
    return bool(0 < changes.sum() <= _STAIRCASE_SHARE * drive.size) and isolated


def interpolate(drive: np.ndarray, oversampling: int) -> tuple[np.ndarray, str]:
    """Carry a drive (N,), of any unit, onto a grid `oversampling` times finer.

    Of shape ((N-1)·oversampling + 1,).

    A staircase is held.  Otherwise linear, Akima and cubic interpolation are each asked to predict
    the odd samples from the even ones and back, and the one that errs least either way is used, in
    the mean of its errors' sizes: straight for triangles, smooth for sines.  By their squares the
    few corners that a straight line must miss would count more than all that it follows exactly.
    Returns the finer drive and the name of the method.
    """
    samples = np.arange(drive.size)
    fine = np.linspace(0, drive.size - 1, (drive.size - 1) * oversampling + 1)
    if _is_staircase(drive):
        return drive[np.floor(fine + 1e-9).astype(int)], "hold"

    def error(make: Callable, known: np.ndarray) -> float:
        asked = known[:-1] + 1
        return float(np.mean(np.abs(make(known, drive[known])(asked) - drive[asked])))

    errors = {
        name: min(error(make, samples[::2]), error(make, samples[1::2]))
        for name, make in _INTERPOLATORS.items()
    }
    best = min(errors, key=errors.__getitem__)
    return np.asarray(_INTERPOLATORS[best](samples, drive)(fine)), best


def refine(drive: np.ndarray, oversampling: int, history: History) -> np.ndarray:
    """A drive (N,), of any unit, on the grid that a law with this history runs on.

    Whole periods stay whole.
    """
    if oversampling == 1:
        return drive
    if history == "periodic":
        return interpolate(np.append(drive, drive[0]), oversampling)[0][:-1]
    return interpolate(drive, oversampling)[0]
