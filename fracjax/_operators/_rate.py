"""The rate of a sampled signal."""

from typing import Any

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from ._grid import Grid


def rate(signal: ArrayLike, grid: Grid) -> Array:
    """d/dt of a signal (N,) by fourth-order central differences; units: signal / s.

    Before the first sample the signal counts as held (`periodic`: as wrapped), after the last one
    as going on by `ahead`.
    """
    longer = _longer(jnp.asarray(signal), grid)
    near = longer[3:-1] - longer[1:-3]
    far = longer[4:] - longer[:-4]
    return (8 * near - far) / (12 * grid.step)


def speed(signal: ArrayLike, grid: Grid) -> Array:
    """|d/dt| of a signal (N,); units: signal / s.

    As `rate` has it, but for the corners of a triangle: there the rate leaps from one sign to the
    other, and its size is what it is on both sides, of which the lesser counts.
    """
    steps = jnp.diff(_longer(jnp.asarray(signal), grid)) / grid.step
    left, right = 1.5 * steps[1:-2] - 0.5 * steps[:-3], 1.5 * steps[2:-1] - 0.5 * steps[3:]
    turned = jnp.where(left * right < 0, jnp.minimum(jnp.abs(left), jnp.abs(right)), 0.0)
    return jnp.maximum(jnp.abs(rate(signal, grid)), turned)


def _longer(signal: Array, grid: Grid) -> Array:
    """A signal (N,) and two samples on each side of it (N + 4,)."""
    if grid.history == "periodic":
        return jnp.concatenate([signal[-2:], signal, signal[:2]])
    return jnp.concatenate([jnp.full(2, signal[0]), signal, jnp.stack(ahead(signal))])


def ahead(signal: Any) -> tuple[Any, Any]:
    """The two samples after the last of a signal (N,), N > 2: by the cubic through the last four,
    or straight on.

    Of the two the one is taken that would have foretold the last three samples better: the cubic
    where the signal is smooth, a straight line where it has just turned a corner or is noisy, for
    there a cubic overshoots by several times the corner or the noise.
    """
    straight = 2 * signal[-1] - signal[-2], 3 * signal[-1] - 2 * signal[-2]
    if signal.shape[0] < 5:
        return straight
    last = signal[-7:]
    of_line = last[2:] - 2 * last[1:-1] + last[:-2]
    of_cubic = of_line[2:] - 2 * of_line[1:-1] + of_line[:-2]
    smooth = (of_cubic**2).mean() < (of_line[-3:] ** 2).mean()
    a, b, c, d = last[-4:]
    cubic = 4 * d - 6 * c + 4 * b - a, 10 * d - 20 * c + 15 * b - 4 * a
    one, two = (line + smooth * (curve - line) for line, curve in zip(straight, cubic, strict=True))
    return one, two
