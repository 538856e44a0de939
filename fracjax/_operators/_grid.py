"""The time grid that a block runs on, and the interpolation of a recorded drive on a finer one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Literal, get_args

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.interpolate import Akima1DInterpolator, CubicSpline

History = Literal["rest", "constant", "periodic"]
HISTORIES: tuple[History, ...] = get_args(History)


class Grid(eqx.Module):
    """Uniform time grid, with the assumption about the drive before its first sample.

    Attributes:
        step: time between samples, one number [s].
        history: the drive for t < 0: `rest` (zero), `constant` (its first value at all times
            before, the Caputo convention) or `periodic` (the samples are whole steady periods).
    """

    step: float | np.ndarray | Array
    history: History = eqx.field(static=True, default="constant")

    def before(self, signal: Array) -> Array:
        """The value of a signal just before its first sample.

        Args:
            signal: (N,), in any unit.

        Returns:
            One number, in the signal's unit: 0, the first or the last sample.
        """
        return {"rest": jnp.zeros(()), "constant": signal[0], "periodic": signal[-1]}[self.history]

    def origin(self, signal: Array) -> Array:
        """The value from which a signal is counted.

        Args:
            signal: (N,), in any unit.

        Returns:
            One number, in the signal's unit: 0 with `rest` history, otherwise the first sample.
        """
        return jnp.zeros(()) if self.history == "rest" else signal[0]

    def changes(self, signal: Array) -> Array:
        """The change of a signal from sample to sample.

        Args:
            signal: (N,), in any unit.

        Returns:
            The changes (N,), in the signal's unit, the first one from `before(signal)`.
        """
        return jnp.diff(signal, prepend=self.before(signal))


_STAIRCASE_SHARE = 0.05
"""The largest share of samples at which a staircase changes; a ramp changes at successive samples.
Chosen by judgement."""
_INTERPOLATORS = {
    "linear": lambda t, u: partial(np.interp, xp=t, fp=u),
    "akima": lambda t, u: Akima1DInterpolator(t, u, method="makima"),
    "cubic": CubicSpline,
}


def _is_staircase(drive: np.ndarray) -> bool:
    """Whether a drive (N,) is constant except for a few isolated changes."""
    changes = np.abs(np.diff(drive)) > 1e-9 * np.ptp(drive)
    isolated = not np.any(changes[1:] & changes[:-1])
    return bool(0 < changes.sum() <= _STAIRCASE_SHARE * drive.size) and isolated


def interpolate(drive: np.ndarray, oversampling: int) -> tuple[np.ndarray, str]:
    """Interpolate a drive on a finer grid.

    A staircase is held.  Otherwise linear, Akima and cubic interpolation each predict the odd
    samples from the even ones and vice versa, and the method with the smallest mean absolute error
    in either direction is used: straight for triangles, smooth for sines.  The mean square would
    give the few corners of a triangle, which a straight line must miss, more weight than all
    samples that it follows exactly.

    Args:
        drive: (N,), in any unit.
        oversampling: how many times finer the grid is.

    Returns:
        The drive ((N-1)·oversampling + 1,), in its unit, and the name of the method.
    """
    samples = np.arange(drive.size)
    fine = np.linspace(0, drive.size - 1, (drive.size - 1) * oversampling + 1)
    if _is_staircase(drive):
        return drive[np.floor(fine + 1e-9).astype(int)], "hold"

    def error(make: Callable, nodes: np.ndarray) -> float:
        between = nodes[:-1] + 1
        return float(np.mean(np.abs(make(nodes, drive[nodes])(between) - drive[between])))

    errors = {
        name: min(error(make, samples[::2]), error(make, samples[1::2]))
        for name, make in _INTERPOLATORS.items()
    }
    best = min(errors, key=errors.__getitem__)
    return np.asarray(_INTERPOLATORS[best](samples, drive)(fine)), best


def refine(drive: np.ndarray, oversampling: int, history: History) -> np.ndarray:
    """A drive on the finer grid that a block with this history runs on.

    Args:
        drive: (N,), in any unit.
        oversampling: how many times finer the grid is.
        history: with `periodic`, whole periods stay whole.

    Returns:
        The drive, in its unit: (N·oversampling,) with `periodic` history, otherwise
        ((N-1)·oversampling + 1,).
    """
    if oversampling == 1:
        return drive
    if history == "periodic":
        return interpolate(np.append(drive, drive[0]), oversampling)[0][:-1]
    return interpolate(drive, oversampling)[0]
