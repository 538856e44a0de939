"""The recording, validated once at the border."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fracjax._recording._errors import InputError
from fracjax._recording._periods import Repeats, repeats_in, stretches_at_rest, unit_range
from fracjax._recording._rows import in_rows
from fracjax._recording._signals import (
    LARGEST,
    bridged,
    resolution,
    signal_of,
    spikes,
    varying,
    without_missing,
)
from fracjax._recording._units import UNSTATED, parse_quantity, unit
from fracjax._recording._warnings import warnings_about
from fracjax._show import Shown, Table, View, figure, quantity

if TYPE_CHECKING:
    import pandas as pd

    from fracjax._show.drawing import Drawing


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Shown):
    """Uniform samples of a drive u and the response y it caused.

    A constant drive is a rest: it shows noise and drift next to recordings that move.

    Attributes:
        drive: Samples (N,) in `drive_unit`.
        response: Samples (N,) in `response_unit`.
        dt: The step [s].
        drive_unit: Unit of the drive; one that nobody stated becomes "drive units".
        response_unit: Unit of the response, likewise "response units".
        source: The name in messages.
        warnings: What the reader had to assume.
        masked: True (N,) where a sample need be no number, which no fit counts: the response is a
            straight line there; None where all count.
        began: When the first sample was taken [s since 1970, or since the zero of its column of
            times]; None where its file does not say.

    Raises:
        InputError: Unless drive and response are finite, one-dimensional, of equal length, at least
            32 samples long and the response not constant, `dt` is positive and the units are known.
    """

    drive: np.ndarray
    response: np.ndarray
    dt: float
    drive_unit: str = ""
    response_unit: str = ""
    source: str = "recording"
    warnings: tuple[str, ...] = ()
    masked: np.ndarray | None = None
    began: float | None = None

    def __post_init__(self):
        for name, unstated in UNSTATED.items():
            stated = getattr(self, f"{name}_unit") or unstated
            unit(stated, f"{self.source}, {name}")
            object.__setattr__(self, f"{name}_unit", stated)
        step = parse_quantity(self.dt, "s", f"{self.source}, dt")
        if not 1 / LARGEST < step < LARGEST:
            raise InputError.at(
                f"{self.source}, dt", "a positive step in seconds", f"{step:g}", "correct it"
            )
        drive, response = self.drive, self.response
        if self.masked is not None:
            masked = np.array(self.masked, dtype=bool)
            masked.setflags(write=False)
            object.__setattr__(self, "masked", masked)
            drive = without_missing(drive, masked)
            # A spike that is left out would still be the response's range, its cycle, its start.
            response = bridged(without_missing(response, masked), masked)
        drive = signal_of(drive, f"{self.source}, drive")
        response = varying(response, f"{self.source}, response")
        if len(drive) != len(response):
            raise InputError.at(
                self.source,
                "as many response as drive samples",
                f"{len(drive)} of the drive and {len(response)} of the response",
                "cut both to the same span",
            )
        for name, value in (("dt", step), ("drive", drive), ("response", response)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "warnings", tuple(self.warnings))

    def __len__(self) -> int:
        return len(self.drive)

    @property
    def times(self) -> np.ndarray:
        """Sample times from 0, shape (N,) [s]."""
        return self.dt * np.arange(len(self))

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return 1 / self.dt

    def window(self, start: int, stop: int) -> "Recording":
        """Samples `[start, stop)` as a recording of its own, its time again from 0.

        Raises InputError outside the recording, or where the window is no valid recording.
        """
        if not 0 <= start < stop <= len(self):
            raise InputError.at(
                self.source,
                f"a window within samples 0 to {len(self)}",
                f"{start} to {stop}",
                "choose it inside",
            )
        masked = None if self.masked is None else self.masked[start:stop]
        signals = {"drive": self.drive[start:stop], "response": self.response[start:stop]}
        began = None if self.began is None else self.began + start * self.dt
        return replace(self, **signals, masked=masked, began=began)

    def drive_period(self) -> Repeats | None:
        """The smallest whole-sample period that the drive keeps for at least three repeats.

        The longest stretch wins; it must fill a tenth of the recording. `None` where no stretch
        repeats to 0.2 % of its own deviation: sweeps, decays, holds, periods between samples.
        """
        return self._repeats

    @cached_property
    def _repeats(self) -> Repeats | None:
        return repeats_in(unit_range(self.drive))

    @cached_property
    def spikes(self) -> np.ndarray:
        """Whether samples (N,) of the response stand alone, far from those before and behind."""
        return spikes(self.response)

    @cached_property
    def resolution(self) -> float:
        """The step [response unit] of the grid of the response's values, 0 where there is none."""
        return float(resolution(self.response))

    def static_stretches(self, minimum_seconds: float = 0.0) -> list[tuple[int, int]]:
        """Stretches `[start, stop)` [samples] of constant drive, where the noise can be read.

        Constant is: no wider than white noise of the same successive differences
        (J. von Neumann, Ann. Math. Stat. 12, 1941). A stretch lasts at least `minimum_seconds`
        [s], 64 samples (which give a noise level to 9 %) and a hundredth of the recording.
        """
        minimum = max(64, len(self) // 100, math.ceil(minimum_seconds * self.rate))
        if minimum not in self._rests:
            self._rests[minimum] = stretches_at_rest(unit_range(self.drive), minimum)
        return list(self._rests[minimum])

    @cached_property
    def _rests(self) -> dict[int, list[tuple[int, int]]]:
        """The stretches of `static_stretches` by their least number of samples."""
        return {}

    def _view(self) -> View:
        def span(signal: np.ndarray, unit_: str) -> str:
            counted = signal if self.masked is None else signal[~self.masked]
            return f"{figure(counted.min(), 4)} to {quantity(counted.max(), unit_)}"

        period = self.drive_period()
        rows = [
            ["drive", span(self.drive, self.drive_unit)],
            ["response", span(self.response, self.response_unit)],
            ["period", "none" if period is None else f"{period.period * self.dt:.4g} s"],
        ]
        if self.masked is not None:
            rows.append(["masked", f"{np.count_nonzero(self.masked)} samples"])
        clock = f"{self.rate:.6g} Hz, {len(self) * self.dt:.6g} s"
        notes = [f"Warning: {warning}" for warning in (*self.warnings, *self.checks())]
        sentence = f"Recording of {Path(self.source).name}: {len(self)} samples at {clock}."
        return View(sentence, [Table([], rows)], notes)

    def plot(self) -> "Drawing":
        """Draw drive and response over time, and the loop.

        Returns:
            A matplotlib figure, in the recording's units.
        """
        from fracjax._recording._picture import draw_recording

        units = self.drive_unit, self.response_unit
        return draw_recording(self.times, (self.drive, self.response), units, self.masked)

    def to_dataframe(self) -> "pd.DataFrame":
        """The samples as a table.

        Returns:
            A pandas table: time [s], drive and response in the units that their names end in.
        """
        import pandas as pd

        columns = {"time_s": self.times}
        for name, unstated in UNSTATED.items():
            unit_ = getattr(self, f"{name}_unit")
            columns[name if unit_ == unstated else f"{name}_{unit_}"] = getattr(self, name)
        return pd.DataFrame(columns)

    def checks(self) -> tuple[str, ...]:
        """Plain warnings about the data that a fit would not reveal."""
        return warnings_about(self)


def inspect_together(recordings: Sequence[Recording]) -> None:
    """Find the spikes and resolutions of recordings, for which those of one length take less time
    together."""
    for name, function in (("spikes", spikes), ("resolution", resolution)):
        unknown = [recording for recording in recordings if name not in vars(recording)]
        values = in_rows(function, [recording.response for recording in unknown])
        for recording, value in zip(unknown, values, strict=True):
            vars(recording)[name] = value


def require_units_of(first: Recording, other: Recording) -> None:
    """Raise `InputError` unless two recordings are written in the same units."""
    require_units((first.drive_unit, first.response_unit), first.source, other)


def require_units(units: tuple[str, str], source: str, other: Recording) -> None:
    """Raise `InputError` unless a recording is written in the units, those of `source`."""
    actual = other.drive_unit, other.response_unit
    if actual != units:
        stated = [
            f"--unit {signal}={theirs if theirs != unstated else own}"
            for (signal, unstated), theirs, own in zip(UNSTATED.items(), units, actual, strict=True)
            if {theirs, own} != {unstated}
        ]
        raise InputError.at(
            other.source,
            f"the units of {source} ({', '.join(units)})",
            f"({', '.join(actual)})",
            f"give {' '.join(stated)}, with which all are read",
        )
