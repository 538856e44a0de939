"""The assumptions about a recording before it is fitted: history, settling, noise."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from .._operators import History
from .._recording import MINIMUM_SAMPLES, InputError, Recording, parse_quantity
from ._noise import Noise
from ._noise_sources import repeats_after, repetition_lag

HistoryOption = History | Literal["estimated"]
_MANY_PERIODS = 8
"""From this many periods on the first can be spared for settling.  Chosen by judgement."""
_STEADY = 1.5
"""Largest rms of the first change or oscillation, over the median of all, in steady cycles.  Chosen
by judgement."""
_STEADY_WITH_DRIFT = 2.0
"""The same for changes that include the drift of the noise, which is allowed more."""
_LEAST_BASELINE = 20
"""Fewest samples from which a zero is read."""
_BASELINE_ERROR = 0.1
"""Standard error of that zero, as a share of the noise: it raises a held-out error by 0.5 %."""
_BASELINE_SHARE = 0.1
"""Largest share of the recording that is spent on it.  Chosen by judgement."""


@dataclass(frozen=True)
class Take:
    """One recording with its history, the samples that count, and its noise.

    Attributes:
        recording: drive and response.
        history: the drive before t = 0; "estimated" is the constant one, plus the fitted effect of
            another drive before t = 0.
        settling: the number of first samples that do not count, because their prior history is
            unknown.
        used: (N,) whether a sample counts.
        noise: the noise of the response, None where it is not yet known.
        weights: (N,) weights of the squared residual from the call, dimensionless.
        trust: (N,) weights of the squared residual from a robust loss, dimensionless.
        jumps: samples from which on the response may be displaced.
    """

    recording: Recording
    history: HistoryOption
    settling: int
    used: np.ndarray
    noise: Noise | None
    weights: np.ndarray | None = None
    trust: np.ndarray | None = None
    jumps: tuple[int, ...] = ()

    @cached_property
    def period(self) -> int | None:
        """The number of samples after which the drive repeats, None where it does not.

        The drive repeats periodically, or the recording's second half repeats the first.
        """
        repeats = self.recording.drive_period()
        if repeats is not None:
            return repeats.period
        half, odd = divmod(len(self.recording), 2)
        drive = self.recording.drive
        # The lag of all is found by transforms, which a drive whose halves differ is spared.
        if odd or not repeats_after(drive, half):
            return None
        return half if repetition_lag(drive) == half else None

    @property
    def roots(self) -> np.ndarray | None:
        """The factors (N,) of the whitened residual, None where all are 1.

        They are the square roots of all weights, divided by the relative level of a noise that
        varies.
        """
        factors = [np.sqrt(w) for w in (self.weights, self.trust) if w is not None]
        level = None if self.noise is None else self.noise.size_at(len(self.recording))
        if level is not None:
            factors.append(1 / level)
        return np.prod(factors, axis=0) if factors else None

    @property
    def whitening(self) -> np.ndarray:
        """The whitening filter (taps,) of its noise, 1 where it is not yet known."""
        return np.ones(1) if self.noise is None else self.noise.whitening

    @property
    def baseline(self) -> slice:
        """The first samples, from which the zero of a prediction is read.

        They are enough to know it to a tenth of the noise, but at most a tenth of the recording.
        """
        enough = 0.0 if self.noise is None else self.noise.samples_to_average(_BASELINE_ERROR)
        samples = int(min(enough, _BASELINE_SHARE * len(self.recording)))
        return slice(0, max(self.settling, _LEAST_BASELINE, samples))


def settling_samples(settling: str, recording: Recording) -> int:
    """A settling time such as "1 s" in samples of the recording.

    Raises InputError where too few samples would remain.
    """
    where = f"{recording.source}, --settle"
    samples = round(parse_quantity(settling, "s", where) / recording.dt)
    largest = len(recording) - MINIMUM_SAMPLES
    if not 0 <= samples <= largest:
        raise InputError.at(
            where, f"a time from 0 to {largest * recording.dt:.4g} s", f'"{settling}"', "shorten it"
        )
    return samples


def take_of(
    recording: Recording,
    noise: Noise | None,
    history: HistoryOption | None,
    settling: int | None,
    weights: np.ndarray | None = None,
) -> Take:
    """A recording with the given history, "constant" where none is given.

    "periodic" cuts the recording to whole periods, or keeps all of it where the drive ends where it
    began.  If the drive has many periods, the first period does not count unless `settling`
    [samples] says otherwise.  Samples of weight 0 do not count either.
    """
    repeats = recording.drive_period()
    if history == "periodic":
        if repeats is not None and repeats.start < repeats.period:
            samples = repeats.whole
        elif _ends_where_it_began(recording.drive):
            samples = len(recording)
        else:
            raise InputError(
                f"{recording.source}: expected a drive that repeats from the start, or one period "
                'that ends where it began, for the history "periodic", found neither; choose '
                '"constant" or "rest"'
            )
        return _steady_take(recording, samples, noise, weights)
    if settling is None:
        repeats_often = (
            repeats is not None and repeats.stop - repeats.start >= _MANY_PERIODS * repeats.period
        )
        from_start = repeats is not None and repeats.start < repeats.period
        settling = repeats.period if repeats is not None and repeats_often and from_start else 0
    used = np.arange(len(recording)) >= settling
    if weights is not None:
        used &= weights > 0
    return Take(recording, history or "constant", settling, used, noise, weights)


def _ends_where_it_began(signal: np.ndarray) -> bool:
    """Whether the step from a signal's (N,) last sample to its first is at most its largest
    step.
    """
    return bool(abs(signal[0] - signal[-1]) <= np.abs(np.diff(signal)).max())


def _steady_take(
    recording: Recording, samples: int, noise: Noise | None, weights: np.ndarray | None
) -> Take:
    """The first `samples` samples, as steady cycles."""
    weights = None if weights is None else weights[:samples]
    used = np.ones(samples, bool) if weights is None else weights > 0
    return Take(recording.window(0, samples), "periodic", 0, used, noise, weights)


def alternative_history(take: Take) -> Take | None:
    """The recording with the other possible history, None where there is none; the fit chooses.

    The recording may show steady cycles (`steady_of`).  A drive that jumps to its first value may
    have been switched on at that moment (`rest`).
    """
    if take.history != "constant":
        return None
    steady = steady_of(take)
    if steady is not None:
        return steady
    drive = take.recording.drive
    if take.settling and abs(drive[0]) > 0.02 * np.ptp(drive):
        return replace(take, history="rest")
    return None


def steady_of(take: Take) -> Take | None:
    """The recording as steady cycles (`periodic`), None where it cannot be.

    Either the drive repeats from the first sample on and the first period of the response is like
    the second.  Or the recording is one period, or two that are alike, which begins in motion and
    whose drive and response end where they began.
    """
    recording = take.recording
    repeats = recording.drive_period()
    if repeats is None:
        closed = _ends_where_it_began(recording.drive) and _ends_where_it_began(recording.response)
        steady = closed and (take.period is None or _is_steady(recording, take.period))
        steady_samples = len(recording) if steady and begins_in_motion(recording) else 0
    else:
        repeats_throughout = repeats.start == 0 and repeats.stop > 0.8 * len(recording)
        steady_samples = (
            repeats.whole if repeats_throughout and _is_steady(recording, repeats.period) else 0
        )
    return (
        _steady_take(recording, steady_samples, take.noise, take.weights)
        if steady_samples
        else None
    )


def begins_in_motion(recording: Recording) -> bool:
    """Whether the drive moves from the first samples on."""
    repeats = recording.drive_period()
    # More cycles of the same drive do not change how it begins.
    first = max(4, (len(recording) if repeats is None else repeats.period) // 200)
    return bool(np.ptp(recording.drive[:first]) > 5e-3 * np.ptp(recording.drive))


def _is_steady(recording: Recording, period: int) -> bool:
    """Whether the first period of the response is like the second.

    Of more than two periods, the first may differ from the second as much as the later ones from
    one another.  Of two, they may differ at the beginning as much as later on.
    """
    count = len(recording) // period
    changes = np.diff(recording.response[: count * period].reshape(count, period), axis=0)
    if count > 2:
        return _starts_like_the_others(changes, _STEADY)
    # A start from rest oscillates or creeps.  Drifting noise creeps too, hence the larger ratio.
    eighths = changes[0, : period // 8 * 8].reshape(8, -1)
    oscillation = np.diff(eighths, axis=1)
    return _starts_like_the_others(oscillation, _STEADY) and _starts_like_the_others(
        eighths, _STEADY_WITH_DRIFT
    )


def _starts_like_the_others(parts: np.ndarray, largest_ratio: float) -> bool:
    """Whether the rms of the first of the parts (n, L) is at most this multiple of the median."""
    levels = np.sqrt(np.mean(parts**2, axis=1))
    return bool(levels[0] <= largest_ratio * np.median(levels))
