"""Sources of a recording's noise: repeats, rests, a specification, or the residual of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._filters import averaged, moving_sum
from .._recording import (
    InputError,
    Recording,
    bridged,
    in_rows,
    inspect_together,
    kept,
    mismatch,
    unit_range,
)
from ._autoregression import autoregressions
from ._noise import NONE, Noise, level_from_differences, white_noise
from ._noise_stretches import (
    PIECES,
    Stretch,
    first_settled,
    level_without_motion,
    noise_in,
    noise_of,
    without_events,
)

_REST_SECONDS = 0.2
"""The shortest rest [s] from which noise is read.  Chosen by judgement."""
_BRIDGED = 0.02
"""The largest share of a period or a rest that straight lines may bridge.  Chosen by judgement."""
_SHARED = 2.0
"""Successive second differences have the correlations -2/3 and 1/6: 1 + 2 Σ ρ² ≈ 2."""
_BARELY_MORE = 1.25
"""Ratio of variances up to which a residual counts as little more than white noise.  Chosen by
judgement."""
_EXACT = 1e-8
"""Least noise level, as a share of the response's span: simulations are hardly more precise."""
_SHORT_PERIOD = 50
"""Shorter periods [samples] are too short to fit a relaxation.  Chosen by judgement."""
_SAME_DRIVE = 2e-3
"""Largest rms difference of a repeated drive, as a share of its standard deviation."""
_SAME_RATE = 1e-6
"""Largest relative difference of sampling rates that count as equal: rounding."""
_LOWER = 0.97
"""The noise reread from repeats of the residual replaces the first where its level or innovation is
below this share of it.  Chosen by judgement."""
MOST_SPENT = 0.9
"""The share of noise that a fit has taken up at most: of what less is left tells no level; chosen
by judgement."""
_LARGEST_RATIO = 2.0
"""Largest ratio of the variance of what does not repeat to that of the noise of rests, above which
it is more than noise.  Chosen by judgement."""


class Residual(NamedTuple):
    """The residual of a fit to a recording.

    Attributes:
        samples: (N,) measured minus simulated, in the response's unit.
        used: (N,) whether a sample counts.
        recording: the recording.
        spent: the share (N//2+1,) of white noise that the fit has taken up, by frequency; None
            where it has few coefficients.
    """

    samples: np.ndarray
    used: np.ndarray
    recording: Recording
    spent: np.ndarray | None = None

    @property
    def counted(self) -> np.ndarray:
        """Whether a sample (N,) counts and is no spike."""
        return self.used & ~self.recording.spikes

    @property
    def unspent(self) -> Residual:
        """As it would be had the fit taken up no noise: of a flexible curve that is the best guess
        of a signal in white noise of variance σ², the spectrum of what it leaves lacks that of its
        uncertainty, σ² times the share that it has taken up.

        Source: Dempster, Laird & Rubin, J. R. Stat. Soc. B 39 (1977) 1: their second step, for a
        noise's spectrum.
        """
        if self.spent is None:
            return self
        samples = np.where(self.counted, self.samples, 0.0)
        lines = np.fft.rfft(samples)
        power = np.abs(lines) ** 2
        # The most that is corrected: of what less is left tells no level.
        variance = power.mean() / (1 - min(float(self.spent.mean()), MOST_SPENT))
        near = np.maximum(averaged(power), _EXACT**2 * variance)
        larger = np.sqrt(1 + variance * self.spent / near)
        return self._replace(samples=np.fft.irfft(lines * larger, samples.size), spent=None)


def refine_noise(noise: Noise, residual: Residual) -> Noise:
    """A measured noise, improved by the residual of a fit.

    Repeats of a residual hold less of the slow decay from the start than repeats of the response.
    If the drive occurs twice, the residual shows the noise over the whole recording, whereas rests
    show it only for a few moments; it is used unless its variance is much larger than that of the
    rests.
    """
    samples, used, recording = residual.samples, residual.used, residual.recording
    if noise.method == "repeats":
        stretches = _from_repeats(recording, used.astype(float), samples)
        if not stretches:
            return noise
        reread = _noise_of_repeats(stretches, recording)
        # A decay that has not settled has few slow lines, which hardly change the innovation.
        clearer = min(reread.innovation / noise.innovation, reread.sigma / noise.sigma) < _LOWER
        return reread if clearer and reread.sigma <= noise.sigma else noise
    if noise.method == "static" and repetition_lag(recording.drive) is not None and used.all():
        (reread,) = residual_noises([residual])
        of_noise = reread.innovation**2 < _LARGEST_RATIO * noise.innovation**2
        if of_noise and reread.effective > noise.effective:
            return replace(reread, is_leftover=False)
    return with_level_profile(noise, samples, used) if noise.course[0].size else noise


def with_level_profile(noise: Noise, residual: np.ndarray, used: np.ndarray) -> Noise:
    """A noise of varying level, its level followed along a residual (N,) where samples are `used`.

    Rests show the level during the rests, and the ratio of its rms to its typical size (`crest`).
    Between rests the differences of a fit's residual show the profile over time, because a mismatch
    is smooth from sample to sample.  The noise is unchanged where in some piece most samples have
    the same code as their neighbours.
    """
    lost = noise.filter.size - 1
    whitened = moving_sum(noise.whitening, residual)[lost:]
    differences, counted = np.diff(whitened), used[lost + 1 :]
    where = lost + np.arange(differences.size)
    parts = np.array_split(np.flatnonzero(counted), PIECES)
    centres = np.array([where[part].mean() for part in parts])
    sizes = noise.crest * np.array([level_from_differences(differences[part]) for part in parts])
    if not sizes.all():
        return noise
    typical = np.sqrt(np.mean(sizes**2))
    # The noise cannot exceed the residual, whatever `crest` a short rest gives.
    average = float(min(typical, np.sqrt(np.mean(whitened[1:][counted] ** 2))))
    return replace(
        noise,
        sigma=average * noise.sigma,
        innovation=average * noise.innovation,
        course=(centres, sizes / typical),
    )


def _from_repeats(
    recording: Recording, counts: np.ndarray | None, signal: np.ndarray | None = None
) -> list[Stretch]:
    """Second differences over successive periods, divided by √6, after the response has settled.

    A first difference would still hold the slow decay from the start; the second difference keeps
    only what is new in each period.  Where all of them hold the first period and have not settled,
    it is the first difference of the last two periods, divided by √2.  Periods with more than
    a few samples of weight 0 in `counts` (N,) are left out.  `signal` (N,) replaces the response.
    """
    repeats = recording.drive_period()
    if repeats is None:
        return []
    period, used = repeats.period, slice(repeats.start, repeats.stop)
    count = (repeats.stop - repeats.start) // period
    y = recording.response if signal is None else signal
    lost = np.zeros(len(y), bool) if counts is None else counts == 0
    periods = bridged(y, lost)[used][: count * period].reshape(count, period)
    complete = lost[used][: count * period].reshape(count, period).mean(axis=1) <= _BRIDGED
    pairs = np.flatnonzero(complete[1:] & complete[:-1])

    def stretch(difference: np.ndarray, number: int) -> Stretch:
        # A response that has not settled still changes slowly.
        start = repeats.start + number * period
        if period > _SHORT_PERIOD:
            return Stretch.without_relaxation(difference, start)
        return Stretch.untouched(difference - difference.mean(), start)

    # Period by period: across periods the spectrum of a difference is a comb, that of noise is not.
    # The noise of three periods is on average that of the middle one, to which it is assigned.
    second = [
        stretch((periods[k + 1] - 2 * periods[k] + periods[k - 1]) / np.sqrt(6), k)
        for k in range(1, count - 1)
        if {k - 1, k} <= set(pairs.tolist())
    ]
    if not second:
        return []
    last = int(pairs[-1]) + 1
    first = stretch((periods[last] - periods[last - 1]) / np.sqrt(2), last)
    settled = first_settled([s.samples for s in (*second, first)])
    return without_events(second[settled:] or [first])


def _noise_of_repeats(stretches: list[Stretch], recording: Recording) -> Noise:
    """The noise of differences between periods."""
    return noise_in(
        stretches, recording.response_unit, "repeats", _SHARED,
        resolution=recording.resolution, least=_least_level(recording),
    )  # fmt: skip


def _least_level(recording: Recording) -> float:
    """The least level [response unit, rms] of a response's noise: the rounding error of its codes,
    which repeats and rests may hide, or that of a simulation.
    """
    return max(recording.resolution / np.sqrt(12), _EXACT * float(np.ptp(recording.response)))


def _from_static(recording: Recording, counts: np.ndarray | None) -> list[Stretch]:
    """Rests minus the actuator's slow relaxation, a fitted parabola and logarithms of time.

    Rests with more than a few samples of weight 0 in `counts` (N,) are left out.  So are rests that
    show less than the rounding error of the response's codes: on one or two codes the noise is
    hidden.
    """
    stretches = []
    lost = np.zeros(len(recording), bool) if counts is None else counts == 0
    response = bridged(recording.response, lost)
    for start, stop in recording.static_stretches(_REST_SECONDS):
        begin = start + (stop - start) // 10
        if np.mean(lost[begin:stop]) > _BRIDGED:
            continue
        stretch = Stretch.settled(response[begin:stop], begin)
        constant = np.ptp(response[begin:stop]) == 0
        if constant or stretch.samples.std() < recording.resolution / np.sqrt(12):
            continue
        stretches.append(stretch)
    return without_events(stretches) if stretches else []


def measured_noise(
    recording: Recording,
    repeat: Recording | None = None,
    counts: np.ndarray | None = None,
) -> Noise | None:
    """The noise from repeated periods, a repeat recording, or a rest.

    Periods and rests where the weights `counts` (N,) are 0 are ignored, and spikes are bridged by
    straight lines.  None where the recording has no such source.
    """
    rests = recording.static_stretches(_REST_SECONDS)
    if repeat is None and recording.drive_period() is None and not rests:
        return None
    recording = _without_spikes(recording)
    unit = recording.response_unit
    if repeat is not None:
        if not _has_same_drive(repeat, recording):
            raise _repeat_error(repeat, [recording])
        difference = (repeat.response - recording.response) / np.sqrt(2)
        return noise_in(
            [Stretch.settled(difference, 0)], unit, "repeats", least=_least_level(recording)
        )
    if series := _from_repeats(recording, counts):
        return _noise_of_repeats(series, recording)
    if series := _from_static(recording, counts):
        return noise_in(series, unit, "static", resolution=recording.resolution)
    return None


def _without_spikes(recording: Recording) -> Recording:
    """The recording with straight lines over its spikes: five of them can be all of its rms."""
    alone = recording.spikes
    if not alone.any():
        return recording
    return replace(recording, response=bridged(recording.response, alone))


def measured_noises(
    recordings: Sequence[Recording],
    repeats: Sequence[Recording],
    specification: float | None,
    counts: Sequence[np.ndarray | None],
) -> list[Noise | None]:
    """The noise of each recording.

    It is the recording's own (`measured_noise`, with the repeat that has its drive).  Otherwise it
    is that of another recording at the same sampling rate, the one with most independent samples.
    Otherwise it is white, of the sensor's `specification` [response unit, rms], or of the level
    that another recording showed.  None where there is none of these; then only the residual of a
    fit remains.

    Raises InputError for a repeat whose drive is that of no recording.
    """
    unrelated = (r for r in repeats if not any(_has_same_drive(r, each) for each in recordings))
    if other := next(unrelated, None):
        raise _repeat_error(other, recordings)
    own = [
        measured_noise(
            each, next((r for r in repeats if _has_same_drive(r, each)), None), its_counts
        )
        for each, its_counts in zip(recordings, counts, strict=True)
    ]
    pairs = zip(own, recordings, strict=True)
    measured = sorted(((n, r.rate) for n, r in pairs if n), key=lambda pair: -pair[0].effective)
    return [
        noise or _measured_elsewhere(recording, measured, specification)
        for noise, recording in zip(own, recordings, strict=True)
    ]


def _measured_elsewhere(
    recording: Recording, measured: Sequence[tuple[Noise, float]], specification: float | None
) -> Noise | None:
    """The noise of a recording that shows none itself, from the noises of others.

    `measured` holds each noise with its recording's sampling rate [Hz].
    """
    for noise, rate in measured:
        if np.isclose(rate, recording.rate, rtol=_SAME_RATE):
            # The profile over time belongs to the recording that it was read from.
            return replace(noise, course=NONE)
    # At another sampling rate the colour is different.
    sigma = specification or next((noise.sigma for noise, _ in measured), None)
    return None if sigma is None else _specified(sigma, recording.response_unit)


def _specified(sigma: float, unit: str) -> Noise:
    """White noise of a specified level [unit, rms]."""
    return replace(white_noise(sigma, unit, "specification"), is_leftover=True)


def _has_same_drive(other: Recording, recording: Recording) -> bool:
    """Whether a recording has the drive of another, to 1 % of its range."""
    tolerance = 1e-2 * np.ptp(recording.drive)
    return len(other) == len(recording) and np.allclose(
        other.drive, recording.drive, atol=tolerance
    )


def _repeat_error(repeat: Recording, recordings: Sequence[Recording]) -> InputError:
    """The error of a repeat whose drive is that of none of the recordings."""
    named = " or ".join(f"{each.source} ({len(each)} samples)" for each in recordings)
    return InputError(
        f"{repeat.source}: expected a repeat with the drive of {named}, found another drive "
        f"({len(repeat)} samples); record the same drive twice"
    )


def read_from_residuals(pairs: Sequence[tuple[Noise | None, Residual]]) -> list[Noise]:
    """The noise in each of the residuals of fits, instead of the one that the fit was made with.

    The level of a specified noise is kept.  Only its colour is read, and only where the residual
    holds little else.
    """
    specified = [noise if noise and noise.method == "specification" else None for noise, _ in pairs]
    residuals = [residual for _, residual in pairs]
    kept_level = [r for noise, r in zip(specified, residuals, strict=True) if noise]
    others = [r for noise, r in zip(specified, residuals, strict=True) if not noise]
    below, read = iter(noises_below(kept_level)), iter(residual_noises(others))
    return [noise.coloured_as(next(below)) if noise else next(read) for noise in specified]


def levels_of_residuals(residuals: Sequence[Residual]) -> list[Noise]:
    """White noise of the level that the second differences of each fit's residual show."""
    recordings = [residual.recording for residual in residuals]
    levels = in_rows(
        level_without_motion, [r.samples for r in residuals], [r.counted for r in residuals]
    )
    white = [
        white_noise(max(float(level), _least_level(each)), each.response_unit, "residual")
        for level, each in zip(levels, recordings, strict=True)
    ]
    return [replace(noise, is_leftover=True) for noise in white]


def residual_noises(residuals: Sequence[Residual]) -> list[Noise]:
    """The noise in each of the residuals of fits.

    If the drive occurs twice, the noise is the difference of both times divided by √2: what repeats
    is mismatch, and the fit describes what the start adds to the first time.  Otherwise, as the
    last resort, the residual counts as noise, but no more of it than its second differences show:
    what is smooth from sample to sample may be mismatch, and a noise floor must not conceal it.
    """
    periods = [repetition_lag(r.recording.drive) if r.used.all() else None for r in residuals]
    # Of what repeats both times have one curve, so that their difference keeps all noise.
    single = [r.unspent for r, period in zip(residuals, periods, strict=True) if period is None]
    alone = zip(single, noises_below(single), levels_of_residuals(single), strict=True)
    noises = []
    for one, period in zip(residuals, periods, strict=True):
        residual, recording = one.samples, one.recording
        unit, least = recording.response_unit, _least_level(recording)
        if period is not None:
            # Of several times only the first two: differences that share noise have a comb as
            # spectrum.
            second = residual[period : 2 * period]
            difference = (second - residual[: second.size]) / np.sqrt(2)
            noise = noise_in([Stretch.settled(difference, 0)], unit, "repeats", least=least)
        else:
            unspent, noise, level = next(alone)
            if noise.sigma**2 > _BARELY_MORE * _roughness(unspent) ** 2:
                noise = replace(level, effective=noise.effective)
        noises.append(replace(noise, is_leftover=True))
    return noises


def _roughness(residual: Residual) -> float:
    """The rms of white noise with second differences of this rms: whatever its tails, and however
    its level varies along the residual."""
    counted = residual.counted
    whole = counted[2:] & counted[1:-1] & counted[:-2]
    bends = np.diff(residual.samples, 2)[whole]
    return float(np.sqrt(np.mean(bends**2) / 6)) if bends.size else 0.0


def noises_below(residuals: Sequence[Residual]) -> list[Noise]:
    """Each whole residual as noise, apart from spikes.

    It is that of a residual smaller than the measured noise, and elsewhere an upper bound.
    """
    inspect_together([r.recording for r in residuals])
    counted = [r.samples[r.counted] for r in residuals]
    stretches = [Stretch.untouched(samples - samples.mean(), 0) for samples in counted]
    colours = autoregressions([[stretch.samples] for stretch in stretches])
    return [
        noise_of(
            [stretch], colour, r.recording.response_unit, "residual",
            least=_least_level(r.recording),
        )
        for r, stretch, colour in zip(residuals, stretches, colours, strict=True)
    ]  # fmt: skip


@kept
def repetition_lag(drive: np.ndarray) -> int | None:
    """The number of samples after which a drive (N,) repeats, None where it does not.

    At least a third of the drive must repeat, to 0.2 % of the drive's standard deviation, and the
    repeated part must vary at least half as much as the whole.
    """
    u = unit_range(drive)
    first_lag = u.size // 3
    lag = first_lag + int(np.argmin(mismatch(u)[first_lag:]))
    return lag if repeats_after(u, lag) else None


def repeats_after(drive: np.ndarray, lag: int) -> bool:
    """Whether a drive (N,) is the same a lag of so many samples later, as `repetition_lag` asks."""
    first, spread = drive[: drive.size - lag], drive.std()
    departure = np.sqrt(np.mean((drive[lag:] - first) ** 2))
    return bool(departure <= _SAME_DRIVE * spread and first.std() > 0.5 * spread)
