"""What is assumed about recordings before they are fitted: history, memory, noise, grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from .._blocks import Setting
from .._operators import History
from .._recording import MINIMUM_SAMPLES, InputError, Recording, parse_quantity
from ._conditions import PLAIN, Conditions
from ._noise import Noise
from ._noise_sources import given_twice
from ._problem import Problem, make_problem
from ._setting import moving, setting_of, top_frequency

Past = History | Literal["estimated"]
_STEADY_FROM = 8
_STEADY, _DRIFTING = 1.5, 2.0
_LEAST_BASELINE, _BASELINE_ERROR, _BASELINE_SHARE = 20, 0.1, 0.1


@dataclass(frozen=True)
class Take:
    """One recording with its history, the samples that count and its noise, as yet perhaps unknown.

    `settling`: the first samples, whose memory is unknown; they do not count.  The history
    "estimated" is the constant one plus what another drive before t = 0 would still add.
    `weights` (N,) are those that were given, of the squared residual; `trust` (N,) those that a
    robust loss gives it.  `jumps` are the samples from which on the response may be displaced.
    """

    recording: Recording
    history: Past
    settling: int
    used: np.ndarray
    noise: Noise | None
    weights: np.ndarray | None = None
    trust: np.ndarray | None = None
    jumps: tuple[int, ...] = ()

    @cached_property
    def period(self) -> int | None:
        """After how many samples the drive comes again: in repeats, or as the recording's second
        half; None where it does not."""
        repeats = self.recording.drive_period()
        if repeats is not None:
            return repeats.period
        again = given_twice(self.recording.drive)
        return again if again is not None and 2 * again == len(self.recording) else None

    @property
    def roots(self) -> np.ndarray | None:
        """What multiplies the whitened residual (N,): the square roots of all weights, and one over
        the size of a noise that varies; None where there is neither."""
        given = [np.sqrt(w) for w in (self.weights, self.trust) if w is not None]
        size = None if self.noise is None else self.noise.size_at(len(self.recording))
        if size is not None:
            given.append(1 / size)
        return np.prod(given, axis=0) if given else None

    @property
    def baseline(self) -> slice:
        """The first samples, from which a prediction's zero is read: to a tenth of the noise, if a
        tenth of the recording is as long as that takes."""
        enough = 0.0 if self.noise is None else self.noise.samples_to_average(_BASELINE_ERROR)
        known = int(min(enough, _BASELINE_SHARE * len(self.recording)))
        return slice(0, max(self.settling, _LEAST_BASELINE, known))


@dataclass(frozen=True)
class Preparation:
    """Recordings made ready to be fitted together, and what is asked of their parameters."""

    takes: tuple[Take, ...]
    oversampling: int
    conditions: Conditions = PLAIN

    @property
    def setting(self) -> Setting:
        return setting_of([take.recording for take in self.takes])

    def problems(self, oversampling: int | None = None) -> tuple[Problem, ...]:
        """One problem per recording, on its own grid or on another."""
        if oversampling is None or oversampling == self.oversampling:
            return self._own
        return self._on(oversampling)

    @cached_property
    def _own(self) -> tuple[Problem, ...]:
        """Made once: a fit asks for them at every stage."""
        return self._on(self.oversampling)

    def _on(self, oversampling: int) -> tuple[Problem, ...]:
        return tuple(
            make_problem(
                take.recording,
                history="constant" if take.history == "estimated" else take.history,
                past=take.history == "estimated",
                oversampling=oversampling,
                used=take.used,
                whitening=np.ones(1) if take.noise is None else take.noise.whitening,
                weights=take.roots,
                jumps=take.jumps,
            )
            for take in self.takes
        )

    def with_noises(self, noises: Sequence[Noise]) -> Preparation:
        return self._with("noise", noises)

    def with_trust(self, trust: Sequence[np.ndarray | None]) -> Preparation:
        return self._with("trust", trust)

    def with_jumps(self, jumps: Sequence[tuple[int, ...]]) -> Preparation:
        return self._with("jumps", jumps)

    def _with(self, field: str, values: Sequence[Any]) -> Preparation:
        """One value of a take's field for each."""
        takes = zip(self.takes, values, strict=True)
        return replace(self, takes=tuple(replace(take, **{field: v}) for take, v in takes))

    def with_oversampling(self, oversampling: int) -> Preparation:
        return replace(self, oversampling=oversampling)


def settling_samples(settling: str, recording: Recording) -> int:
    """A settling time such as "1 s" in samples of the recording.

    Raises InputError where too few samples, or none, would be left.
    """
    where = f"{recording.source}, --settle"
    samples = round(parse_quantity(settling, "s", where) / recording.dt)
    most = len(recording) - MINIMUM_SAMPLES
    if not 0 <= samples <= most:
        raise InputError.at(
            where, f"a time from 0 to {most * recording.dt:.4g} s", f'"{settling}"', "shorten it"
        )
    return samples


def take_of(
    recording: Recording,
    noise: Noise | None,
    history: Past | None,
    settling: int | None,
    weights: np.ndarray | None = None,
) -> Take:
    """A recording under the given history (`constant` where none is given).

    `periodic` cuts it to whole periods, or takes all of it for one whose drive ends where it began.
    Of a drive with many periods the first does not count, unless `settling` [samples] says
    otherwise; nor do samples of weight 0.
    """
    repeats = recording.drive_period()
    if history == "periodic":
        if repeats is not None and repeats.start < repeats.period:
            whole = repeats.whole
        elif _closes(recording.drive):
            whole = len(recording)
        else:
            raise InputError(
                f"{recording.source}: expected a drive that repeats from the start, or one period "
                'that ends where it began, for the history "periodic", found neither; choose '
                '"constant" or "rest"'
            )
        return _steady_take(recording, whole, noise, weights)
    if settling is None:
        many = repeats is not None and repeats.stop - repeats.start >= _STEADY_FROM * repeats.period
        moving = repeats is not None and repeats.start < repeats.period
        settling = repeats.period if repeats is not None and many and moving else 0
    used = np.arange(len(recording)) >= settling
    if weights is not None:
        used &= weights > 0
    return Take(recording, history or "constant", settling, used, noise, weights)


def _closes(signal: np.ndarray) -> bool:
    """Whether the last of (N,) leads to the first as one leads to the next."""
    return bool(abs(signal[0] - signal[-1]) <= np.abs(np.diff(signal)).max())


def _steady_take(
    recording: Recording, whole: int, noise: Noise | None, weights: np.ndarray | None
) -> Take:
    """The first `whole` samples, as steady cycles."""
    weights = None if weights is None else weights[:whole]
    used = np.ones(whole, bool) if weights is None else weights > 0
    return Take(recording.window(0, whole), "periodic", 0, used, noise, weights)


def other_histories(take: Take) -> Take | None:
    """The other way the recording may have begun, for the fit to choose between; None if clear.

    It may have run before (`steady_of`); a drive that jumps to its first value may have been
    switched on with it (`rest`).
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
    """The recording as steady cycles (`periodic`), where it may be some.

    Its drive repeats from the first sample on, and the first period of the response is like the
    second; or it is one period, or two that are alike, that begin in motion and end, drive and
    response, where they began.
    """
    recording = take.recording
    repeats = recording.drive_period()
    if repeats is None:
        closed = _closes(recording.drive) and _closes(recording.response)
        steady = closed and (take.period is None or _is_steady(recording, take.period))
        whole = len(recording) if steady and begins_in_motion(recording) else 0
    else:
        kept = repeats.start == 0 and repeats.stop > 0.8 * len(recording)
        whole = repeats.whole if kept and _is_steady(recording, repeats.period) else 0
    return _steady_take(recording, whole, take.noise, take.weights) if whole else None


def begins_in_motion(recording: Recording) -> bool:
    """Whether the drive moves from the first samples on."""
    first = max(4, len(recording) // 200)
    return bool(np.ptp(recording.drive[:first]) > 5e-3 * np.ptp(recording.drive))


def _is_steady(recording: Recording, period: int) -> bool:
    """Whether the first period of the response is like the second: as far as the later ones are,
    or, of two, at its beginning as far as later on."""
    count = len(recording) // period
    changes = np.diff(recording.response[: count * period].reshape(count, period), axis=0)
    if count > 2:
        return _begins_like_the_rest(changes, _STEADY)
    # A start rings, or creeps; so does noise that drifts, which is given more.
    eighths = changes[0, : period // 8 * 8].reshape(8, -1)
    rings = np.diff(eighths, axis=1)
    return _begins_like_the_rest(rings, _STEADY) and _begins_like_the_rest(eighths, _DRIFTING)


def _begins_like_the_rest(parts: np.ndarray, most: float) -> bool:
    """Whether the first of the parts (n, L) is at most so many times as large as the median."""
    sizes = np.sqrt(np.mean(parts**2, axis=1))
    return bool(sizes[0] <= most * np.median(sizes))


def coarse_oversampling(recordings: list[Recording]) -> int:
    """A first grid: at least 16 samples per period of the fastest drive."""
    samples = min(1 / (top_frequency(r) * r.dt) for r in moving(recordings))
    return int(np.clip(2 ** np.ceil(np.log2(max(16 / samples, 1))), 1, 8))
