"""The Laplace variable on a contour known in advance, whose fractional powers are cheap."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

_KNOWN = (np.ndarray, np.generic, float)


class Laplace:
    """s = points/step at `points` (F,), complex, and a step [s]; units: 1/s.

    A fractional power is s^a = exp(a log points) step^-a: of points in a NumPy array the logarithm
    is taken once, when the program is compiled, which makes a kernel's evaluation one complex
    exponential per point.  Where the exponent is NumPy's too, so is the power.
    In sums, products and quotients it acts as the complex array that it stands for; any other
    function wants `jnp.asarray(s)`.
    """

    __array_ufunc__ = None  # NumPy leaves `array * s` to this class

    def __init__(self, points: np.ndarray | Array, step: ArrayLike):
        self._points, self._step = points, step
        known = isinstance(points, np.ndarray)
        self._logarithm = np.log(points) if known else jnp.log(points)

    def __jax_array__(self) -> Array:
        # A complex quotient costs many times the product.
        return jnp.asarray(self._points) * (1 / self._step)

    def _values(self) -> Any:
        known = isinstance(self._points, np.ndarray) and isinstance(self._step, _KNOWN)
        return self._points / self._step if known else self.__jax_array__()

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, int):
            return self._values() ** exponent
        known = (isinstance(x, _KNOWN) for x in (self._logarithm, self._step, exponent))
        if all(known):
            return np.exp(exponent * self._logarithm) * self._step**-exponent
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
