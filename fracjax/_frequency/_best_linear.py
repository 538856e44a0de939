r"""The best linear approximation of an actuator about the levels of its tones, with what hides it.

Where a drive repeats a multisine with empty lines between its own, the response there says what
is at the excited ones beside the linear part:

    G_k = Y_k / U_k,                    U_k, Y_k means over the periods, k excited,
    σ_n² = Σ_p |Y_kp - Y_k|² / (P - 1) / P,
    σ_odd² = <|Y_k - G U_k|²> - σ_n²    over empty odd lines,   σ_even² over even ones.

A static cube of the drive has lines at odd sums of three excited ones, a square at even sums of
two: with odd lines excited alone, even distortions do not reach G, and odd ones scatter it.

Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), chapter 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._recording import Recording, maxima_of, runs_of
from .._show import Shown, Table, View, figure, quantity
from ._table import FrequencyTable

_PERIODS = 3
"""Fewest periods of a stretch: one until transients have faded, and two whose difference is
noise."""
_SHORTEST = 16
"""Fewest samples of a period; chosen by judgement."""
_ALIKE = 3e-3
"""The largest change from one period to the next, over the drive's range, as of `drive_period`."""
_VARYING = 3.0
"""The least range of a wave, over that change: a rest repeats too."""
_TRIED = 32
"""Periods that are tried, the likeliest first."""
_CLIPPED = 0.99
"""The share of the drive's bends beyond which they count as jumps and not as tones."""
_EMPTY = 0.2
"""The quantile of the odd lines that is of an empty one: of the tones of `protocol` one in four
is."""
_EXCITED, _ROUNDING = 10.0, 1e-6
"""An excited line over such an empty one, and over the largest."""
_MARGIN = 4
"""Samples at a stretch's ends that are left out: a drive that leaves it slowly is still alike, and
one with rounded corners comes late."""
_NEAR = 12
"""Lines to both sides over which noise and distortions are averaged; chosen by judgement."""


@dataclass(frozen=True, eq=False, repr=False)
class LinearApproximation(Shown):
    """The best linear approximation of an actuator about one level of its drive.

    Attributes:
        frequencies_Hz: of the excited lines (F,) [Hz].
        response: complex ratio of response to drive (F,) [response_unit/drive_unit].
        noise: what noise adds to it, rms (F,) [response_unit/drive_unit].
        odd: what odd distortions add to it, rms (F,) [response_unit/drive_unit].
        even: what even distortions would add to it at such lines, rms (F,)
            [response_unit/drive_unit].
        amplitudes: of the drive's lines (F,) [drive_unit].
        level: the mean drive about which it is [drive_unit].
        size: the drive's range about it [drive_unit].
        drive_unit: Unit of the drive.
        response_unit: Unit of the response.
        source: Name of the recording.
    """

    frequencies_Hz: np.ndarray
    response: np.ndarray
    noise: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    amplitudes: np.ndarray
    level: float
    size: float
    drive_unit: str
    response_unit: str
    source: str

    @property
    def unit(self) -> str:
        """Of the ratio of response to drive."""
        return f"{self.response_unit}/{self.drive_unit}"

    @cached_property
    def table(self) -> FrequencyTable:
        """The same for `fit_frequency_response`: the errors are of noise and odd distortions."""
        # Real and imaginary part have half of a complex number's variance each.
        errors = np.hypot(self.noise, self.odd) / np.abs(self.response) / np.sqrt(2)
        return FrequencyTable(
            self.frequencies_Hz, self.response, errors, errors,
            self.drive_unit, self.response_unit, f"{self.source} at {self._about}",
        )  # fmt: skip

    @property
    def _about(self) -> str:
        return quantity(self.level, self.drive_unit)

    @property
    def sentence(self) -> str:
        """What distorts the response about this level, in one sentence."""
        whole, noise, odd, even = (
            float(np.linalg.norm(part * self.amplitudes))
            for part in (np.abs(self.response), self.noise, self.odd, self.even)
        )
        return (
            f"About {self._about}, with {quantity(self.size, self.drive_unit)} peak to peak: noise "
            f"{figure(100 * noise / whole)} %, odd distortions {figure(100 * odd / whole)} %, even "
            f"ones {figure(100 * even / whole)} % of the linear response."
        )

    def to_dict(self) -> dict:
        """The result as plain data.

        Returns:
            A dictionary that JSON can store.
        """
        return {
            "schema": "fracjax.linear_approximation/1",
            "source": self.source,
            "unit": self.unit,
            "level": self.level,
            "size": self.size,
            "frequencies_Hz": self.frequencies_Hz.tolist(),
            "amplitude": np.abs(self.response).tolist(),
            "phase_deg": np.degrees(np.unwrap(np.angle(self.response))).tolist(),
            "noise": self.noise.tolist(),
            "odd": self.odd.tolist(),
            "even": self.even.tolist(),
            "drive_amplitudes": self.amplitudes.tolist(),
        }

    def _view(self) -> View:
        headers = ["frequency [Hz]", f"amplitude [{self.unit}]", "phase [degrees]",
                   "noise", "odd", "even"]  # fmt: skip
        columns = (
            self.frequencies_Hz, np.abs(self.response), np.degrees(np.angle(self.response)),
            self.noise, self.odd, self.even,
        )  # fmt: skip
        rows = [[figure(float(value)) for value in row] for row in zip(*columns, strict=True)]
        return View(self.sentence, [Table(headers, rows, detail=True)])


def best_linear_approximations(recording: Recording) -> tuple[LinearApproximation, ...]:
    """The best linear approximation about each level at which a recording's drive repeats tones.

        G_k = Y_k / U_k,    with the noise and the odd and even distortions of G_k apart

    The tones are those of `protocol`: odd lines of which some stay empty.  They are recognised by
    the drive, which repeats itself three times or more there.

    Args:
        recording: Drive and response (N,), in their units.

    Returns:
        One approximation per stretch of tones, in order; () where the drive has none.

    Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012),
    chapter 4.
    """
    drive, range_ = recording.drive, float(np.ptp(recording.drive))
    best: list[tuple[int, np.ndarray]] = []
    for period in _periods(drive):
        alike = np.abs(drive[period:] - drive[:-period]) <= _ALIKE * range_
        runs = runs_of(alike)
        runs = runs[runs[:, 1] - runs[:, 0] >= (_PERIODS - 1) * period - _MARGIN]
        waves = [drive[stop - period : stop] for _, stop in runs]
        tones = [k for k, w in enumerate(waves) if np.ptp(w) > _VARYING * _ALIKE * range_]
        # Twice a period is one too: the shortest counts.
        if len(tones) and (not best or period < best[0][0]):
            best = [(period, runs[k]) for k in tones]
    parts = [_approximated(recording, period, int(stop)) for period, (_, stop) in best]
    return tuple(part for part in parts if part is not None)


def _periods(drive: np.ndarray) -> list[int]:
    """Likely periods [samples] of tones in a drive (N,): where its bends resemble themselves, with
    jumps clipped, since moves and steps have large ones and tones many."""
    bends = np.diff(drive, n=2)
    most = float(np.quantile(np.abs(bends), _CLIPPED))
    bends = np.clip(bends, -most, most)
    spectrum = np.fft.rfft(bends, 2 * bends.size)
    alike = np.fft.irfft(np.abs(spectrum) ** 2)[: bends.size // (_PERIODS - 1)]
    alike[:_SHORTEST] = 0.0
    peaks = maxima_of(alike)
    peaks = peaks[alike[peaks] >= 0]
    return [int(k) for k in peaks[np.argsort(-alike[peaks])][:_TRIED]]


def _approximated(recording: Recording, period: int, stop: int) -> LinearApproximation | None:
    """The approximation from the whole periods up to the sample `stop` but the first of them; None
    where the lines of its drive do not tell distortions apart."""
    drive = recording.drive[: stop + period - _MARGIN]
    alike = np.abs(drive[period:] - drive[:-period]) <= _ALIKE * np.ptp(recording.drive)
    start = int(runs_of(alike)[-1, 0])
    count = (drive.size - start + 2 * _MARGIN) // period - 1
    measured = slice(drive.size - count * period, drive.size)
    wave, lines = (
        np.fft.rfft(_without_drift(signal[measured], period).reshape(count, period), axis=1)
        * (2 / period)
        for signal in (recording.drive, recording.response)
    )
    driven, answered = wave.mean(axis=0), lines.mean(axis=0)
    excited, odd, even = _kinds(np.abs(driven))
    if not (excited.size and odd.size and even.size):
        return None
    ratio = answered[excited] / driven[excited]
    variance = np.sum(np.abs(lines - answered) ** 2, axis=0) / (count - 1) / count
    noise = _mean_near(excited, np.arange(1, excited[-1] + 1), variance)

    def distortion(empty: np.ndarray) -> np.ndarray:
        """The rms at the excited lines of what empty ones have beyond noise (F,)."""
        linear = np.interp(empty, excited, ratio) * driven[empty]
        power = np.zeros(driven.size)
        power[empty] = np.abs(answered[empty] - linear) ** 2 - variance[empty]
        return np.sqrt(np.maximum(_mean_near(excited, empty, power), 0.0))

    sizes = np.abs(driven[excited])
    return LinearApproximation(
        frequencies_Hz=excited / (period * recording.dt),
        response=ratio,
        noise=np.sqrt(noise) / sizes,
        odd=distortion(odd) / sizes,
        even=distortion(even) / sizes,
        amplitudes=sizes,
        level=float(recording.drive[measured].mean()),
        size=float(np.ptp(recording.drive[measured])),
        drive_unit=recording.drive_unit,
        response_unit=recording.response_unit,
        source=recording.source,
    )


def _without_drift(signal: np.ndarray, period: int) -> np.ndarray:
    """A signal (N,) of whole periods minus its mean change from one to the next, spread evenly:
    what creeps has no lines."""
    change = float(np.mean(signal[period:] - signal[:-period])) / period
    return signal - change * (np.arange(signal.size) - 0.5 * signal.size)


def _kinds(sizes: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The excited lines of a drive with these amplitudes, and the empty odd and even ones below the
    highest of them."""
    empty_size = float(np.quantile(sizes[1::2], _EMPTY))
    least = max(_EXCITED * empty_size, _ROUNDING * float(sizes[1:].max()))
    excited = np.flatnonzero(sizes > least)
    excited = excited[excited > 0]
    empty = np.setdiff1d(np.arange(1, excited.max(initial=0)), excited)
    return excited, empty[empty % 2 == 1], empty[empty % 2 == 0]


def _mean_near(lines: np.ndarray, among: np.ndarray, power: np.ndarray) -> np.ndarray:
    """The mean power (F,) of the lines `among` (K,), of all powers (L,), near each of `lines`."""
    sums = np.concatenate([[0.0], np.cumsum(power[among])])
    first = np.searchsorted(among, lines - _NEAR)
    last = np.searchsorted(among, lines + _NEAR, side="right")
    # Where none is near, the nearest counts.
    first = np.minimum(first, among.size - 1)
    last = np.maximum(last, first + 1)
    return (sums[last] - sums[first]) / (last - first)
