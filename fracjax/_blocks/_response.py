"""The frequency response, the step response and the poles of a block."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from .._operators import Grid
from .._recording import InputError
from ._block import AbstractBlock, AbstractLinearBlock, LinearParallel, LinearSeries
from ._ladder import AbstractLadder
from .creep import Creep, LogarithmicCreep
from .drive_circuit import DriveCircuit
from .drive_lag import DriveLag
from .foh_linear import FOHLinear
from .inverse_lfdh import InverseLFDH
from .lfdh import LFDH
from .pea_dynamics import PEADynamics
from .quasi_static_force import QuasiStaticForce
from .resonance import Resonance
from .second_mode import SecondMode
from .single_operator import SingleOperator

_OVERSAMPLING = 8
"""How many times finer the grid of a step response is than its times; chosen by judgement."""


class Bode(NamedTuple):
    """Magnitude and phase of a frequency response.

    Attributes:
        magnitude_dB: 20 log10 |G| (F,) [dB].
        phase_deg: phase (F,), unwrapped along the list of frequencies [degrees].
    """

    magnitude_dB: np.ndarray
    phase_deg: np.ndarray


def frequency_response(block: AbstractBlock, frequencies_Hz: ArrayLike) -> np.ndarray:
    """The frequency response G(j2πf), exact.

    Args:
        block: a linear block with a transfer function.
        frequencies_Hz: f (F,) [Hz], above 0.

    Returns:
        G(j2πf) (F,), complex [response/drive].

    Raises:
        InputError: if the block has no transfer function, or a frequency is not above 0.
    """
    with jax.enable_x64(True):
        linear = _linear(block, "frequency response")
        frequencies = np.atleast_1d(np.asarray(frequencies_Hz, dtype=float))
        if frequencies.ndim != 1 or not np.all((frequencies > 0) & np.isfinite(frequencies)):
            raise InputError.at(
                "frequency response",
                "a list of frequencies above 0 Hz",
                "others",
                "leave out those that are not",
            )
        return np.asarray(linear.symbol(jnp.asarray(2j * np.pi * frequencies)))


def bode(block: AbstractBlock, frequencies_Hz: ArrayLike) -> Bode:
    """Magnitude and phase of the frequency response.

    Args:
        block: a linear block with a transfer function.
        frequencies_Hz: f (F,) [Hz], above 0.

    Returns:
        Magnitude (F,) [dB] and phase (F,) [degrees], unwrapped along the list.

    Raises:
        InputError: if the block has no transfer function, or a frequency is not above 0.
    """
    response = frequency_response(block, frequencies_Hz)
    return Bode(20 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response))))


def step_response(block: AbstractBlock, times: ArrayLike, height: float = 1.0) -> np.ndarray:
    """The response to a step of the drive at t = 0, from rest.

    The block runs on a grid 8 times finer.  At t = 0 the drive has half its height, the mean of
    both sides, so that the error is of second order in the step.

    Args:
        block: any block.
        times: (N,), N > 2, uniform from 0 [s].
        height: of the step [drive unit].

    Returns:
        The response (N,) [response unit].

    Raises:
        InputError: if the times are not uniform or do not start at 0.
    """
    t = np.asarray(times, dtype=float)
    uniform = t.ndim == 1 and t.size > 2 and t[0] == 0 and t[1] > 0
    if not (uniform and np.allclose(np.diff(t), t[1], rtol=1e-6, atol=0)):
        raise InputError.at(
            "step response", "uniform times from 0", "others", "use numpy.arange(N) * step"
        )
    with jax.enable_x64(True):
        drive = np.full((t.size - 1) * _OVERSAMPLING + 1, float(height))
        drive[0] /= 2
        step = t[-1] / (drive.size - 1)
        response = block(jnp.asarray(drive), Grid(np.asarray(step), "rest"))
        return np.asarray(response)[::_OVERSAMPLING]


def poles(block: AbstractBlock) -> np.ndarray:
    """The poles of G(s) on the principal sheet |arg s| < π.

    A lag has one and a mode two; a series or a sum has those of its parts.  Powers of s have a
    branch point at 0 and no pole.  LFDH and its inverse have no pole either: 1 + χ s^μ = 0 requires
    arg s = ±π/μ, and for 0 < μ < 1 that lies beyond ±π, on another sheet; they relax by the branch
    cut alone, without an exponential.

    Args:
        block: a linear block with a transfer function.

    Returns:
        The poles (P,), complex [1/s].

    Raises:
        InputError: if the block has no transfer function, or its poles have no closed form here.
    """
    linear = _linear(block, "poles")
    match linear:
        case LinearSeries() | LinearParallel():
            return np.concatenate([poles(linear.first), poles(linear.second)])
        case DriveLag() | DriveCircuit():
            return np.array([-1 / linear.time_constant.value + 0j])
        case AbstractLadder():
            return -1 / np.asarray(linear.times) + 0j
        case Resonance() | PEADynamics():
            return _of_mode(linear.frequency.value, linear.damping.value)
        case SecondMode():
            first = _of_mode(linear.frequency.value, linear.damping.value)
            second = linear.frequency.value * linear.ratio.value, linear.second_damping.value
            return np.concatenate([first, _of_mode(*second)])
        case (
            QuasiStaticForce()
            | SingleOperator()
            | Creep()
            | LogarithmicCreep()
            | FOHLinear()
            | LFDH()
            | InverseLFDH()
        ):
            return np.zeros(0, dtype=complex)
    raise InputError.at(
        "poles",
        "a block whose poles have a closed form",
        type(linear).__name__,
        "compute its frequency response instead",
    )


def _of_mode(frequency: ArrayLike, damping: ArrayLike) -> np.ndarray:
    """The two poles (2,) [1/s] of a mode, from its frequency [Hz] and its damping ratio."""
    omega, zeta = 2 * np.pi * np.asarray(frequency), np.asarray(damping)
    root = np.sqrt(zeta**2 - 1 + 0j)
    return np.array([omega * (root - zeta), -omega * (root + zeta)])


def _linear(block: AbstractBlock, where: str) -> AbstractLinearBlock:
    """The block itself, once it has a transfer function; otherwise an InputError at `where`."""
    if not isinstance(block, AbstractLinearBlock):
        raise InputError.at(
            where,
            "a linear block with a transfer function",
            type(block).__name__,
            "compute its step response, or give a linear part of it",
        )
    return block
