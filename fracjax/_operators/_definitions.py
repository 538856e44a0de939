r"""The classical fractional derivatives D^a f of a sampled signal, -2 ≤ a ≤ 2, under their names.

All are one convolution with the kernel of s^a; they differ in how they treat the start.  With
g = f - f(0) - f'(0) t, which starts flat, so that its convolution keeps the quadrature's order,

    Riemann–Liouville    D^a f = D^a g + f(0) t^-a/Γ(1-a) + f'(0) t^(1-a)/Γ(2-a)
    Caputo               the same without the first m terms, m-1 < a ≤ m
    Grünwald–Letnikov    lim h^-a Σ_j (-1)^j binom(a, j) f(t - jh): the first-order sum itself
    Weyl                 (iω)^a on every harmonic of a steady period

A negative order is a fractional integral.
Source: Podlubny, Fractional Differential Equations (1999), chapter 2; Lubich, SIAM J. Math. Anal.
17 (1986) 704 for the correction of the start.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.core import Tracer
from jax.scipy.special import gammaln
from jax.typing import ArrayLike

from .._recording import InputError
from ._convolution_quadrature import derivative
from ._grid import Grid

_LARGEST_ORDER = 2.0
"""The largest |a|: the start is corrected by f(0) and f'(0) only, which suffice up to there."""
_FIRST_SLOPE = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12
"""Weights of the one-sided difference of fourth order for f'(0), in units of the step."""


def riemann_liouville(order: ArrayLike, signal: ArrayLike, step: ArrayLike) -> Array:
    """The Riemann–Liouville derivative [L 1] of a signal that is zero before t = 0.

    Differentiable in order and signal; of second order in the step or better for a signal that is
    smooth from t = 0 on.  If the signal does not start at zero, the derivative diverges at t = 0,
    and the first sample holds the value half a step later.

    Args:
        order: a, dimensionless, from -2 to 2; negative for the integral.
        signal: (N,), N ≥ 5, real, in any unit.
        step: time between samples [s].

    Returns:
        The derivative (N,), in units of the signal · s^-a.

    Raises:
        InputError: if the signal is not one real channel, or order or step is out of range.
    """
    return _on_one_channel("riemann_liouville", order, signal, step, _from_start(0))


def fractional_integral(order: ArrayLike, signal: ArrayLike, step: ArrayLike) -> Array:
    """The Riemann–Liouville integral (1/Γ(b)) ∫_0^t f(τ) (t-τ)^(b-1) dτ of a signal.

    It is `riemann_liouville` of order -b.

    Args:
        order: b, dimensionless, from 0 to 2.
        signal: (N,), N ≥ 5, real, in any unit, zero before t = 0.
        step: time between samples [s].

    Returns:
        The integral (N,), in units of the signal · s^b.

    Raises:
        InputError: if the signal is not one real channel, or order or step is out of range.
    """
    minus = -jnp.asarray(order) if isinstance(order, jax.Array) else -np.asarray(order)
    return _on_one_channel("fractional_integral", minus, signal, step, _from_start(0))


def caputo(order: float, signal: ArrayLike, step: ArrayLike) -> Array:
    """The Caputo derivative [F 2] of a signal that had its first value for all t < 0.

        (1/Γ(m-a)) ∫_0^t f^(m)(τ) (t-τ)^(m-a-1) dτ,        m-1 < a ≤ m

    It is Riemann–Liouville's without f(0) t^-a/Γ(1-a), for a > 1 also without f'(0) t^(1-a)/Γ(2-a),
    and therefore jumps where the order passes 0 or 1.  To fit or differentiate the order, use
    `fracjax.derivative` on a grid of constant history.

    Args:
        order: a, dimensionless, a plain number from -2 to 2; for a ≤ 0 the fractional integral.
        signal: (N,), N ≥ 5, real, in any unit.
        step: time between samples [s].

    Returns:
        The derivative (N,), in units of the signal · s^-a.

    Raises:
        InputError: if the signal is not one real channel, the order is traced by JAX, or order or
            step is out of range.
    """
    if isinstance(order, Tracer):
        raise InputError.at(
            "caputo",
            "a plain number for the order",
            "a traced value",
            "use fracjax.derivative on a Grid of constant history",
        )
    left_out = int(order > 0) + int(order > 1)
    return _on_one_channel("caputo", order, signal, step, _from_start(left_out))


def grunwald_letnikov(order: ArrayLike, signal: ArrayLike, step: ArrayLike) -> Array:
    """The Grünwald–Letnikov sum [L 2] of a signal that is zero before its first sample.

        h^-a Σ_{j=0}^{n} w_j f_{n-j},        w_0 = 1,  w_j = w_{j-1} (j - 1 - a)/j

    Differentiable in order and signal; of first order in the step, and equal to the direct sum to
    1e-10 of its peak (1e-9 for a < -1).

    Args:
        order: a, dimensionless, from -2 to 2; negative for the integral.
        signal: (N,), N ≥ 5, real, in any unit.
        step: h, time between samples [s].

    Returns:
        The sum (N,), in units of the signal · s^-a.

    Raises:
        InputError: if the signal is not one real channel, or order or step is out of range.
    """

    def compute(a: Array, f: Array, h: Array) -> Array:
        return derivative(a, f, Grid(h, "rest"), accuracy=1)

    return _on_one_channel("grunwald_letnikov", order, signal, step, compute)


def weyl(order: ArrayLike, signal: ArrayLike, step: ArrayLike) -> Array:
    """The Weyl derivative of a signal that is one or more whole steady periods.

        A sin(ωt + φ) → A ω^a sin(ωt + φ + a π/2)

    Differentiable in order and signal; exact for every harmonic below half the sampling rate.  The
    result has zero mean.

    Args:
        order: a, dimensionless, from -2 to 2; negative for the integral.
        signal: (N,), N ≥ 5, real, in any unit.
        step: time between samples [s].

    Returns:
        The derivative (N,), in units of the signal · s^-a.

    Raises:
        InputError: if the signal is not one real channel, or order or step is out of range.
    """

    def compute(a: Array, f: Array, h: Array) -> Array:
        return derivative(a, f, Grid(h, "periodic"))

    return _on_one_channel("weyl", order, signal, step, compute)


def _on_one_channel(
    where: str,
    order: ArrayLike,
    signal: ArrayLike,
    step: ArrayLike,
    compute: Callable[[Array, Array, Array], Array],
) -> Array:
    """Check the arguments, as far as JAX does not trace them, and compute in float64."""
    dtype = jnp.result_type(signal)
    if jnp.ndim(signal) != 1 or jnp.size(signal) < len(_FIRST_SLOPE) or dtype.kind == "c":
        raise InputError.at(
            where,
            f"a real signal (N,) of at least {len(_FIRST_SLOPE)} samples",
            f"{dtype} of shape {jnp.shape(signal)}",
            "give one channel at a time, or jax.vmap over channels",
        )
    for name, value, usable, wanted in (
        ("order", order, lambda x: abs(x) <= _LARGEST_ORDER, "one number from -2 to 2"),
        ("step", step, lambda x: 0 < x < np.inf, "one positive number of seconds"),
    ):
        is_concrete = not isinstance(value, Tracer)
        if jnp.ndim(value) or (is_concrete and not usable(np.asarray(value))):
            raise InputError.at(f"{where}, {name}", wanted, f"{value}", f"give {wanted}")
    traced = any(isinstance(x, Tracer) for x in (order, signal, step))
    if traced and not jax.config.read("jax_enable_x64"):
        raise InputError.at(
            where,
            "float64 inside a JAX transformation",
            "float32",
            "run the transformation under `with jax.enable_x64(True):`",
        )
    with jax.enable_x64(True):
        return compute(*(jnp.asarray(x, jnp.float64) for x in (order, signal, step)))


def _from_start(left_out: int) -> Callable[[Array, Array, Array], Array]:
    """A function that computes D^a (N,) of a signal (N,) that starts at t = 0, without the powers
    of t that the first `left_out` terms of its Taylor series cause."""

    def compute(order: Array, signal: Array, step: Array) -> Array:
        times = step * jnp.arange(signal.shape[0])
        starts = signal[0], jnp.asarray(_FIRST_SLOPE) @ signal[: len(_FIRST_SLOPE)] / step
        flat = signal - starts[0] - starts[1] * times
        response = derivative(order, flat, Grid(step, "rest"))
        for k in range(left_out, 2):
            power = k - order
            first = jnp.where(power < 0, step / 2, 0.0)
            term = times.at[0].set(first) ** power * _reciprocal_gamma(power + 1)
            response = response + starts[k] * term
        return response

    return compute


def _reciprocal_gamma(x: Array) -> Array:
    """1/Γ(x) for x > -3, smooth through its zeros at 0, -1 and -2."""
    return x * (x + 1) * (x + 2) * jnp.exp(-gammaln(x + 3))
