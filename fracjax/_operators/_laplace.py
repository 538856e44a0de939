"""The Laplace variable on a contour that is known when a program is compiled."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

_CONCRETE = (np.ndarray, np.generic, float)
"""Types whose values are known when a program is compiled."""


class Laplace:
    """The Laplace variable s = points/step, complex (F,), in units of 1/s.

    A fractional power is s^a = exp(a log points) step^-a.  If the points are a NumPy array, their
    logarithm is taken once, when the program is compiled, and a kernel costs one complex
    exponential per point.  If the exponent is NumPy's too, so is the power.
    Sums, products and quotients treat it as the complex array that it stands for; any other
    function needs `jnp.asarray(s)`.

    Args:
        points: s · step (F,), complex, dimensionless.
        step: the grid's step, one number [s].
    """

    __array_ufunc__ = None  # NumPy leaves `array * s` to this class

    def __init__(self, points: np.ndarray | Array, step: ArrayLike):
        self._points, self._step = points, step
        is_concrete = isinstance(points, np.ndarray)
        self._logarithm = np.log(points) if is_concrete else jnp.log(points)

    def __jax_array__(self) -> Array:
        # A complex quotient costs many times the product.
        return jnp.asarray(self._points) * (1 / self._step)

    def _values(self) -> Any:
        """s (F,), complex [1/s], in NumPy if its points and its step are."""
        is_concrete = isinstance(self._points, np.ndarray) and isinstance(self._step, _CONCRETE)
        return self._points / self._step if is_concrete else self.__jax_array__()

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, int):
            return self._values() ** exponent
        concrete = (isinstance(x, _CONCRETE) for x in (self._logarithm, self._step, exponent))
        if all(concrete):
            # NumPy's real exponential, sine and cosine take a fifth of the time of its complex one.
            logarithm = np.asarray(self._logarithm)
            exponent, places = _distinct(exponent)
            phase = np.asarray(exponent * np.imag(logarithm))
            size = np.exp(exponent * np.real(logarithm)) * self._step**-exponent
            power = np.empty(phase.shape, complex)
            power.real, power.imag = size * np.cos(phase), size * np.sin(phase)
            return power if places is None else power[places]
        power = jnp.exp(exponent * jnp.asarray(self._logarithm))
        return power * jnp.asarray(self._step) ** -exponent

    def __neg__(self) -> Any:
        return -self._values()

    def __add__(self, other: Any) -> Any:
        return self._values() + other

    def __sub__(self, other: Any) -> Any:
        return self._values() - other

    def __rsub__(self, other: Any) -> Any:
        return other - self._values()

    def __mul__(self, other: Any) -> Any:
        return self._values() * other

    def __truediv__(self, other: Any) -> Any:
        return self._values() / other

    def __rtruediv__(self, other: Any) -> Any:
        return other / self._values()

    __radd__, __rmul__ = __add__, __mul__


def _distinct(exponents: Any) -> tuple[Any, np.ndarray | None]:
    """The distinct ones of exponents (n, 1) and the place of each; others as they are."""
    if np.ndim(exponents) != 2 or len(exponents) < 2:
        return exponents, None
    distinct, places = np.unique(exponents, return_inverse=True)
    return distinct[:, None], places.ravel()
