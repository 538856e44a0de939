"""The time grid that a block runs on, and the interpolation of a recorded drive on a finer one."""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.linalg import get_lapack_funcs

from ._history import History


class Grid(eqx.Module):
    """Uniform time grid, with the assumption about the drive before its first sample.

    Attributes:
        step: time between samples, one number [s].
        history: the drive for t < 0: `rest` (zero), `constant` (its first value at all times
            before, the Caputo convention) or `periodic` (the samples are whole steady periods).
    """

    __getattribute__ = object.__getattribute__  # as in a block

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
_LEAST_CHANGE = 1e-9
"""Changes of slope below this share of the largest leave Akima's slope undefined."""


def _linear_slopes(drive: np.ndarray) -> None:
    """None: the drive is straight between its samples."""


def _akima_slopes(drive: np.ndarray) -> np.ndarray:
    """The slopes (N,) of Akima's interpolation at the samples, as modified by MATLAB ("makima").

    Source: Akima, J. ACM 17 (1970) 589.
    """
    rises = np.pad(np.diff(drive), 2)
    rises[1], rises[-2] = 2 * rises[2] - rises[3], 2 * rises[-3] - rises[-4]
    rises[0], rises[-1] = 2 * rises[1] - rises[2], 2 * rises[-2] - rises[-3]
    change = np.abs(np.diff(rises)) + 0.5 * np.abs(rises[1:] + rises[:-1])
    before, after = change[:-2], change[2:]
    total = before + after
    defined = total > _LEAST_CHANGE * total.max()
    share = np.divide(before, total, out=np.zeros_like(total), where=defined)
    slopes = rises[1:-2] + share * (rises[2:-1] - rises[1:-2])
    return np.where(defined, slopes, 0.5 * (rises[3:] + rises[:-3]))


def _cubic_slopes(drive: np.ndarray) -> np.ndarray:
    """The slopes (N,) of the cubic spline at the samples, whose third derivative is continuous at
    the second sample and the last but one ("not a knot").

    Source: de Boor, A Practical Guide to Splines (1978), ch. IV.
    """
    rises, ends = np.diff(drive), np.ones(drive.size - 1)
    below, above, diagonal = ends.copy(), ends, np.full(drive.size, 4.0)
    right = np.empty(drive.size)
    right[1:-1] = 3 * (rises[1:] + rises[:-1])
    right[0], right[-1] = (5 * rises[0] + rises[1]) / 2, (5 * rises[-1] + rises[-2]) / 2
    diagonal[[0, -1]], above[0], below[-1] = 1.0, 2.0, 2.0
    (gtsv,) = get_lapack_funcs(("gtsv",), (right,))
    return np.asarray(gtsv(below, diagonal, above, right, 1, 1, 1, 1)[3])


_INTERPOLATORS = {"linear": _linear_slopes, "akima": _akima_slopes, "cubic": _cubic_slopes}


def _between(drive: np.ndarray, slopes: np.ndarray | None, share: float) -> np.ndarray:
    """The drive (N-1,) at a share of each step, from the slopes at its samples."""
    low, rises = drive[:-1], np.diff(drive)
    if slopes is None:
        return low + share * rises
    # Hermite's cubic through both ends.
    other = 1 - share
    bend = other * (slopes[:-1] - rises) - share * (slopes[1:] - rises)
    return low + share * (rises + other * bend)


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
    if _is_staircase(drive):
        count = (drive.size - 1) * oversampling + 1
        return np.repeat(drive, oversampling)[:count], "hold"

    def error(slopes_of: Callable, first: int) -> float:
        nodes, middles = drive[first::2], drive[first + 1 :: 2]
        predicted = _between(nodes, slopes_of(nodes), 0.5)
        return float(np.mean(np.abs(predicted - middles[: predicted.size])))

    errors = {name: min(error(of, 0), error(of, 1)) for name, of in _INTERPOLATORS.items()}
    best = min(errors, key=errors.__getitem__)
    slopes = _INTERPOLATORS[best](drive)
    fine = np.empty((drive.size - 1) * oversampling + 1)
    fine[::oversampling] = drive
    for k in range(1, oversampling):
        fine[k::oversampling] = _between(drive, slopes, k / oversampling)
    return fine, best


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
