"""Fractional operators as jit-compiled causal convolution kernels."""

from ._convolution_quadrature import convolve as convolve
from ._convolution_quadrature import derivative as derivative
from ._convolution_quadrature import direct_convolution as direct_convolution
from ._convolution_quadrature import generating_function as generating_function
from ._convolution_quadrature import kernel as kernel
from ._grid import Grid as Grid
from ._grid import interpolate as interpolate
from ._rate import rate as rate
