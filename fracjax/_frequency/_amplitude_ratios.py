"""Amplitude ratios of response to drive, tone by tone, from a recording of several tones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal.windows import blackmanharris

from .._recording import InputError, Recording, varying
from .._show import Shown

_LEAST_PERIODS = 3
"""Fewest periods of each of several successive tones, and lowest bin of a spectral line."""
_HARMONICS = 5
"""Highest harmonic fitted together with a single tone; chosen by judgement."""
_SETTLING = 0.2
"""Share of a single tone's time that is left out as its transient; chosen by judgement."""
_SLOW = 5
"""Columns for offset and slow drift: a parabola, and two logarithms of time as in a relaxation."""
_MOST_TONES = 64
"""Most tones that are fitted together: more lines than this are noise; chosen by judgement."""
_WEAKEST = 0.01
"""Weakest line that counts as a tone, relative to the strongest; chosen by judgement."""
_LOBE = 4
"""Half the width of a Blackman–Harris line, in bins: lines closer than this are one tone."""
_SAME_PERIOD = 0.005
"""Relative difference up to which successive periods belong to one tone; chosen by judgement."""
_SAME_TONE = 0.02
"""Relative difference up to which a requested frequency is that of a tone; chosen by judgement."""
_EXPLAINED = 0.95
"""Share of the drive's power that its tones must explain; a triangle's fundamental has 98.5 %."""


@dataclass(frozen=True, repr=False)
class AmplitudeRatios(Shown):
    """Ratios A_r of response to drive amplitude, one for each tone of the drive [F 15].

    Attributes:
        frequencies_Hz: Frequencies of the tones (F,) [Hz].
        ratios: Amplitude of the response over that of the drive (F,), in `unit`.
        standard_errors: Their standard errors (F,), in `unit`, by least squares in white noise.
        unit: Unit of the ratios, such as "um/V".
        source: Name of the recording.
    """

    frequencies_Hz: np.ndarray
    ratios: np.ndarray
    standard_errors: np.ndarray
    unit: str
    source: str

    def to_dict(self) -> dict:
        """The result as plain data.

        Returns:
            A dictionary that JSON can store.
        """
        return {
            "schema": "fracjax.amplitude_ratios/1",
            "source": self.source,
            "unit": self.unit,
            "frequencies_Hz": self.frequencies_Hz.tolist(),
            "ratios": self.ratios.tolist(),
            "standard_errors": self.standard_errors.tolist(),
        }


class _Stretch(NamedTuple):
    """Samples [start, stop) over which the drive consists of these tones (K,) [Hz] only."""

    frequencies: np.ndarray
    start: int
    stop: int


def amplitude_ratios(recording: Recording, frequencies: ArrayLike | None = None) -> AmplitudeRatios:
    """Amplitude ratios from a drive of several tones, together (multi-sine) or one after another.

    In every stretch of steady tones, drive and response are each fitted by least squares:

        offset + slow drift + Σ_k a_k cos(2πf_k t) + b_k sin(2πf_k t),
        A_r = |a - jb| of the response / |a - jb| of the drive

    The slow drift is a parabola and two logarithms of time, as of creep.  For a single tone, its
    harmonics up to the fifth, which hysteresis adds, are fitted too.  A single tone settles for a
    fifth of its time or one period, whichever is longer; simultaneous tones settle for one common
    period if the recording holds three.

    The tones are detected in the drive: successive tones by their crossings of the mid-level (at
    least 3 periods each), simultaneous tones by their lines in the spectrum (at least 1 % of the
    strongest).

    Args:
        recording: Drive and response (N,), in their units.
        frequencies: Frequencies (F,) [Hz] of the tones to return; the drive refines them.  All
            tones by default.

    Returns:
        One ratio [response/drive] and its standard error per tone, by rising frequency or in the
        order of `frequencies`.

    Raises:
        InputError: The drive does not consist of such tones, or a requested frequency is none of
            them.
    """
    varying(recording.drive, f"{recording.source}, drive")
    requested = None if frequencies is None else np.atleast_1d(np.asarray(frequencies, dtype=float))
    if requested is not None and not np.all((requested > 0) & (requested < 0.5 * recording.rate)):
        raise InputError.at(
            "frequencies",
            f"numbers between 0 and {0.5 * recording.rate:g} Hz",
            "other values",
            "correct them",
        )
    stretches = _successive_tones(recording) or [_simultaneous_tones(recording, requested)]
    rows = np.array(sorted(row for stretch in stretches for row in _ratios(recording, stretch)))
    if requested is not None:
        rows = rows[[_nearest(rows[:, 0], frequency, recording.source) for frequency in requested]]
    return AmplitudeRatios(
        *rows.T, unit=f"{recording.response_unit}/{recording.drive_unit}", source=recording.source
    )


def _nearest(tones: np.ndarray, frequency: float, source: str) -> int:
    """Index of the tone (F,) [Hz] closest to a requested frequency [Hz]."""
    best = int(np.argmin(np.abs(tones - frequency)))
    if abs(tones[best] / frequency - 1) > _SAME_TONE:
        raise InputError.at(
            f"{source}, drive",
            f"a tone of {frequency:g} Hz",
            f"tones of {', '.join(f'{tone:.4g}' for tone in tones)} Hz",
            "request those",
        )
    return best


# Successive tones ---------------------------------------------------------------------------------


def _rises(drive: np.ndarray) -> np.ndarray:
    """Times [samples] at which the drive rises through a level a little above its mid-level.

    A rise counts only after the drive was equally far below the mid-level, so that noise causes
    none.  The margin, a twentieth of the drive's span, was chosen by judgement.
    """
    middle, margin = 0.5 * (drive.max() + drive.min()), 0.05 * np.ptp(drive)
    side = np.where(drive > middle + margin, 1, np.where(drive < middle - margin, -1, 0))
    latest = np.maximum.accumulate(np.where(side != 0, np.arange(drive.size), 0))
    side = side[latest]
    at = np.flatnonzero((side[1:] > 0) & (side[:-1] < 0))
    return at + (middle + margin - drive[at]) / (drive[at + 1] - drive[at])


def _successive_tones(recording: Recording) -> list[_Stretch]:
    """Stretches of one tone each: runs of equal intervals between rises of the drive.

    The list is empty if they cover less than half of the recording, or if the tones do not
    explain the drive in one of them.
    """
    rises = _rises(recording.drive)
    intervals = np.diff(rises)
    stretches, first = [], 0
    for last in range(1, intervals.size + 1):
        period = np.mean(intervals[first:last])
        tolerance = max(_SAME_PERIOD * period, 0.1)  # [samples]; 0.1 by judgement
        if last < intervals.size and abs(intervals[last] - period) <= tolerance:
            continue
        if last - first >= _LEAST_PERIODS:
            start, stop = int(np.ceil(rises[first])), int(rises[last]) + 1
            tone = _Stretch(np.array([recording.rate / period]), start, stop)
            stretches.append(_refine(recording, tone))
        first = last
    covered = sum(stretch.stop - stretch.start for stretch in stretches)
    if covered < 0.5 * len(recording) or any(
        _explained_share(recording, stretch) < _EXPLAINED for stretch in stretches
    ):
        return []
    return stretches


# Simultaneous tones -------------------------------------------------------------------------------


def _simultaneous_tones(recording: Recording, requested: np.ndarray | None) -> _Stretch:
    """All tones over the recording, without its first period if the drive repeats.

    They are the requested ones [Hz] if these explain the drive, otherwise the lines of its
    spectrum.
    """
    repeats = recording.drive_period()
    start = 0 if repeats is None else repeats.start + repeats.period
    stop = len(recording) if repeats is None else repeats.stop
    lines = _spectral_lines(recording)
    description = f"{lines.size} lines in its spectrum"
    for tones in (lines,) if requested is None else (requested, lines):
        if tones.size <= _MOST_TONES:
            stretch = _refine(recording, _Stretch(tones, start, stop))
            explained = _explained_share(recording, stretch)
            if explained >= _EXPLAINED:
                return stretch
            description = f"{tones.size} that explain {100 * explained:.0f} % of its power"
    raise InputError.at(
        f"{recording.source}, drive",
        "steady tones, together or one after another",
        description,
        "record a multi-sine, or at least three periods of each tone",
    )


def _spectral_lines(recording: Recording) -> np.ndarray:
    """Frequencies (K,) [Hz] of the lines in the drive's spectrum."""
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


def _design_matrix(recording: Recording, stretch: _Stretch, frequencies: np.ndarray) -> np.ndarray:
    """Design matrix (N, S + 2K): offset and slow drift, then cosine and sine of each frequency."""
    times = recording.times[stretch.start : stretch.stop]
    x = np.linspace(0, 1, times.size)
    angles = 2 * np.pi * times[:, None] * frequencies
    waves = np.stack([np.cos(angles), np.sin(angles)], axis=2).reshape(times.size, -1)
    # Logarithms with knees at 2 % and 20 % of the stretch, by judgement.
    slow = [np.ones_like(x), x, x**2, np.log(x + 0.02), np.log(x + 0.2)]
    return np.concatenate([np.stack(slow, axis=1), waves], axis=1)


def _solve(columns: np.ndarray, signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least-squares solution (C,) and (columnsᵀ columns)⁻¹ (C, C) by the normal equations.

    These are accurate enough: the columns (N, C) are few and nearly orthogonal.
    """
    lengths = np.linalg.norm(columns, axis=0)
    scaled = columns / lengths
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12) / np.outer(lengths, lengths)
    return inverse @ (columns.T @ signal), inverse


def _refine(recording: Recording, stretch: _Stretch) -> _Stretch:
    """The stretch with its tones' frequencies refined by Gauss–Newton on the drive.

    The derivative of a cos ωt + b sin ωt with respect to ω is t (b cos ωt - a sin ωt).
    """
    drive = recording.drive[stretch.start : stretch.stop]
    times = recording.times[stretch.start : stretch.stop]
    times = times - times.mean()
    frequencies = np.array(stretch.frequencies, dtype=float)
    for _ in range(3):  # Gauss–Newton steps; chosen by judgement
        design = _design_matrix(recording, stretch, frequencies)
        solution = _solve(design, drive)[0]
        a, b = solution[_SLOW::2], solution[_SLOW + 1 :: 2]
        cosines, sines = design[:, _SLOW::2], design[:, _SLOW + 1 :: 2]
        slopes = 2 * np.pi * times[:, None] * (b * cosines - a * sines)
        extended = np.concatenate([design, slopes], axis=1)
        step = _solve(extended, drive)[0][design.shape[1] :]
        # A step is at most as long as a line is wide.
        width = 1 / (times[-1] - times[0])
        frequencies = frequencies + np.clip(step, -width, width)
    return stretch._replace(frequencies=frequencies)


def _explained_share(recording: Recording, stretch: _Stretch) -> float:
    """Share of the drive's power about its slow drift that the tones explain."""
    drive = recording.drive[stretch.start : stretch.stop]
    design = _design_matrix(recording, stretch, stretch.frequencies)

    def residual_power(columns: np.ndarray) -> float:
        solution = _solve(columns, drive)[0]
        return float(np.sum((drive - columns @ solution) ** 2))

    return 1 - residual_power(design) / residual_power(design[:, :_SLOW])


def _ratios(recording: Recording, stretch: _Stretch) -> list[tuple[float, float, float]]:
    """Frequency [Hz], ratio and its standard error [response/drive] of each tone of the stretch."""
    frequencies = tones = stretch.frequencies
    if tones.size == 1:
        # The transient after the change of tone is left out.
        length = stretch.stop - stretch.start
        settling = int(np.ceil(max(recording.rate / tones[0], _SETTLING * length)))
        stretch = stretch._replace(start=stretch.start + settling)
        overtones = tones[0] * np.arange(2, _HARMONICS + 1)
        # Well below the Nyquist frequency, 0.5 of the rate.
        frequencies = np.concatenate([tones, overtones[overtones < 0.4 * recording.rate]])
    design = _design_matrix(recording, stretch, frequencies)

    def amplitudes(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Amplitudes (K,) of a signal (N,) and their relative standard errors (K,)."""
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
