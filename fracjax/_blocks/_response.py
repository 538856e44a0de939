"""What a law does to sines and steps, and where its poles lie."""

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


class Bode(NamedTuple):
    """Magnitude 20 log10 |G| [dB] (F,) and unwrapped phase [degrees] (F,)."""

    magnitude_dB: np.ndarray
    phase_deg: np.ndarray


def frequency_response(block: AbstractBlock, frequencies_Hz: ArrayLike) -> np.ndarray:
    """G(j2πf), exact, complex (F,) [response/drive], at frequencies (F,) [Hz].

    Raises InputError for a block without transfer function, and for frequencies not above zero.
    """
    with jax.enable_x64(True):
        law = _linear(block, "frequency response")
        frequencies = np.atleast_1d(np.asarray(frequencies_Hz, dtype=float))
        if frequencies.ndim != 1 or not np.all((frequencies > 0) & np.isfinite(frequencies)):
            raise InputError.at(
                "frequency response", "a list of frequencies above 0 Hz", "others", "correct them"
            )
        return np.asarray(law.symbol(jnp.asarray(2j * np.pi * frequencies)))


def bode(block: AbstractBlock, frequencies_Hz: ArrayLike) -> Bode:
    """Magnitude [dB] and phase [degrees, unwrapped along the list] at frequencies (F,) [Hz].

    Raises InputError as `frequency_response` does.
    """
    response = frequency_response(block, frequencies_Hz)
    return Bode(20 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response))))


def step_response(block: AbstractBlock, times: ArrayLike, height: float = 1.0) -> np.ndarray:
    """Response (N,) to a step of `height` [drive] at t = 0, from rest, at uniform times (N,) [s].

    It is the block's own convolution, on a grid 8 times finer.  At t = 0 the drive has half its
    height, the mean of both sides, so that the error is of second order in the step.
    Raises InputError unless the times are uniform and start at 0.
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
    """Poles of G(s), complex (P,) [1/s], on the principal sheet |arg s| < π.

    A lag has one, a mode two, a sensor's low-pass as many as its order; a series or a sum has those
    of its parts.  Powers of s alone have a branch point at 0 and no pole.  Nor has LFDH or its
    inverse: 1 + χ s^μ = 0 asks for arg s = ±π/μ, and for 0 < μ < 1 that lies beyond ±π, on another
    sheet; the law relaxes by the branch cut alone, never by an exponential.
    Raises InputError for a block without transfer function, or whose poles are not known here.
    """
    law = _linear(block, "poles")
    match law:
        case LinearSeries() | LinearParallel():
            return np.concatenate([poles(law.first), poles(law.second)])
        case DriveLag() | DriveCircuit():
            return np.array([-1 / law.time_constant.value + 0j])
        case AbstractLadder():
            return -1 / np.asarray(law.times) + 0j
        case Resonance() | PEADynamics():
            return _of_mode(law.frequency.value, law.damping.value)
        case SecondMode():
            first = _of_mode(law.frequency.value, law.damping.value)
            second = law.frequency.value * law.ratio.value, law.second_damping.value
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
        "poles", "a law whose poles are known", type(law).__name__, "ask for its frequency response"
    )


def _of_mode(frequency: ArrayLike, damping: ArrayLike) -> np.ndarray:
    omega, zeta = 2 * np.pi * np.asarray(frequency), np.asarray(damping)
    root = np.sqrt(zeta**2 - 1 + 0j)
    return np.array([omega * (root - zeta), -omega * (root + zeta)])


def _linear(block: AbstractBlock, where: str) -> AbstractLinearBlock:
    if not isinstance(block, AbstractLinearBlock):
        raise InputError.at(
            where,
            "a linear law given by its transfer function",
            type(block).__name__,
            "ask for its step response, or for a linear part of it",
        )
    return block
