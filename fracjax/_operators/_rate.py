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
    return _rate(_padded(signal, grid), grid, 1)


def speed(signal: ArrayLike, grid: Grid, every: int = 1) -> Array:
    """The absolute rate |du/dt| of signals.

    It is the absolute value of `rate`, except at the corners of a triangle, where the rate changes
    its sign: there it is the smaller of the absolute rates on both sides.

    Args:
        signal: (…, N), N > 2, in any unit.
        grid: step [s] and history.
        every: the samples between those at which it is computed.

    Returns:
        The absolute rate (…, ⌈N/every⌉), in the signal's unit / s.
    """
    xp: Any = np if isinstance(signal, np.ndarray) else jnp
    padded = _padded(signal, grid)
    steps = xp.diff(padded)
    before, after = (
        1.5 * steps[..., near : near - 3 or None : every]
        - 0.5 * steps[..., far : far - 3 or None : every]
        for near, far in ((1, 0), (2, 3))
    )
    least = xp.minimum(xp.abs(before), xp.abs(after)) / grid.step
    at_corner = xp.where(before * after < 0, least, 0.0)
    return xp.maximum(xp.abs(_rate(padded, grid, every)), at_corner)


def _rate(padded: Any, grid: Grid, every: int) -> Any:
    """The derivative (…, ⌈N/every⌉) of signals with two samples on each side (…, N + 4)."""
    near = padded[..., 3:-1:every] - padded[..., 1:-3:every]
    far = padded[..., 4::every] - padded[..., :-4:every]
    return (8 * near - far) / (12 * grid.step)


def _padded(signal: Any, grid: Grid) -> Any:
    """Signals (…, N) and two samples on each side of them (…, N + 4), in NumPy if they are."""
    xp: Any = np if isinstance(signal, np.ndarray) else jnp
    if grid.history == "periodic":
        return xp.concatenate([signal[..., -2:], signal, signal[..., :2]], axis=-1)
    first, (one, two) = signal[..., :1], ahead(signal)
    return xp.concatenate([first, first, signal, one[..., None], two[..., None]], axis=-1)


def ahead(signal: Any) -> tuple[Any, Any]:
    """Extrapolate the two samples after the last, by a cubic or by a straight line.

    The cubic passes through the last four samples, the line through the last two.  The one that
    would have predicted the last three samples better is used: the cubic where the signal is
    smooth, the straight line where it has just turned a corner or is noisy, since there a cubic
    overshoots by several times the corner or the noise.

    Args:
        signal: (…, N), N > 2, in any unit.

    Returns:
        The two samples (…), in the signal's unit.
    """
    c, d = signal[..., -2], signal[..., -1]
    straight = 2 * d - c, 3 * d - 2 * c
    if signal.shape[-1] < 5:
        return straight
    last = signal[..., -7:]
    line_errors = last[..., 2:] - 2 * last[..., 1:-1] + last[..., :-2]
    cubic_errors = line_errors[..., 2:] - 2 * line_errors[..., 1:-1] + line_errors[..., :-2]
    smooth = (cubic_errors**2).mean(axis=-1) < (line_errors[..., -3:] ** 2).mean(axis=-1)
    a, b = last[..., -4], last[..., -3]
    cubic = 4 * d - 6 * c + 4 * b - a, 10 * d - 20 * c + 15 * b - 4 * a
    one, two = (line + smooth * (curve - line) for line, curve in zip(straight, cubic, strict=True))
    return one, two
