"""The Laplace variable on a contour known in advance, whose fractional powers are cheap."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike


class Laplace:
    """s = points/step at fixed `points` (F,), complex, and a step [s]; units: 1/s.

    A fractional power is s^a = exp(a log points) step^-a: of points in a NumPy array the logarithm
    is taken once, when the program is compiled, which makes a kernel's evaluation one complex
    exponential per point.
    In sums, products and quotients it acts as the complex array that it stands for; any other
    function wants `jnp.asarray(s)`.
    """

    __array_ufunc__ = None  # NumPy leaves `array * s` to this class

    def __init__(self, points: np.ndarray | Array, step: ArrayLike):
        self._points, self._step = points, step

    def __jax_array__(self) -> Array:
        return jnp.asarray(self._points) / self._step

    def __pow__(self, exponent: Any) -> Array:
        if isinstance(exponent, int):
            return self.__jax_array__() ** exponent
        known = isinstance(self._points, np.ndarray)
        logarithm = jnp.asarray(np.log(self._points) if known else jnp.log(self._points))
        power = jnp.exp(exponent * logarithm)
        return power * jnp.asarray(self._step) ** -exponent

    def __neg__(self) -> Array:
        return -self.__jax_array__()

    def __add__(self, other: Any) -> Array:
        return self.__jax_array__() + other

    def __sub__(self, other: Any) -> Array:
        return self.__jax_array__() - other

    def __rsub__(self, other: Any) -> Array:
        return other - self.__jax_array__()

    def __mul__(self, other: Any) -> Array:
        return self.__jax_array__() * other

    def __truediv__(self, other: Any) -> Array:
        return self.__jax_array__() / other

    def __rtruediv__(self, other: Any) -> Array:
        return other / self.__jax_array__()

    __radd__, __rmul__ = __add__, __mul__
