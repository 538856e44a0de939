"""A noise read from stretches of samples that hold nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2, kurtosis

from ._autoregression import autoregression, taken_power
from ._noise import NONE, Method, Noise
from ._tone import tone_in

PIECES = 12
"""Of a recording, in which the noise's size is followed."""
_SHORTEST_PIECE = 40
_SURELY_VARYING = 1e-4
_MEDIAN_NORMAL = 0.6745
# Of n normal values the square of the median size has the relative variance 5.44/n, and of their
# differences, which share values, a third more.
_MEDIAN_SQUARED = 7.3


@dataclass(frozen=True)
class Stretch:
    """Samples (n,) that hold nothing but noise, the first one's number in the recording, and the
    orthonormal terms (n, k) that have been fitted to them and taken off."""

    samples: np.ndarray
    start: int
    terms: np.ndarray

    @classmethod
    def untouched(cls, samples: np.ndarray, start: int) -> Stretch:
        """Of samples from which nothing was taken off."""
        return cls(samples, start, np.zeros((samples.size, 0)))

    @classmethod
    def without_relaxation(cls, samples: np.ndarray, start: int) -> Stretch:
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


def noise_in(
    stretches: list[Stretch],
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
    course = _course(whitened, starts, shared) if resolution < sigma else NONE
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
    pieces = min(PIECES, white.size // _SHORTEST_PIECE)
    if pieces < 2:
        return NONE
    sizes = np.array([median_size(part) for part in np.array_split(white[order], pieces)])
    centres = np.array([np.mean(part) for part in np.array_split(where[order], pieces)])
    relative = (sizes / np.sqrt(np.mean(sizes**2))) if sizes.all() else np.ones(pieces)
    variance = _MEDIAN_SQUARED * shared * pieces / white.size
    if chi2.sf(np.sum((relative**2 - 1) ** 2) / variance, pieces - 1) > _SURELY_VARYING:
        return NONE
    return centres, relative


def median_size(differences: np.ndarray) -> float:
    """The sd of normal noise with such differences, by their median: what rings at the beginning
    of a rest, and outliers, are passed over."""
    return float(np.median(np.abs(differences)) / (_MEDIAN_NORMAL * np.sqrt(2)))
