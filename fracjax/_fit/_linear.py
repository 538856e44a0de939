"""A linear model as a state space of SciPy or python-control, by Oustaloup's approximation."""

from __future__ import annotations

from math import log10
from typing import Any, NamedTuple

import jax
import numpy as np

from .._blocks import AbstractLinearBlock
from .._models import Model
from .._recording import InputError, pair_of
from .._show import view_of_tuple
from .._systems import Band, System, rational

_CHECKED = 40
"""Frequencies per decade at which the error is determined."""


_MARGIN = 30.0
"""The filters reach beyond the band by this factor on both sides, for their error is largest at
their edges: 1 % for lfdh at its nominal parameters, where without a margin it is 30 %."""


class LinearSystem(NamedTuple):
    """A linear model as another library's system, and how well it is approximated.

    Attributes:
        system: The state space, from drive to response, in their units: scipy.signal.StateSpace or
            control.StateSpace.
        band: Lowest and highest frequency of the approximation [Hz].
        error: Largest relative error of the transfer function within the band, dimensionless.
    """

    system: Any
    band: tuple[float, float]
    error: float

    def __repr__(self) -> str:
        return view_of_tuple(self).brief()

    def _repr_html_(self) -> str:
        return view_of_tuple(self).html()


def to_scipy(model: Model, band: tuple[float, float]) -> LinearSystem:
    """The model as a scipy.signal.StateSpace, on a band [Hz].  Raises InputError."""
    from scipy.signal import StateSpace

    system, error = _approximated(model, band)
    return LinearSystem(StateSpace(*_matrices(system)), band, error)


def to_control(model: Model, band: tuple[float, float]) -> LinearSystem:
    """The model as a control.StateSpace, on a band [Hz].  Raises InputError."""
    try:
        import control
    except ImportError:
        raise InputError.at(
            "to_control",
            "python-control",
            "no such package",
            'run pip install "fracjax[control]", or use to_scipy',
        ) from None
    system, error = _approximated(model, band)
    return LinearSystem(control.ss(*_matrices(system), name=model.name), band, error)


def _approximated(model: Model, band: tuple[float, float]) -> tuple[System, float]:
    """The model's rational transfer function, and its largest relative error on the band [Hz]."""
    low, high = pair_of(band, "band", "two frequencies in Hz", "write (0.1, 100.0)")
    if not 0 < low < high < np.inf:
        raise InputError.at("band", "0 < low < high in Hz", f"{low:g} to {high:g}", "correct it")
    if not isinstance(model.block, AbstractLinearBlock):
        raise InputError.at(
            f'model "{model.name}"',
            "a linear model, which has a transfer function",
            "one with hysteresis or another nonlinearity",
            "use its linear part, or fit lfdh, creep, pea_dynamics or gain >> resonance",
        )
    count = max(2, round(_CHECKED * log10(high / low)))
    s = 2j * np.pi * np.geomspace(low, high, count)
    with jax.enable_x64(True):
        reach = Band(2 * np.pi * low / _MARGIN, 2 * np.pi * high * _MARGIN)
        system = rational(model.block, reach)
        exact = np.asarray(model.block.symbol(jax.numpy.asarray(s)))
    return system, float(np.abs(system.at(s) / exact - 1).max())


def _matrices(system: System) -> tuple[np.ndarray, ...]:
    """A, B, C and D of a state space with one input and one output."""
    return system.a, system.b[:, None], system.c[None, :], np.array([[system.d]])
