"""The noise floor of a recording and its colour, from the first source that applies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.signal import fftconvolve, lfilter
from scipy.stats import chi2, kurtosis

from .._recording import InputError, Recording
from ._autoregression import autoregression, taken_power
from ._problem import resolution
from ._tone import Tone, tone_in

Method = Literal["repeats", "static", "specification", "residual"]
_REST_SECONDS = 0.2
# Successive second differences have the correlations -2/3 and 1/6: 1 + 2 Σ ρ² ≈ 2.
_SHARED = 2.0
_FEW, _SHORT = 3, 50
_PIECES = 12
_SHORTEST_PIECE = 40
_SURELY_VARYING = 1e-4
_MEDIAN_NORMAL = 0.6745
# Of n normal values the square of the median size has the relative variance 5.44/n, and of their
# differences, which share values, a third more.
_MEDIAN_SQUARED = 7.3
_SAME, _SAME_RATE = 2e-3, 1e-6
_CLEARER = 0.97
_MUCH_MORE = 2.0
_BARELY_MORE = 1.25
_NONE = np.zeros(0), np.zeros(0)


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: Σ_k filter[k] e_{t-k} = innovation · white, filter[0] = 1.

    `sigma` is the rms of all that does not repeat, in `unit`, and of what went with slow terms that
    were fitted to it; `method` says where it was read.  The
    filter leaves lines of the mains out, so that they count as mismatch and can be named.
    It was read from `effective` independent samples, of this `kurtosis`: a floor read from a short
    rest, or from noise with heavy tails, is known less well than the recording's length suggests.
    `lines`: frequencies [1/sample] and power (n,) of the whitened noise, 1 where the filter fits,
    each as good as 2/`shared` degrees of freedom.
    `is_leftover`: it was read from what a fit left over, so that a better fit tells it better; of
    one that is specified, as a number, its colour.
    `course`: sample numbers and the noise's size there (n,), of which it is 1 on average; none
    where the noise is as large everywhere as far as can be seen.  `crest`: its rms over what the
    median of its differences says, 1 for normal noise.  `tone`: one
    that it surely holds.
    """

    sigma: float
    unit: str
    method: Method
    filter: np.ndarray
    innovation: float
    effective: float = np.inf
    kurtosis: float = 3.0
    lines: tuple[np.ndarray, np.ndarray] = field(default=_NONE, repr=False)
    shared: float = 1.0
    is_leftover: bool = False
    course: tuple[np.ndarray, np.ndarray] = _NONE
    crest: float = 1.0
    tone: Tone | None = None

    def coloured_as(self, other: Noise) -> Noise:
        """A noise of this size and origin with the colour of another; itself where that is clearly
        larger, for then more than noise is in it."""
        if other.sigma**2 > _BARELY_MORE * self.sigma**2:
            return self
        innovation = other.innovation * self.sigma / other.sigma
        return replace(other, sigma=self.sigma, method=self.method, innovation=innovation)

    def size_at(self, samples: int) -> np.ndarray | None:
        """How large the noise is at each sample (N,), 1 on average; None where it does not vary."""
        where, size = self.course
        if not where.size:
            return None
        # Where none was seen, at either end, it is not taken for smaller than elsewhere.
        ends = {"left": max(size[0], 1.0), "right": max(size[-1], 1.0)}
        return np.interp(np.arange(samples), where, size, **ends)

    def samples_to_average(self, error: float) -> float:
        """How many samples in a row know a constant with a standard error of that share of sigma.

        The variance of their mean tends to (innovation / Σ_k filter[k])² / n, the spectrum at
        frequency zero: where neighbours are alike, noise averages out more slowly.
        """
        slow = self.innovation / (self.sigma * max(abs(float(np.sum(self.filter))), 1e-12))
        return (slow / error) ** 2

    def doubt(self, kurtosis: float = 3.0) -> float:
        """The relative standard error of the variance, with the heavier of both tails."""
        return float(np.sqrt((max(kurtosis, self.kurtosis) - 1) / self.effective))

    def without_lines(self) -> Noise:
        """The same noise, with no more in any band than its filter says."""
        return replace(self, lines=_NONE)

    @property
    def whitened_square(self) -> float:
        """The mean square of what it was read from, whitened: 1, unless that holds a line that the
        filter leaves out."""
        power = self.lines[1]
        return float(power.mean()) if power.size else 1.0

    @property
    def whitening(self) -> np.ndarray:
        """The filter that turns this noise into white noise of unit variance."""
        return self.filter / self.innovation


@dataclass(frozen=True)
class _Stretch:
    """Samples (n,) that hold nothing but noise, the first one's number in the recording, and the
    orthonormal terms (n, k) that have been fitted to them and taken off."""

    samples: np.ndarray
    start: int
    terms: np.ndarray

    @classmethod
    def untouched(cls, samples: np.ndarray, start: int) -> _Stretch:
        """Of samples from which nothing was taken off."""
        return cls(samples, start, np.zeros((samples.size, 0)))

    @classmethod
    def without_relaxation(cls, samples: np.ndarray, start: int) -> _Stretch:
        """Of samples that held the actuator's slow relaxation too: the parabola and the logarithms
        of time that fit it best are taken off."""
        x = np.linspace(0, 1, samples.size)
        slow = np.stack([np.ones_like(x), x, x**2, np.log(x + 0.02), np.log(x + 0.2)], axis=1)
        terms = np.linalg.qr(slow)[0]
        return cls(samples - terms @ (terms.T @ samples), start, terms)

    @property
    def taken(self) -> int:
        """How many freedoms the terms have taken."""
        return self.terms.shape[1]


def _noise(
    stretches: list[_Stretch],
    unit: str,
    method: Method,
    shared: float = 1.0,
    *,
    resolution: float = np.inf,
) -> Noise:
    """Noise from stretches that hold nothing else; `shared`: how many of their samples hold the
    same noise.  Its size is followed along the recording where it is larger than the response's
    resolution: within a converter's step there is none, and beside it much."""
    colour = autoregression([s.samples for s in stretches], [s.terms for s in stretches])
    coefficients, innovation = colour
    squares = sum(np.sum(s.samples**2) + taken_power(colour, s.terms) for s in stretches)
    sigma = float(np.sqrt(squares / sum(s.samples.size for s in stretches)))
    taps = coefficients / innovation
    series = [s.samples * np.sqrt(s.samples.size / (s.samples.size - s.taken)) for s in stretches]
    lost = taps.size - 1
    whitened = [np.asarray(lfilter(taps, 1.0, s))[lost:] for s in series]
    starts = [s.start + lost for s in stretches]
    course = _course(whitened, starts, shared) if resolution < sigma else _NONE
    if course[0].size:
        whitened = [
            w / np.interp(start + np.arange(w.size), *course)
            for w, start in zip(whitened, starts, strict=True)
        ]
    white = np.concatenate(whitened)
    # Codes that stay the same for most samples have differences of no size.
    typical = median_size(np.diff(white))
    tails = max(float(kurtosis(white, fisher=False)), 3.0)
    # The slowest lines are the ones that the fit took away.
    slow = [1 + (s.taken + 1) // 2 for s in stretches]
    spectra = [
        (np.fft.rfftfreq(w.size)[k:], np.abs(np.fft.rfft(w))[k:] ** 2 / w.size)
        for w, k in zip(whitened, slow, strict=True)
    ]
    frequencies, power = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
    return Noise(
        sigma,
        unit,
        method,
        coefficients,
        innovation,
        effective=white.size / shared,
        kurtosis=tails,
        lines=(frequencies, power),
        shared=shared,
        course=course,
        crest=float(np.sqrt(np.mean(white**2))) / typical if typical else 1.0,
        tone=tone_in(whitened, taps, sigma, shared),
    )


def _course(
    whitened: list[np.ndarray], starts: list[int], shared: float
) -> tuple[np.ndarray, np.ndarray]:
    """How the size of the noise changes along the recording: sample numbers and sizes (n,), none
    where a χ² test over pieces shows no change."""
    # In differences the slow decay that one period after a jump has before the next is gone.
    white = np.concatenate([np.diff(w) for w in whitened])
    where = np.concatenate(
        [s + np.arange(w.size - 1) for s, w in zip(starts, whitened, strict=True)]
    )
    order = np.argsort(where, kind="stable")
    pieces = min(_PIECES, white.size // _SHORTEST_PIECE)
    if pieces < 2:
        return _NONE
    sizes = np.array([median_size(part) for part in np.array_split(white[order], pieces)])
    centres = np.array([np.mean(part) for part in np.array_split(where[order], pieces)])
    relative = (sizes / np.sqrt(np.mean(sizes**2))) if sizes.all() else np.ones(pieces)
    variance = _MEDIAN_SQUARED * shared * pieces / white.size
    if chi2.sf(np.sum((relative**2 - 1) ** 2) / variance, pieces - 1) > _SURELY_VARYING:
        return _NONE
    return centres, relative


def median_size(differences: np.ndarray) -> float:
    """The sd of normal noise with such differences, by their median: what rings at the beginning
    of a rest, and outliers, are passed over."""
    return float(np.median(np.abs(differences)) / (_MEDIAN_NORMAL * np.sqrt(2)))


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
        again = _noise(
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
    parts = np.array_split(np.flatnonzero(counted), _PIECES)
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
) -> list[_Stretch]:
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
            _Stretch.without_relaxation(block, int(start))
            for block, start in zip(blocks, starts, strict=True)
        ]
    mean = blocks.mean()
    pairs = zip(blocks, starts, strict=True)
    return [_Stretch.untouched(block - mean, int(start)) for block, start in pairs]


def _from_static(recording: Recording, counts: np.ndarray | None, step: float) -> list[_Stretch]:
    """Rests without the actuator's slow relaxation: a parabola and logarithms of time taken off.

    Those with samples of weight 0 are left out, and those that show less than what rounding to the
    response's `step` makes of a recording that moves: on one or two codes noise is hidden."""
    stretches = []
    for start, stop in recording.static_stretches(_REST_SECONDS):
        begin = start + (stop - start) // 10
        if counts is not None and not np.all(counts[begin:stop]):
            continue
        stretch = _Stretch.without_relaxation(recording.response[begin:stop], begin)
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
        return _noise([_Stretch.untouched(difference - difference.mean(), 0)], unit, "repeats")
    step = resolution(recording.response)
    if series := _from_repeats(recording, counts):
        return _noise(series, unit, "repeats", _SHARED, resolution=step)
    if series := _from_static(recording, counts, step):
        return _noise(series, unit, "static", resolution=step)
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
            return replace(noise, course=_NONE)
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
        stretch = _Stretch.without_relaxation(difference, 0)
        noise = _noise([stretch], recording.response_unit, "repeats")
    else:
        left = residual[used] - residual[used].mean()
        noise = _noise([_Stretch.untouched(left, 0)], recording.response_unit, "residual")
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
