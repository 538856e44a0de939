"""Where a recording's noise is read: repeats, rests, a specification, or what a fit leaves over."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import fftconvolve, lfilter

from .._recording import InputError, Recording
from ._noise import NONE, Noise
from ._noise_stretches import PIECES, Stretch, median_size, noise_in
from ._setting import resolution

_REST_SECONDS = 0.2
# Successive second differences have the correlations -2/3 and 1/6: 1 + 2 Σ ρ² ≈ 2.
_SHARED = 2.0
_FEW, _SHORT = 3, 50
_SAME, _SAME_RATE = 2e-3, 1e-6
_CLEARER = 0.97
_MUCH_MORE = 2.0


def cleared(noise: Noise, residual: np.ndarray, used: np.ndarray, recording: Recording) -> Noise:
    """A measured noise, told better with what a fit leaves over (N,), where samples are `used`.

    Repeats of a residual hold less of the actuator's memory of its start than those of a response.
    And a drive that is given twice tells the noise all along, where rests tell that of a few
    moments; unless much more than the noise of the rests does not repeat.
    """
    if noise.method == "repeats":
        stretches = _from_repeats(recording, used.astype(float), residual)
        if not stretches:
            return noise
        again = noise_in(
            stretches, noise.unit, "repeats", _SHARED, resolution=resolution(recording.response)
        )
        # A decay that has not settled is in few slow lines, which the innovation hardly tells.
        clearer = min(again.innovation / noise.innovation, again.sigma / noise.sigma) < _CLEARER
        return again if clearer else noise
    if noise.method == "static" and given_twice(recording.drive) is not None and used.all():
        again = residual_noise(residual, used, recording)
        of_noise = again.innovation**2 < _MUCH_MORE * noise.innovation**2
        if of_noise and again.effective > noise.effective:
            return replace(again, is_leftover=False)
    return followed(noise, residual, used) if noise.course[0].size else noise


def followed(noise: Noise, residual: np.ndarray, used: np.ndarray) -> Noise:
    """A noise whose size varies, followed all along a residual (N,) where samples are `used`.

    Rests show how large it is in them, and the heights of its crests; between them the differences
    of what a fit leaves over show its course, for a mismatch is smooth from sample to sample; none
    where most samples are on their neighbours' codes.
    """
    lost = noise.filter.size - 1
    whitened = np.asarray(lfilter(noise.whitening, 1.0, residual))[lost:]
    differences, counted = np.diff(whitened), used[lost + 1 :]
    where = lost + np.arange(differences.size)
    parts = np.array_split(np.flatnonzero(counted), PIECES)
    centres = np.array([where[part].mean() for part in parts])
    sizes = noise.crest * np.array([median_size(differences[part]) for part in parts])
    if not sizes.all():
        return noise
    typical = np.sqrt(np.mean(sizes**2))
    # There is no more noise than is left over, whatever the crests of a short rest say.
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
    """Second differences over successive periods /√6, once the response has settled.

    A first difference would still hold the slow decay of the actuator's memory of its start; the
    second keeps only what is new in each period.  Those with samples of weight 0 are left out.
    `signal` (N,) takes the place of the response.
    """
    repeats = recording.drive_period()
    if repeats is None:
        return []
    period = repeats.period
    y = (recording.response if signal is None else signal)[repeats.start : repeats.stop]
    difference = (y[2 * period :] - 2 * y[period:-period] + y[: -2 * period]) / np.sqrt(6)
    # Period by period: across periods a difference has a comb for its spectrum, noise has none.
    blocks = difference[: difference.size // period * period].reshape(-1, period)
    # A difference of three periods is as large as they are on average: as the one in the middle.
    starts = repeats.start + period * np.arange(1, len(blocks) + 1)
    if counts is not None:
        good = counts[repeats.start : repeats.stop] > 0
        clean = good[2 * period :] & good[period:-period] & good[: -2 * period]
        whole = clean[: blocks.size].reshape(-1, period).all(axis=1)
        blocks, starts = blocks[whole], starts[whole]
        if not len(blocks):
            return []
    if len(blocks) >= _FEW:
        spread = blocks.std(axis=1)
        settled = int(np.argmax(spread <= 1.2 * np.median(spread)))
        blocks, starts = blocks[settled:], starts[settled:]
    if period > _SHORT:
        # What has not settled still bends slowly.
        return [
            Stretch.without_relaxation(block, int(start))
            for block, start in zip(blocks, starts, strict=True)
        ]
    mean = blocks.mean()
    pairs = zip(blocks, starts, strict=True)
    return [Stretch.untouched(block - mean, int(start)) for block, start in pairs]


def _from_static(recording: Recording, counts: np.ndarray | None, step: float) -> list[Stretch]:
    """Rests without the actuator's slow relaxation: a parabola and logarithms of time taken off.

    Those with samples of weight 0 are left out, and those that show less than what rounding to the
    response's `step` makes of a recording that moves: on one or two codes noise is hidden."""
    stretches = []
    for start, stop in recording.static_stretches(_REST_SECONDS):
        begin = start + (stop - start) // 10
        if counts is not None and not np.all(counts[begin:stop]):
            continue
        stretch = Stretch.without_relaxation(recording.response[begin:stop], begin)
        still = np.ptp(recording.response[begin:stop]) == 0
        if still or stretch.samples.std() < step / np.sqrt(12):
            continue
        stretches.append(stretch)
    return stretches


def measured_noise(
    recording: Recording,
    repeat: Recording | None = None,
    counts: np.ndarray | None = None,
) -> Noise | None:
    """Noise from repeated periods, a repeat recording, or a rest.

    Periods and rests where the weights `counts` (N,) are 0 are not looked at.  None where the
    recording offers no source.
    """
    unit = recording.response_unit
    if repeat is not None:
        if not _repeats(repeat, recording):
            raise _no_repeat(repeat, [recording])
        difference = (repeat.response - recording.response) / np.sqrt(2)
        return noise_in([Stretch.untouched(difference - difference.mean(), 0)], unit, "repeats")
    step = resolution(recording.response)
    if series := _from_repeats(recording, counts):
        return noise_in(series, unit, "repeats", _SHARED, resolution=step)
    if series := _from_static(recording, counts, step):
        return noise_in(series, unit, "static", resolution=step)
    return None


def measured_noises(
    recordings: Sequence[Recording],
    repeats: Sequence[Recording],
    specification: float | None,
    counts: Sequence[np.ndarray | None],
) -> list[Noise | None]:
    """Each recording's noise: its own, as `measured_noise` has it, a repeat being that of the
    recording whose drive it has; where it shows none, what another of the same rate has shown of
    the sensor, the longest; else the sensor's specification, or what another showed in its stead.
    None where there is nothing of this; then only the residual of a fit is left.

    Raises InputError for a repeat of none of them.
    """
    strangers = (r for r in repeats if not any(_repeats(r, each) for each in recordings))
    if stranger := next(strangers, None):
        raise _no_repeat(stranger, recordings)
    own = [
        measured_noise(each, next((r for r in repeats if _repeats(r, each)), None), some)
        for each, some in zip(recordings, counts, strict=True)
    ]
    pairs = zip(own, recordings, strict=True)
    shown = sorted(((n, r.rate) for n, r in pairs if n), key=lambda pair: -pair[0].effective)
    return [
        noise or _shown_elsewhere(recording, shown, specification)
        for noise, recording in zip(own, recordings, strict=True)
    ]


def _shown_elsewhere(
    recording: Recording, shown: Sequence[tuple[Noise, float]], specification: float | None
) -> Noise | None:
    """The noise of a recording that shows none, by what others have shown, each with its rate."""
    for noise, rate in shown:
        if np.isclose(rate, recording.rate, rtol=_SAME_RATE):
            # Its course is that of the recording which it was read from.
            return replace(noise, course=NONE)
    # At another rate it has another colour.
    sigma = specification or next((noise.sigma for noise, _ in shown), None)
    return None if sigma is None else _specified(sigma, recording.response_unit)


def _specified(sigma: float, unit: str) -> Noise:
    white = Noise(sigma, unit, "specification", np.ones(1), sigma)
    return replace(white, is_leftover=True)


def _repeats(again: Recording, recording: Recording) -> bool:
    """Whether one recording has the drive of another."""
    near = 1e-2 * np.ptp(recording.drive)
    return len(again) == len(recording) and np.allclose(again.drive, recording.drive, atol=near)


def _no_repeat(repeat: Recording, recordings: Sequence[Recording]) -> InputError:
    named = " or ".join(f"{each.source} ({len(each)} samples)" for each in recordings)
    return InputError(
        f"{repeat.source}: expected a repeat with the drive of {named}, found another drive "
        f"({len(repeat)} samples); record the same drive twice"
    )


def read_from_residual(
    noise: Noise | None, residual: np.ndarray, used: np.ndarray, recording: Recording
) -> Noise:
    """The noise in what a fit left over (N,), where samples are `used`; of one that is specified
    only the colour, for its size is told, and that where little else is in it."""
    found = residual_noise(residual, used, recording)
    return found if noise is None or noise.method != "specification" else noise.coloured_as(found)


def residual_noise(residual: np.ndarray, used: np.ndarray, recording: Recording) -> Noise:
    """The noise in what a fit left over (N,), where samples are `used`.

    Of a drive that is given twice, half the difference of both times: what repeats is mismatch, and
    what the memory of the start makes of the first time is in the fit.  Otherwise all of it,
    mismatch and all: the last resort.
    """
    period = given_twice(recording.drive)
    if period is not None and used.all():
        # Of three times only two: what two differences share would be a comb in their spectrum.
        again = residual[period : 2 * period]
        difference = (again - residual[: again.size]) / np.sqrt(2)
        stretch = Stretch.without_relaxation(difference, 0)
        noise = noise_in([stretch], recording.response_unit, "repeats")
    else:
        left = residual[used] - residual[used].mean()
        noise = noise_in([Stretch.untouched(left, 0)], recording.response_unit, "residual")
    return replace(noise, is_leftover=True)


def given_twice(drive: np.ndarray) -> int | None:
    """After how many samples a drive (N,) comes a second time: at least a third of it, to 0.2 % of
    its deviation and moving as much as the whole; None where it does not."""
    moved = drive - drive.mean()
    spread, size = moved.std(), drive.size
    lags = np.arange(size // 3, size - size // 3)
    squares = np.concatenate([[0.0], np.cumsum(moved**2)])
    products = fftconvolve(moved, moved[::-1])[size - 1 :]
    differ = squares[size - lags] + squares[-1] - squares[lags] - 2 * products[lags]
    best = int(lags[np.argmin(differ / (size - lags))])
    again, once = drive[best:], drive[: size - best]
    same = np.sqrt(np.mean((again - once) ** 2)) <= _SAME * spread
    return best if same and once.std() > 0.5 * spread else None
