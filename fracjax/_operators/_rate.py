"""The rate of a sampled signal."""

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from ._grid import Grid


def rate(signal: ArrayLike, grid: Grid) -> Array:
    """The derivative du/dt of a signal by fourth-order central differences.

    Before the first sample the signal has its first value, and after the last one it continues as
    `ahead` extrapolates it; with `periodic` history it wraps round.

    Args:
        signal: (N,), N > 2, in any unit.
        grid: step [s] and history.

    Returns:
        The derivative (N,), in the signal's unit / s.
    """
    padded = _padded(signal, grid)
    near = padded[3:-1] - padded[1:-3]
    far = padded[4:] - padded[:-4]
    return (8 * near - far) / (12 * grid.step)


def speed(signal: ArrayLike, grid: Grid) -> Array:
    """The absolute rate |du/dt| of a signal.

    It is the absolute value of `rate`, except at the corners of a triangle, where the rate changes
    its sign: there it is the smaller of the absolute rates on both sides.

    Args:
        signal: (N,), N > 2, in any unit.
        grid: step [s] and history.

    Returns:
        The absolute rate (N,), in the signal's unit / s.
    """
    every: Any = np if isinstance(signal, np.ndarray) else jnp
    steps = every.diff(_padded(signal, grid)) / grid.step
    before, after = 1.5 * steps[1:-2] - 0.5 * steps[:-3], 1.5 * steps[2:-1] - 0.5 * steps[3:]
    least = every.minimum(every.abs(before), every.abs(after))
    at_corner = every.where(before * after < 0, least, 0.0)
    return every.maximum(every.abs(rate(signal, grid)), at_corner)


def _padded(signal: Any, grid: Grid) -> Any:
    """A signal (N,) and two samples on each side of it (N + 4,), in NumPy if the signal is."""
    every: Any = np if isinstance(signal, np.ndarray) else jnp
    if grid.history == "periodic":
        return every.concatenate([signal[-2:], signal, signal[:2]])
    return every.concatenate([every.full(2, signal[0]), signal, every.stack(ahead(signal))])


def ahead(signal: Any) -> tuple[Any, Any]:
    """Extrapolate the two samples after the last, by a cubic or by a straight line.

    The cubic passes through the last four samples, the line through the last two.  The one that
    would have predicted the last three samples better is used: the cubic where the signal is
    smooth, the straight line where it has just turned a corner or is noisy, since there a cubic
    overshoots by several times the corner or the noise.

    Args:
        signal: (N,), N > 2, in any unit.

    Returns:
        The two samples, in the signal's unit.
    """
    straight = 2 * signal[-1] - signal[-2], 3 * signal[-1] - 2 * signal[-2]
    if signal.shape[0] < 5:
        return straight
    last = signal[-7:]
    line_errors = last[2:] - 2 * last[1:-1] + last[:-2]
    cubic_errors = line_errors[2:] - 2 * line_errors[1:-1] + line_errors[:-2]
    smooth = (cubic_errors**2).mean() < (line_errors[-3:] ** 2).mean()
    a, b, c, d = last[-4:]
    cubic = 4 * d - 6 * c + 4 * b - a, 10 * d - 20 * c + 15 * b - 4 * a
    one, two = (line + smooth * (curve - line) for line, curve in zip(straight, cubic, strict=True))
    return one, two
