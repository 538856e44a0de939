"""A designed drive, what it is made of, and what it will show."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from .._io import column_name, write
from .._path import Visible
from .._show import Shown, Table, View, figure, quantity
from ._drive import Drive
from ._limits import Limits

SCHEMA = "fracjax/protocol/1"


@dataclass(frozen=True, eq=False, repr=False)
class Protocol(Shown):
    """A drive that can tell, designed within limits.

    Attributes:
        drive: its values (N,) [drive unit], step [s] and parts.
        limits: what the hardware allows.
        top: the highest frequency of its tones [Hz].
        noise: of the response, rms [response unit].
        stroke: of the actuator over the range [response unit].
        units: of drive and response.
        effects: that it was designed for.
        shows: the smallest size of each effect that will be named, peak to peak [response unit], or
            why none will be.
        before: the same of the recording that it completes; () where it stands alone.
        shorter: what shorter designs show, by their duration [s].
        after: the recordings that it completes, by their names.
        warnings: where the limits cost something, in sentences.
    """

    drive: Drive
    limits: Limits
    top: float
    noise: float
    stroke: float
    units: tuple[str, str]
    effects: tuple[str, ...]
    shows: tuple[Visible, ...]
    before: tuple[Visible, ...] = ()
    shorter: tuple[tuple[float, tuple[Visible, ...]], ...] = ()
    after: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Of the drive [s]."""
        return self.drive.step * self.drive.values.size

    @property
    def source(self) -> str:
        """What a report calls it."""
        return ", ".join(self.after)

    @cached_property
    def least(self) -> Visible:
        """Of the effects that it was designed for the one that it shows worst."""
        own = [one for one in self.shows if one.effect in self.effects]
        return max(own, key=lambda one: np.inf if one.size is None else one.size)

    @property
    def sentence(self) -> str:
        """What it is and shows, in a sentence or two."""
        unit, least = self.units[1], self.least
        what = "any effect that it was designed for"
        if len(self.effects) == 1:
            what = self.effects[0]
        if least.size is None:
            shown = f"it cannot show {least.effect}: {least.reason}"
        else:
            shown = (
                f"it will show {what} from {quantity(least.size, unit)} peak to peak, "
                f"whatever the hysteresis"
            )
            shown += "" if len(self.effects) == 1 else f" ({least.effect} is seen last)"
        both = f" together with {', '.join(self.after)}" if self.after else ""
        beside = [one for one in self.shows if one.effect not in self.effects]
        hidden = ", ".join(one.effect for one in beside if one.size is None)
        return (
            f"A drive of {figure(self.duration, 4)} s from {figure(self.limits.low, 4)} to "
            f"{quantity(self.limits.high, self.units[0])}: at a noise of "
            f"{quantity(self.noise, unit)} {shown}{both}."
            + (f" It does not show {hidden}." if hidden else "")
        )

    def table(self) -> tuple[list[str], list[list[str]]]:
        """The smallest size of each effect that will be named: headers, and rows."""
        columns = [
            *([("before", self.before)] if self.before else []),
            *((f"in {figure(seconds, 4)} s", shown) for seconds, shown in self.shorter),
        ]
        last = "with this drive" if self.before else f"in {figure(self.duration, 4)} s"
        columns.append((last, self.shows))
        headers = ["effect", *(name for name, _ in columns)]
        sizes = [{one.effect: one for one in shown} for _, shown in columns]
        return headers, [
            [one.effect, *(_cell(own.get(one.effect)) for own in sizes)] for one in self.shows
        ]

    def timetable(self) -> tuple[list[str], list[list[str]]]:
        """The parts: headers, and rows."""
        return ["part", "from [s]", "to [s]", "what it is for"], [
            [part.name, f"{part.start:.5g}", f"{part.stop:.5g}", part.purpose]
            for part in self.drive.parts
        ]

    def write(self, path: str | Path) -> None:
        """Write time [s] and drive.

        Args:
            path: The file; its suffix sets the format, as in `fracjax.write`, or WAV, whose full
                scale is the larger end of the range.

        Raises:
            InputError: When the suffix is unknown or the file cannot be written.
        """
        if Path(path).suffix.lower() == ".wav":
            _write_wav(Path(path), self)
            return
        name = column_name("drive", self.units[0])
        write(path, {"time_s": self.drive.times, name: self.drive.values})

    def plot(self):
        """Draw the drive with its parts, and what it will show.

        Returns:
            A matplotlib figure.
        """
        from ._picture import draw_protocol

        before = {"before": self.before} if self.before else {}
        shown = {**before, "with this drive": self.shows}
        return draw_protocol(self.drive, shown, self.stroke, self.units[0])

    def to_dict(self) -> dict[str, Any]:
        """The protocol as plain data, without the samples of its drive."""
        limits = self.limits
        return {
            "schema": SCHEMA,
            "sentence": self.sentence,
            "drive": {
                "unit": self.units[0],
                "step_s": self.drive.step,
                "samples": self.drive.values.size,
                "parts": [vars(part) for part in self.drive.parts],
            },
            "limits": {"low": limits.low, "high": limits.high, "slew_per_s": limits.slew,
                       "code": limits.code},
            "top_frequency_Hz": self.top,
            "noise": {"sigma": self.noise, "unit": self.units[1]},
            "stroke": self.stroke,
            "effects": list(self.effects),
            "can_show": [vars(one) for one in self.shows],
            "before": [vars(one) for one in self.before],
            "shorter": [
                {"duration_s": seconds, "can_show": [vars(one) for one in shown]}
                for seconds, shown in self.shorter
            ],
            "after": list(self.after),
            "warnings": list(self.warnings),
        }  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write the protocol as JSON.

        Args:
            path: The file, usually protocol.json.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")

    def _view(self) -> View:
        headers, rows = self.table()
        parts = Table(*self.timetable(), detail=True)
        return View(self.sentence, [Table(headers, rows), parts], self.warnings)


def _cell(shown: Visible | None) -> str:
    if shown is None:
        return "–"
    return "not at any size" if shown.size is None else quantity(shown.size, shown.unit)


def _write_wav(path: Path, protocol: Protocol) -> None:
    """The drive as 32-bit floats of a full scale of ±1."""
    from scipy.io import wavfile

    values, limits = protocol.drive.values, protocol.limits
    scale = max(abs(limits.low), abs(limits.high))
    wavfile.write(path, round(1 / protocol.drive.step), (values / scale).astype(np.float32))
