"""Amplitude ratios of response to drive, tone by tone, from a recording of several tones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal.windows import blackmanharris

from .._recording import InputError, Recording, varying

_LEAST_PERIODS = 3
_HARMONICS = 5
_SETTLING = 0.2
_SLOW = 5
"""Columns of offset and drift: a parabola, and logarithms of time as of a relaxation."""
_MOST_TONES = 64
_WEAKEST = 0.01
_LOBE = 4
"""Half the width of a Blackman–Harris line, in bins: closer tones are one."""
_SAME_PERIOD = 0.005
_SAME_TONE = 0.02
_EXPLAINED = 0.95
"""Share of the drive's power that its tones must explain; a triangle's fundamental has 98.5 %."""


@dataclass(frozen=True)
class AmplitudeRatios:
    """Ratio A_r of response to drive amplitude (F,) [unit] at frequencies (F,) [Hz] [F 15].

    `standard_errors` (F,) [unit] are those of least squares in white noise.
    """

    frequencies_Hz: np.ndarray
    ratios: np.ndarray
    standard_errors: np.ndarray
    unit: str
    source: str

    def to_dict(self) -> dict:
        """Plain data."""
        return {
            "schema": "fracjax.amplitude_ratios/1",
            "source": self.source,
            "unit": self.unit,
            "frequencies_Hz": self.frequencies_Hz.tolist(),
            "ratios": self.ratios.tolist(),
            "standard_errors": self.standard_errors.tolist(),
        }


class _Stretch(NamedTuple):
    """Samples [start, stop) over which the drive holds these tones [Hz] and no others."""

    frequencies: np.ndarray
    start: int
    stop: int


def amplitude_ratios(recording: Recording, frequencies: ArrayLike | None = None) -> AmplitudeRatios:
    r"""Amplitude ratios from a drive of several tones, together (multi-sine) or one after another.

    Per stretch of steady tones, drive and response are each fitted by least squares:

        offset + slow drift + Σ_k a_k cos(2πf_k t) + b_k sin(2πf_k t),
        A_r = |a - jb| of the response / |a - jb| of the drive

    and, of a tone alone, its harmonics to the fifth, which hysteresis adds.  Slow drift is a
    parabola and the logarithms of creep.  A tone alone is left to settle for a fifth of its time or
    one period, tones together for one common period where the recording holds three.

    Tones are found from the drive: those that follow each other by their crossings of the mid-level
    (each for 3 periods at least), those together by their lines in the spectrum (1 % of the
    strongest at least).  `frequencies` [Hz] says which of them to take; the drive refines them.
    Raises InputError where the drive does not consist of such tones.
    """
    varying(recording.drive, f"{recording.source}, drive")
    wanted = None if frequencies is None else np.atleast_1d(np.asarray(frequencies, dtype=float))
    if wanted is not None and not np.all((wanted > 0) & (wanted < 0.5 * recording.rate)):
        raise InputError.at(
            "frequencies",
            f"numbers between 0 and {0.5 * recording.rate:g} Hz",
            "others",
            "correct them",
        )
    stretches = _one_after_another(recording) or [_together(recording, wanted)]
    rows = np.array(sorted(row for stretch in stretches for row in _ratios(recording, stretch)))
    if wanted is not None:
        rows = rows[[_nearest(rows[:, 0], frequency, recording.source) for frequency in wanted]]
    return AmplitudeRatios(
        *rows.T, unit=f"{recording.response_unit}/{recording.drive_unit}", source=recording.source
    )


def _nearest(tones: np.ndarray, frequency: float, source: str) -> int:
    best = int(np.argmin(np.abs(tones - frequency)))
    if abs(tones[best] / frequency - 1) > _SAME_TONE:
        raise InputError.at(
            f"{source}, drive",
            f"a tone of {frequency:g} Hz",
            f"tones of {', '.join(f'{tone:.4g}' for tone in tones)} Hz",
            "ask for those",
        )
    return best


# Tones one after another --------------------------------------------------------------------------


def _rises(drive: np.ndarray) -> np.ndarray:
    """Places [samples] where the drive rises through a little above its mid-level.

    A rise counts once the drive has been as far below it, so that noise makes none.
    """
    middle, reach = 0.5 * (drive.max() + drive.min()), 0.05 * np.ptp(drive)
    side = np.where(drive > middle + reach, 1, np.where(drive < middle - reach, -1, 0))
    known = np.maximum.accumulate(np.where(side != 0, np.arange(drive.size), 0))
    side = side[known]
    at = np.flatnonzero((side[1:] > 0) & (side[:-1] < 0))
    return at + (middle + reach - drive[at]) / (drive[at + 1] - drive[at])


def _one_after_another(recording: Recording) -> list[_Stretch]:
    """Stretches of one tone each: runs of equal intervals between rises.

    None where they leave out half the recording, or where the drive is no sine.
    """
    rises = _rises(recording.drive)
    intervals = np.diff(rises)
    stretches, first = [], 0
    for last in range(1, intervals.size + 1):
        period = np.mean(intervals[first:last])
        slack = max(_SAME_PERIOD * period, 0.1)
        if last < intervals.size and abs(intervals[last] - period) <= slack:
            continue
        if last - first >= _LEAST_PERIODS:
            start, stop = int(np.ceil(rises[first])), int(rises[last]) + 1
            tone = _Stretch(np.array([recording.rate / period]), start, stop)
            stretches.append(_refined(recording, tone))
        first = last
    covered = sum(stretch.stop - stretch.start for stretch in stretches)
    if covered < 0.5 * len(recording) or any(
        _explained(recording, stretch) < _EXPLAINED for stretch in stretches
    ):
        return []
    return stretches


# Tones together -----------------------------------------------------------------------------------


def _together(recording: Recording, wanted: np.ndarray | None) -> _Stretch:
    """All tones, over the recording without its first period where it has one: those wanted, if
    they are all there are, or the lines of the spectrum."""
    repeats = recording.drive_period()
    start = 0 if repeats is None else repeats.start + repeats.period
    stop = len(recording) if repeats is None else repeats.stop
    lines = _lines(recording)
    found = f"{lines.size} lines in its spectrum"
    for tones in (lines,) if wanted is None else (wanted, lines):
        if tones.size <= _MOST_TONES:
            stretch = _refined(recording, _Stretch(tones, start, stop))
            explained = _explained(recording, stretch)
            if explained >= _EXPLAINED:
                return stretch
            found = f"{tones.size} that explain {100 * explained:.0f} % of its power"
    raise InputError.at(
        f"{recording.source}, drive",
        "steady tones, together or one after another",
        found,
        "record a multi-sine, or at least three periods of each tone",
    )


def _lines(recording: Recording) -> np.ndarray:
    """Frequencies [Hz] of the lines in the drive's spectrum."""
    samples = len(recording)
    window = blackmanharris(samples, sym=False)
    drive = recording.drive - np.average(recording.drive, weights=window)
    spectrum = np.abs(np.fft.rfft(drive * window))
    spectrum[:_LEAST_PERIODS] = 0.0
    padded = np.pad(spectrum, _LOBE)
    highest = np.max(np.lib.stride_tricks.sliding_window_view(padded, 2 * _LOBE + 1), axis=1)
    bins = np.flatnonzero((spectrum == highest) & (spectrum > _WEAKEST * spectrum.max()))
    return bins * recording.rate / samples


# Least squares ------------------------------------------------------------------------------------


def _columns(recording: Recording, stretch: _Stretch, frequencies: np.ndarray) -> np.ndarray:
    """Design (N, S + 2K): offset and slow drift, then cosine and sine of every frequency."""
    times = recording.times[stretch.start : stretch.stop]
    x = np.linspace(0, 1, times.size)
    angles = 2 * np.pi * times[:, None] * frequencies
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(times.size, -1)
    slow = [np.ones_like(x), x, x**2, np.log(x + 0.02), np.log(x + 0.2)]
    return np.concatenate([np.stack(slow, axis=1), waves], axis=1)


def _solve(columns: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least squares (C,) by the normal equations, and (columnsᵀ columns)⁻¹ (C, C): the columns are
    few and far from alike, the samples many."""
    lengths = np.linalg.norm(columns, axis=0)
    scaled = columns / lengths
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12) / np.outer(lengths, lengths)
    return inverse @ (columns.T @ signal), inverse


def _refined(recording: Recording, stretch: _Stretch) -> _Stretch:
    """The stretch with its tones' frequencies by Gauss–Newton on the drive.

    Of a cos ωt + b sin ωt the derivative in ω is t (b cos ωt - a sin ωt).
    """
    drive = recording.drive[stretch.start : stretch.stop]
    times = recording.times[stretch.start : stretch.stop]
    times = times - times.mean()
    frequencies = np.array(stretch.frequencies, dtype=float)
    for _ in range(3):
        design = _columns(recording, stretch, frequencies)
        solution = _solve(design, drive)[0]
        a, b = solution[_SLOW::2], solution[_SLOW + 1 :: 2]
        cosines, sines = design[:, _SLOW::2], design[:, _SLOW + 1 :: 2]
        slopes = 2 * np.pi * times[:, None] * (b * cosines - a * sines)
        both = np.concatenate([design, slopes], axis=1)
        move = _solve(both, drive)[0][design.shape[1] :]
        # No further than a line is wide.
        width = 1 / (times[-1] - times[0])
        frequencies = frequencies + np.clip(move, -width, width)
    return stretch._replace(frequencies=frequencies)


def _explained(recording: Recording, stretch: _Stretch) -> float:
    """Share of the drive's power about its drift that the tones explain."""
    drive = recording.drive[stretch.start : stretch.stop]
    design = _columns(recording, stretch, stretch.frequencies)

    def left(columns: np.ndarray) -> float:
        solution = _solve(columns, drive)[0]
        return float(np.sum((drive - columns @ solution) ** 2))

    return 1 - left(design) / left(design[:, :_SLOW])


def _ratios(recording: Recording, stretch: _Stretch) -> list[tuple[float, float, float]]:
    """Frequency [Hz], ratio and standard error of every tone of the stretch."""
    frequencies = tones = stretch.frequencies
    if tones.size == 1:
        # What the tone before has set ringing does not count.
        length = stretch.stop - stretch.start
        settling = int(np.ceil(max(recording.rate / tones[0], _SETTLING * length)))
        stretch = stretch._replace(start=stretch.start + settling)
        overtones = tones[0] * np.arange(2, _HARMONICS + 1)
        frequencies = np.concatenate([tones, overtones[overtones < 0.4 * recording.rate]])
    design = _columns(recording, stretch, frequencies)

    def amplitudes(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (K,) and their relative standard errors (K,)."""
        part = signal[stretch.start : stretch.stop]
        solution, inverse = _solve(design, part)
        residual = part - design @ solution
        variance = np.sum(residual**2) / (part.size - design.shape[1])
        size, error = [], []
        for k in range(tones.size):
            at = slice(_SLOW + 2 * k, _SLOW + 2 * k + 2)
            wave = solution[at]
            length = np.linalg.norm(wave)
            size.append(length)
            error.append(np.sqrt(variance * wave @ inverse[at, at] @ wave) / length**2)
        return np.array(size), np.array(error)

    drive, drive_error = amplitudes(recording.drive)
    response, response_error = amplitudes(recording.response)
    ratio = response / drive
    errors = ratio * np.hypot(response_error, drive_error)
    return list(zip(tones, ratio, errors, strict=True))
