r"""Convolution quadrature: a symbol K(s) becomes the causal kernel with generating function

    Σ_n w_n ζ^n = K(δ_p(ζ)/h),        δ_p(ζ) = Σ_{k=1}^{p} (1-ζ)^k / k,

where p = 1 is backward Euler (for K = s^α: Grünwald–Letnikov), p = 2 is BDF2 and p = 4 is BDF4.
BDF4 suits symbols whose singularities lie near the negative real axis (powers, lags); a lightly
damped mode lies outside its region of stability.  Order 3 serves such symbols: it extrapolates two
A-stable BDF2 kernels of steps h and 2h on the same grid, (4 K(δ_2(ζ)/h) - K(δ_2(ζ²)/2h)) / 3.
Source: Ch. Lubich, Convolution quadrature and discretized operational calculus I, Numer. Math. 52
(1988) 129–145.

The transform is taken on the circle |ζ| = r with r^L = 1e-10, where L ≥ 2N is its length: terms
that wrap round the circle are damped by r^L, and rounding errors grow by at most r^-N ≤ 1e5, so
that the result agrees with the direct O(N²) sum to about 1e-11 of its largest value.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike
from scipy.fft import next_fast_len

from ._grid import Grid
from ._laplace import Laplace

Symbol = Callable[[Any], Array]
"""A transfer function K(s), called with s as a `Laplace` variable or as a complex array."""

_WRAP_AROUND = 1e-10
"""r^L, the damping of terms that wrap round the circle; see the module's docstring."""


def generating_function(zeta: Any, order: int) -> Any:
    """δ_p(ζ) of the backward differentiation formula of order p, dimensionless.

    Args:
        zeta: ζ, complex, of any shape, dimensionless.
        order: p, 1 to 4.

    Returns:
        δ_p(ζ), of ζ's shape, dimensionless.
    """
    step = 1 - zeta
    total = step / order
    for k in range(order - 1, 0, -1):  # Horner's scheme: products, which cost less than powers
        total = step * (1 / k + total)
    return total


def circle(samples: int) -> tuple[int, float]:
    """Length of the transform and radius of its circle for a signal of N samples.

    Args:
        samples: N.

    Returns:
        L ≥ 2N, a length that is fast to transform, and r = 1e-10^(1/L), both dimensionless.
    """
    length = int(next_fast_len(2 * samples, True))  # type: ignore[arg-type]
    return length, _WRAP_AROUND ** (1 / length)


def quadrature_symbol(symbol: Symbol, zeta: np.ndarray | Array, grid: Grid, order: int) -> Any:
    """The generating function Σ_n w_n ζ^n of a kernel's weights.

    Args:
        symbol: K(s), s in [1/s].
        zeta: ζ (F,), complex, dimensionless.
        grid: its step h [s] counts.
        order: order of the quadrature, 1 to 4.

    Returns:
        The value (F,) at each ζ, complex, in the unit of K.
    """
    if order == 3:
        fine = symbol(Laplace(generating_function(zeta, 2), grid.step))
        coarse = symbol(Laplace(generating_function(zeta**2, 2), 2 * grid.step))
        return (4 * fine - coarse) / 3
    return symbol(Laplace(generating_function(zeta, order), grid.step))


def _symbol_on_circle(symbol: Symbol, samples: int, grid: Grid, order: int) -> Array:
    """The generating function of the weights on the circle (L/2 + 1,), complex, in K's unit."""
    length, radius = circle(samples)
    angles = 2 * np.pi * np.arange(length // 2 + 1) / length
    return quadrature_symbol(symbol, radius * np.exp(-1j * angles), grid, order)


def kernel(symbol: Symbol, samples: int, grid: Grid, order: int = 2) -> Array:
    """The first quadrature weights w_n of K(s): response_n = Σ_j w_j drive_{n-j}.

    Args:
        symbol: K(s) in response unit per drive unit, s in [1/s].
        samples: N, the number of weights.
        grid: its step [s] counts.
        order: order of the quadrature, 1 to 4.

    Returns:
        The weights (N,), in the unit of K.
    """
    length, radius = circle(samples)
    values = jnp.fft.irfft(_symbol_on_circle(symbol, samples, grid, order), length)[:samples]
    return values * radius ** -np.arange(samples, dtype=float)


def convolve(
    symbol: Symbol, static_gain: ArrayLike, drive: Array, grid: Grid, order: int = 4
) -> Array:
    """Response of a linear system K(s) to a drive on the grid.

    With `constant` history the kernel acts on the drive minus its first value, and that value is
    multiplied by `static_gain`.  With `periodic` history the steady response is exact at the
    harmonics of the record, K(jω).  Cost: two real transforms of length ≥ 2N.

    Args:
        symbol: K(s) in response unit per drive unit, s in [1/s].  If its parameters have the shape
            (…, 1), such as several orders at once, its values have the shape (…, F).
        static_gain: K(0), one number or (…, 1), in the unit of K; 0 for a power of s, which has
            none.
        drive: (N,), in drive units.
        grid: step [s] and history.
        order: order of the quadrature, 1 to 4.

    Returns:
        The response (…, N), in response units.
    """
    samples = drive.shape[0]
    if grid.history == "periodic":
        harmonics = 2j * np.pi * np.arange(1, samples // 2 + 1) / samples
        response = symbol(Laplace(harmonics, grid.step))
        static = jnp.broadcast_to(static_gain, (*response.shape[:-1], 1))
        response = jnp.concatenate([static, response], axis=-1)
        return jnp.fft.irfft(response * jnp.fft.rfft(drive), samples)
    before = drive[0] if grid.history == "constant" else 0.0
    length, radius = circle(samples)
    damping = radius ** np.arange(samples, dtype=float)
    transform = jnp.fft.rfft((drive - before) * damping, length)
    symbols = _symbol_on_circle(symbol, samples, grid, order)
    response = jnp.fft.irfft(symbols * transform, length)[..., :samples] / damping
    return response + static_gain * before


def derivative(order: ArrayLike, drive: Array, grid: Grid, accuracy: int = 4) -> Array:
    """D^a of the drive: derivative for a > 0, identity at a = 0, integral for a < 0 [F 1, L 1].

    Differentiable in the order, also at 0 and 1, and in the drive.  With `constant` history this is
    Caputo's derivative: the first value has no influence.

    Args:
        order: a, dimensionless: one number, or (…, 1) for several orders by one transform.
        drive: (N,), in any unit.
        grid: step [s] and history.
        accuracy: order of the quadrature, 1 to 4; 1 is Grünwald–Letnikov.

    Returns:
        The derivative, (N,) or (…, N), in units of the drive · s^-a.
    """
    return convolve(lambda s: s**order, 0.0, drive, grid, accuracy)


def direct_convolution(weights: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """The convolution as a plain O(N²) sum, against which tests check the fast one.

    Args:
        weights: (N,), in response unit per drive unit, such as those that `kernel` returns.
        drive: (N,), in drive units.

    Returns:
        The response (N,), in response units.
    """
    return np.array([weights[: n + 1] @ drive[n::-1] for n in range(drive.size)])
