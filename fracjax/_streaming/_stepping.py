"""The inverse and the model of a fit, sample by sample, for a real-time loop."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._compensate import settled_offset, without_disturbances
from .._fit import Fit
from .._models import Model
from .._recording import UNSTATED, InputError, parse_quantity
from .._systems import Band
from ._adaptive import Adaptation, Learning
from ._chain import chain_of
from ._program import InverseProgram, Limits, ModelProgram
from ._promise import draws_of
from ._sections import FAST, Linear, Sampling, Section, section_of
from ._stages import Filtered, Solved
from ._stream import StreamingInverse, StreamingModel

_MARGIN = 300.0
"""Powers of s are followed over a band wider by this factor at either end; chosen by judgement."""
_REACH, _BEYOND = 20.0, 2.0
"""A derivative rolls off at this factor above the band, and above what counts as fast; chosen by
judgement."""
_TOP, _PERIODS = 0.02, 0.1
"""The band by default: up to this share of the sampling rate, and from this many periods in the
recording; chosen by judgement."""
_SHORTEST = 1e-3
"""The band starts at this share of its end where no recording is known; chosen by judgement."""


class _Given(NamedTuple):
    """What a stream is made of."""

    block: AbstractBlock
    sampling: Sampling
    shared: dict[str, Any]
    limits: Limits
    offset: float


def _given(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None,
    limits: tuple[float, float] | None,
    slew: float | None,
    offset: float | None,
    units: tuple[str, str] | None,
) -> _Given:
    """The block with everything that a stream of it needs, checked."""
    duration, draws, where = None, None, "streaming"
    if isinstance(model, Fit):
        setting, take = model.preparation.setting, model.preparation.takes[0]
        recording = take.recording
        limits = limits or (setting.drive_low, setting.drive_high)
        if offset is None:
            offset = settled_offset(model.model, model.offsets[0], take.history, setting.duration)
        units = units or (recording.drive_unit, recording.response_unit)
        draws = draws_of(
            {name: one.to_dict() for name, one in model.parameters.items()}, model.correlation
        )
        duration, model = setting.duration, model.model
    if not isinstance(model, Model):
        raise InputError.at(where, "a fit or a model", type(model).__name__, "give fj.fit(…)")
    step = parse_quantity(step, "s", f"{where}, step")
    if not 0 < step < np.inf:
        raise InputError.at(f"{where}, step", "a time above 0 s", f"{step:g} s", "correct it")
    if limits is None or not -np.inf < limits[0] < limits[1] < np.inf:
        raise InputError.at(
            f"{where}, limits",
            "lowest and highest drive, which a loop must never leave",
            "none" if limits is None else f"{limits[0]} and {limits[1]}",
            "give limits=(low, high), or a fit, whose recorded range is taken",
        )
    if slew is not None and not 0 < slew < np.inf:
        raise InputError.at(f"{where}, slew", "a rate above 0", f"{slew}", "correct it")
    band = usual_band(step, duration) if band is None else band
    bottom, top = map(float, band)
    if not 0 < bottom < top < 0.5 / step:
        raise InputError.at(
            f"{where}, band",
            f"0 < low < high below {0.5 / step:.4g} Hz",
            f"{bottom:.4g} to {top:.4g} Hz",
            "correct it",
        )
    block, left_out = without_disturbances(model.block)
    if block is None:
        raise InputError.at(where, "a model with a drive", model.name, "choose another model")
    low, high = map(float, limits)
    omega = 2 * np.pi * bottom, 2 * np.pi * top
    roll_off = max(_REACH * omega[1], _BEYOND * FAST / step)
    edges = Band(omega[0] / _MARGIN, omega[1] * _MARGIN, roll_off)
    sampling = Sampling(step, edges, *omega, low, high)
    change = high - low if slew is None else min(slew * step, high - low)
    shared = {
        "model": model.name,
        "units": units or (UNSTATED["drive"], UNSTATED["response"]),
        "step": step,
        "band": (bottom, top),
        "limits": (low, high),
        "slew": slew,
        "offset": offset or 0.0,
        "left_out": left_out,
        "whole": Model(block, model.name),
        "draws": draws,
    }
    return _Given(block, sampling, shared, Limits(low, high, change), offset or 0.0)


def usual_band(step: float, duration: float | None) -> tuple[float, float]:
    """The band [Hz] for a loop's step [s], and a recording of a duration [s] if there is one."""
    top = _TOP / step
    return (min(_PERIODS / duration, _SHORTEST * top) if duration else _SHORTEST * top), top


def streaming_inverse(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    slew: float | None = None,
    offset: float | None = None,
    units: tuple[str, str] | None = None,
    adaptive: Adaptation | None = None,
) -> StreamingInverse:
    """The inverse of a whole model, hysteresis included, sample by sample for a real-time loop.

    A nonlinear law is solved for its drive at every sample, and remembers the drive that was
    applied; linear laws in series with it are difference equations of 1/G(s).  One step takes a
    bounded time and a fixed memory.

    Args:
        model: A fit, or a model, which needs limits.
        step: The time step of the loop [s], or a text such as "50 us".
        band: Lowest and highest frequency [Hz] between which linear parts hold, the highest below
            half the sampling rate; by default up to 2 % of the sampling rate.
        limits: Lowest and highest drive [drive]; by default the range of the fit's recording.
        slew: Fastest change of the drive [drive/s]; None for no limit.
        offset: What the sensor reads where the model's response is zero [response]; by default
            that of the fit, or 0.
        units: Units of drive and response; by default those of the fit, or V and um.
        adaptive: How the gains follow the stage by its measured motion; None for fixed gains.

    Returns:
        The inverse, with the error of its linear parts.

    Raises:
        InputError: When a value is out of order, a law does not run sample by sample, or the model
            has no inverse.

    Source: Krejci & Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185; Hanus, Kinnaert &
    Henrotte, Automatica 23 (1987) 729, for the limits.
    """
    given = _given(model, step, band, limits, slew, offset, units)
    chain = chain_of(given.block, given.sampling)
    learning = None if adaptive is None else Learning(chain, adaptive, given.sampling.step)
    sections = [
        stage.inverse if isinstance(stage, Filtered) else stage.section
        for stage in chain.stages
        if isinstance(stage, Filtered | Solved)
    ]
    return StreamingInverse(
        **given.shared,
        error=_error(sections, given.shared["band"]),
        program=InverseProgram(chain, given.offset, given.limits, learning),
        adaptation=adaptive,
    )


def streaming_model(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    offset: float | None = None,
    units: tuple[str, str] | None = None,
) -> StreamingModel:
    """A whole model sample by sample: the response to the drive that was applied.

    Args:
        model: A fit, or a model, which needs limits.
        step: The time step of the loop [s], or a text such as "50 us".
        band: Lowest and highest frequency [Hz] between which linear parts hold, as in
            `streaming_inverse`.
        limits: Lowest and highest drive [drive]; by default the range of the fit's recording.
        offset: What the sensor reads where the model's response is zero [response]; by default
            that of the fit, or 0.
        units: Units of drive and response; by default those of the fit, or V and um.

    Returns:
        The model, with the error of its linear parts.

    Raises:
        InputError: When a value is out of order, or a law does not run sample by sample.

    Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25, for
    fractional powers.
    """
    given = _given(model, step, band, limits, None, offset, units)
    section = section_of(given.block, given.sampling)
    return StreamingModel(
        **given.shared,
        error=_error([section], given.shared["band"]),
        program=ModelProgram(section, given.offset, given.limits),
    )


def _error(sections: list[Section], band: tuple[float, float]) -> float:
    """The largest error of linear sections, and of those within others, in a band [Hz]."""
    errors = [0.0]
    for section in sections:
        if isinstance(section, Linear):
            errors.append(section.error(band))
        if section.parts:
            errors.append(_error(list(section.parts), band))
    return max(errors)
