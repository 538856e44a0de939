"""What an amplifier and a sensor's rate allow of a drive."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, inf

import numpy as np

from .._recording import InputError, Recording, conversion, parse_quantity
from .._show import figure

_WHERE = "--limits"
_FASTER = 10.0
"""The fastest change by default, over the fastest recorded; chosen by judgement."""
_RANGE = re.compile(r"\s*(\S+?)\s*\.\.\s*(\S+?)\s*([A-Za-zµμΩ]*)\s*")


@dataclass(frozen=True)
class Limits:
    """What the hardware allows.

    Attributes:
        low: the lowest drive [drive unit].
        high: the highest drive [drive unit].
        slew: the fastest change of the drive [drive unit/s].
        code: the step between the values that a converter puts out [drive unit], 0 for none.
    """

    low: float
    high: float
    slew: float
    code: float = 0.0

    @property
    def span(self) -> float:
        """The range [drive unit]."""
        return self.high - self.low

    @property
    def centre(self) -> float:
        """The middle of the range [drive unit]."""
        return 0.5 * (self.low + self.high)

    @property
    def reach(self) -> float:
        """Half the range [drive unit]."""
        return 0.5 * self.span

    @property
    def start(self) -> float:
        """Where a drive begins and ends [drive unit]: no drive, or what is nearest to it."""
        return float(np.clip(0.0, self.low, self.high))

    def in_codes(self, step: float) -> Limits:
        """The limits for samples `step` [s] apart that are whole codes.

        Raises:
            InputError: if no code is within the range, or one code is more than a step may be.
        """
        if not self.code:
            return self
        low, high = ceil(self.low / self.code - 1e-9), floor(self.high / self.code + 1e-9)
        if high - low < 2:
            raise InputError.at(
                _WHERE, "a range of many codes of the converter",
                f"{figure(self.span)} with codes {figure(self.code)} apart",
                "give the step between its codes with --resolution",
            )  # fmt: skip
        codes = floor(self.slew * step / self.code + 1e-9)
        if codes < 1:
            raise InputError.at(
                _WHERE, "a change of one code or more per sample",
                f"codes {figure(self.code)} apart and at most {figure(self.slew * step)} per "
                f"sample at {figure(1 / step)} Hz",
                f"give a rate of {figure(self.slew / self.code)} Hz or less",
            )  # fmt: skip
        return Limits(low * self.code, high * self.code, codes * self.code / step, self.code)

    def rounded(self, drive: np.ndarray) -> np.ndarray:
        """A drive (N,) in whole codes: as all are rounded alike, no change becomes faster."""
        return np.floor(drive / self.code + 0.5) * self.code if self.code else drive


def recorded_limits(recordings: Sequence[Recording]) -> Limits:
    """The range that was recorded, and ten times its fastest change."""
    rates = [float(np.abs(np.diff(r.drive)).max() / r.dt) for r in recordings]
    return Limits(
        float(min(r.drive.min() for r in recordings)),
        float(max(r.drive.max() for r in recordings)),
        _FASTER * max(rates),
    )


def parse_limits(text: str, recordings: Sequence[Recording]) -> Limits:
    """Limits from a text.

    Args:
        text: such as "0..100 V, 50 V/ms"; the rate may be left out.
        recordings: they give the drive's unit and the default of the rate.

    Returns:
        The limits, in the drive's unit.

    Raises:
        InputError: if the text is not of this form, or the limits exclude every drive.
    """
    limits, _ = limits_of(text, recordings[0].drive_unit)
    recorded = recorded_limits(recordings).slew
    return limits if limits.slew < inf else replace(limits, slew=recorded)


def limits_of(text: str, default: str = "", capacitance: str | None = None) -> tuple[Limits, str]:
    """Limits from a text, and the drive's unit.

    Args:
        text: such as "0..100 V, 50 V/ms, 2 A", all but the range optional and in any order.
        default: the drive's unit where the text has none, or its own otherwise.
        capacitance: of the actuator, such as "3 uF", through which a current limits the rate.

    Returns:
        The limits, with an infinite rate where none is given, in the drive's unit.

    Raises:
        InputError: if the text is not of this form, or the limits exclude every drive.
    """
    first, *others = text.split(",")
    match = _RANGE.fullmatch(first)
    example = default or "V"
    if match is None or not (match[3] or default):
        raise InputError.at(
            _WHERE, f'a range and a slew such as "0..100 {example}, 50 {example}/ms"', f'"{text}"',
            "write the limits in this form",
        )  # fmt: skip
    named = default or match[3]
    ends = [
        parse_quantity(f"{end} {match[3] or named}", named, _WHERE) for end in match.groups()[:2]
    ]
    low, high = ends
    slew = inf
    for part in others:
        slew = min(slew, _rate_of(part.strip(), named, capacitance))
    if not low < high:
        remedy = (
            f'write "{match[2]}..{match[1]} {match[3]}"' if low > high else "give a wider range"
        )
        raise InputError.at(_WHERE, "a lower end below the upper", f'"{first.strip()}"', remedy)
    return Limits(low, high, slew), named


def _rate_of(part: str, named: str, capacitance: str | None) -> float:
    """The fastest change [drive unit/s] by a slew rate or a current.

    Raises:
        InputError: if it is neither, not above zero, or a current without a capacitance.
    """
    own = re.sub(r"^[-+.\deE]*\s*", "", part)
    if own and conversion(own, "A") is not None:
        current = parse_quantity(part, "A", _WHERE)
        if capacitance is None:
            raise InputError.at(
                _WHERE, "the capacitance with a current", f'"{part}" alone',
                'add --capacitance, such as "3 uF"',
            )  # fmt: skip
        farads = parse_quantity(capacitance, "F", "--capacitance")
        if not farads > 0:
            raise InputError.at(
                "--capacitance", "a value above zero", f'"{capacitance}"', "correct it"
            )
        volts = conversion("V", named)
        if volts is None:
            raise InputError.at(
                _WHERE, "a current for a drive in volts only", f'"{part}" and a drive in {named}',
                f"give the slew in {named}/s instead",
            )  # fmt: skip
        rate = volts * current / farads
    else:
        rate = parse_quantity(part, f"{named}/s", _WHERE)
    if not rate > 0:
        raise InputError.at(_WHERE, "a slew or a current above zero", f'"{part}"', "correct it")
    return rate
