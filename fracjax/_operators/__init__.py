"""Fractional operators as jit-compiled causal convolution kernels."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._convolution_quadrature import circle as circle
    from ._convolution_quadrature import convolve as convolve
    from ._convolution_quadrature import derivative as derivative
    from ._convolution_quadrature import direct_convolution as direct_convolution
    from ._convolution_quadrature import generating_function as generating_function
    from ._convolution_quadrature import kernel as kernel
    from ._convolution_quadrature import quadrature_symbol as quadrature_symbol
    from ._definitions import caputo as caputo
    from ._definitions import fractional_integral as fractional_integral
    from ._definitions import grunwald_letnikov as grunwald_letnikov
    from ._definitions import riemann_liouville as riemann_liouville
    from ._definitions import weyl as weyl
    from ._grid import Grid as Grid
    from ._grid import interpolate as interpolate
    from ._grid import refine as refine
    from ._history import HISTORIES as HISTORIES
    from ._history import History as History
    from ._laplace import Laplace as Laplace
    from ._oustaloup import PoleZero as PoleZero
    from ._oustaloup import StreamingFilter as StreamingFilter
    from ._oustaloup import oustaloup as oustaloup
    from ._oustaloup import streaming as streaming
    from ._rate import ahead as ahead
    from ._rate import rate as rate
    from ._rate import speed as speed

__getattr__, __dir__ = attach(__name__)
