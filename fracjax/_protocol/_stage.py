"""The hardware that a drive is designed for, as it was described or recorded."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from .._path import Signal
from .._prepare import Noise, measured_noise
from .._recording import InputError, Recording, parse_quantity, unit
from ._limits import Limits, limits_of, recorded_limits
from ._signals import recorded_signal

_NOISE = "0.1 %"
"""Of the response, rms over the stroke, where none is said."""
STROKE = "% of the stroke"
"""The unit of the response of an actuator whose stroke is not known."""


@dataclass(frozen=True)
class Stage:
    """The hardware, and what was recorded of it.

    Attributes:
        limits: of the drive.
        slope: of the response [response unit/drive unit].
        noise: of the response, rms [response unit].
        units: of drive and response.
        signals: what was recorded.
    """

    limits: Limits
    slope: float
    noise: float
    units: tuple[str, str]
    signals: tuple[Signal, ...] = ()


def described(limits: tuple[Limits, str], noise: str | float | None, stroke: str | None) -> Stage:
    """The hardware as it was described: limits and the drive's unit, noise and stroke.

    Raises:
        InputError: if one of them is unusable.
    """
    (own, drive), (size, response) = limits, (100.0, STROKE)
    if stroke is not None:
        response = stroke.strip().lstrip("+-.0123456789eE").strip() or "um"
        size = above_zero(stroke, response, "--stroke")
    return Stage(
        own,
        size / own.span,
        _level(_NOISE if noise is None else noise, size, response),
        (drive, response),
    )


def recorded(
    recordings: Sequence[Recording], limits: tuple[Limits, str] | None, noise: str | float | None
) -> Stage:
    """The hardware as it was recorded, within limits or, without any, the recorded ones.

    Raises:
        InputError: if no noise is given, and a recording shows none.
    """
    first, usual = recordings[0], recorded_limits(recordings)
    own = usual if limits is None else limits[0]
    if own.slew == inf:
        own = replace(own, slew=usual.slew)
    slope = max(float(np.ptp(r.response) / np.ptp(r.drive)) for r in recordings)
    noises = []
    for recording in recordings:
        given = measured_noise(recording)
        if given is None or noise is not None:
            if noise is None:
                raise InputError.at(
                    recording.source, "repeats or a rest, which show its noise", "neither",
                    f"give the noise in {first.response_unit}",
                )  # fmt: skip
            level = _level(noise, slope * own.span, first.response_unit)
            given = Noise(level, first.response_unit, "specification", np.ones(1), level)
        noises.append(given)
    return Stage(
        own,
        slope,
        max(given.sigma for given in noises),
        (first.drive_unit, first.response_unit),
        tuple(recorded_signal(r, given) for r, given in zip(recordings, noises, strict=True)),
    )


def limits_given(
    text: str | Limits | None, capacitance: str | None, resolution: str | None, default: str
) -> tuple[Limits, str] | None:
    """Limits as they were given, and the drive's unit; None where they were not.

    Raises:
        InputError: if they are unusable.
    """
    if text is None:
        return None
    limits, own = (
        limits_of(text, default, capacitance) if isinstance(text, str) else (text, default or "V")
    )
    if resolution is not None:
        limits = replace(limits, code=above_zero(resolution, own, "--resolution"))
    return limits, own


def above_zero(text: str | float, default: str, where: str) -> float:
    """A quantity above zero in a unit."""
    value = parse_quantity(text, default, where)
    if not value > 0:
        raise InputError.at(where, "a value above zero", f'"{text}"', "correct it")
    return value


def _level(noise: str | float, stroke: float, response: str) -> float:
    """A noise [response unit], given in it or over the stroke."""
    share = str(noise).strip()
    if share.endswith("%"):
        return 0.01 * stroke * above_zero(share, "%", "--noise")
    if response == STROKE:
        raise InputError.at(
            "--noise", 'a share of the stroke such as "0.1 %", or --stroke beside it',
            f'"{noise}" alone', 'add --stroke, such as "20 um"',
        )  # fmt: skip
    unit(response, "--stroke")
    return above_zero(noise, response, "--noise")
