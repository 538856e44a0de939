r"""Convolution quadrature: a symbol K(s) becomes the causal kernel with generating function

    Σ_n w_n ζ^n = K(δ_p(ζ)/h),        δ_p(ζ) = Σ_{k=1}^{p} (1-ζ)^k / k,

where p = 1 is backward Euler (for K = s^α: Grünwald–Letnikov), p = 2 is BDF2 and p = 4 is BDF4.
BDF4 suits symbols whose singularities lie near the negative real axis (powers, lags); a lightly
damped mode lies outside its region of stability.  Order 3 serves those: two BDF2 kernels of steps h
and 2h on the one grid, extrapolated, (4 K(δ_2(ζ)/h) - K(δ_2(ζ²)/2h)) / 3, each A-stable.
Source: Ch. Lubich, Convolution quadrature and discretized operational calculus I, Numer. Math. 52
(1988) 129–145.

The transform is taken on the circle |ζ| = r with r^L = 1e-10, L ≥ 2N the transform's length: what
wraps round the circle is damped by r^L, and rounding errors grow by at most r^-N ≤ 1e5, so that the
result agrees with the direct O(N²) sum to about 1e-11 of its largest value.
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

# Called with s as a `Laplace` variable or as a complex array.
Symbol = Callable[[Any], Array]

_WRAP_AROUND = 1e-10


def generating_function(zeta: Any, order: int) -> Any:
    """δ_p(ζ) of the backward differentiation formula of order p, dimensionless."""
    return sum(((1 - zeta) ** k / k for k in range(2, order + 1)), 1 - zeta)


def circle(samples: int) -> tuple[int, float]:
    """Length L of the transform for a signal of so many samples, and the radius of its circle."""
    length = int(next_fast_len(2 * samples, True))  # type: ignore[arg-type]
    return length, _WRAP_AROUND ** (1 / length)


def quadrature_symbol(symbol: Symbol, zeta: np.ndarray | Array, grid: Grid, order: int) -> Any:
    """The generating function of a kernel's weights at ζ (F,), complex."""
    if order == 3:
        fine = symbol(Laplace(generating_function(zeta, 2), grid.step))
        coarse = symbol(Laplace(generating_function(zeta**2, 2), 2 * grid.step))
        return (4 * fine - coarse) / 3
    return symbol(Laplace(generating_function(zeta, order), grid.step))


def _symbol_on_circle(symbol: Symbol, samples: int, grid: Grid, order: int) -> Array:
    length, radius = circle(samples)
    angles = 2 * np.pi * np.arange(length // 2 + 1) / length
    return quadrature_symbol(symbol, radius * np.exp(-1j * angles), grid, order)


def kernel(symbol: Symbol, samples: int, grid: Grid, order: int = 2) -> Array:
    """The first `samples` quadrature weights w_n of K(s): response_n = Σ_j w_j drive_{n-j}.

    They have the unit of K, response unit per drive unit; s is in [1/s], the grid's step in [s].
    """
    length, radius = circle(samples)
    values = jnp.fft.irfft(_symbol_on_circle(symbol, samples, grid, order), length)[:samples]
    return values * radius ** -np.arange(samples, dtype=float)


def convolve(
    symbol: Symbol, static_gain: ArrayLike, drive: Array, grid: Grid, order: int = 4
) -> Array:
    """Response (…, N) of the linear law K(s) to a drive (N,) on the grid, to the given order (1–4).

    Of parameters (…, 1), such as several orders at once, K(s) is (…, F), K(0) one number or (…, 1).
    K is in response unit per drive unit at s [1/s], and the grid's step in [s].
    With `constant` history the law sees the drive's excursion from its first value, and that value
    itself is passed on by `static_gain` (K(0), or 0 where a power law has none).  With `periodic`
    history the steady response is exact at the harmonics of the record, K(jω).
    Cost: two real transforms of length ≥ 2N.
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

    Of one order the result is (N,), of orders (…, 1) it is (…, N), by one transform.
    `accuracy` is the order of the quadrature: 1 is Grünwald–Letnikov.
    Differentiable in the order through 0 and 1, and in the drive.  Units: drive · s^-a.
    With `constant` history this is Caputo's derivative: the first value is not transmitted.
    """
    return convolve(lambda s: s**order, 0.0, drive, grid, accuracy)


def direct_convolution(weights: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """The same convolution as a plain O(N²) sum: the oracle of the fast one, for tests.

    Weights (N,) in response unit per drive unit, as of `kernel`; drive (N,) in its own unit.
    """
    return np.array([weights[: n + 1] @ drive[n::-1] for n in range(drive.size)])
