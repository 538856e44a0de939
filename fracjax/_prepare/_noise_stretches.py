"""The noise of stretches of samples that hold nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2, kurtosis

from ._autoregression import autoregression, removed_power
from ._noise import NONE, Method, Noise
from ._tone import tone_in

PIECES = 12
"""Pieces of a recording in which the level of the noise is followed.  Chosen by judgement."""
_SHORTEST_PIECE = 40
"""Fewest samples of a piece.  Chosen by judgement."""
_SIGNIFICANT = 1e-4
"""p-value below which the level of the noise counts as varying.  Chosen by judgement."""
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""
_MEDIAN_SQUARED = 7.3
"""n times the relative variance of the squared median of the absolute differences of n normal
values: 5.44 for independent values, and a third more for differences, which share values."""


@dataclass(frozen=True)
class Stretch:
    """Samples of a recording that hold only noise.

    Attributes:
        samples: (n,) in the response's unit.
        start: the index of the first sample in the recording.
        terms: (n, k) orthonormal terms that were fitted and subtracted.
    """

    samples: np.ndarray
    start: int
    terms: np.ndarray

    @classmethod
    def untouched(cls, samples: np.ndarray, start: int) -> Stretch:
        """A stretch from whose samples (n,) nothing was subtracted."""
        return cls(samples, start, np.zeros((samples.size, 0)))

    @classmethod
    def without_relaxation(cls, samples: np.ndarray, start: int) -> Stretch:
        """A stretch from whose samples (n,) a slow relaxation was subtracted.

        The relaxation is a fitted parabola and logarithms of time.
        """
        x = np.linspace(0, 1, samples.size)
        slow = np.stack([np.ones_like(x), x, x**2, np.log(x + 0.02), np.log(x + 0.2)], axis=1)
        terms = np.linalg.qr(slow)[0]
        return cls(samples - terms @ (terms.T @ samples), start, terms)

    @property
    def removed(self) -> int:
        """The number of degrees of freedom that the terms have removed."""
        return self.terms.shape[1]


def noise_in(
    stretches: list[Stretch],
    unit: str,
    method: Method,
    shared: float = 1.0,
    *,
    resolution: float = np.inf,
) -> Noise:
    """The noise of stretches that hold nothing else.

    `shared` says how many of their samples hold the same noise.  The level is followed along the
    recording if it exceeds the response's `resolution` [unit]: a noise below a converter's step is
    hidden while the response stays on one code, and visible next to a change of code.
    """
    colour = autoregression([s.samples for s in stretches], [s.terms for s in stretches])
    coefficients, innovation = colour
    squares = sum(np.sum(s.samples**2) + removed_power(colour, s.terms) for s in stretches)
    sigma = float(np.sqrt(squares / sum(s.samples.size for s in stretches)))
    taps = coefficients / innovation
    series = [s.samples * np.sqrt(s.samples.size / (s.samples.size - s.removed)) for s in stretches]
    skipped = taps.size - 1
    whitened = [np.asarray(lfilter(taps, 1.0, s))[skipped:] for s in series]
    starts = [s.start + skipped for s in stretches]
    profile = _level_profile(whitened, starts, shared) if resolution < sigma else NONE
    if profile[0].size:
        whitened = [
            w / np.interp(start + np.arange(w.size), *profile)
            for w, start in zip(whitened, starts, strict=True)
        ]
    white = np.concatenate(whitened)
    # The median is 0 where most samples have the code of their neighbour.
    median_level = level_from_differences(np.diff(white))
    whitened_kurtosis = max(float(kurtosis(white, fisher=False)), 3.0)
    # The fitted terms have removed the slowest lines.
    slow = [1 + (s.removed + 1) // 2 for s in stretches]
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
        kurtosis=whitened_kurtosis,
        lines=(frequencies, power),
        shared=shared,
        course=profile,
        crest=float(np.sqrt(np.mean(white**2))) / median_level if median_level else 1.0,
        tone=tone_in(whitened, taps, sigma, shared),
    )


def _level_profile(
    whitened: list[np.ndarray], starts: list[int], shared: float
) -> tuple[np.ndarray, np.ndarray]:
    """The noise's level over time: sample numbers and relative levels (n,).

    It is empty where a χ² test over pieces shows no significant change (`_SIGNIFICANT`).
    """
    # Differences remove the slow decay that one period after a jump has in common with the next.
    white = np.concatenate([np.diff(w) for w in whitened])
    where = np.concatenate(
        [s + np.arange(w.size - 1) for s, w in zip(starts, whitened, strict=True)]
    )
    order = np.argsort(where, kind="stable")
    pieces = min(PIECES, white.size // _SHORTEST_PIECE)
    if pieces < 2:
        return NONE
    sizes = np.array(
        [level_from_differences(part) for part in np.array_split(white[order], pieces)]
    )
    centres = np.array([np.mean(part) for part in np.array_split(where[order], pieces)])
    relative = (sizes / np.sqrt(np.mean(sizes**2))) if sizes.all() else np.ones(pieces)
    variance = _MEDIAN_SQUARED * shared * pieces / white.size
    if chi2.sf(np.sum((relative**2 - 1) ** 2) / variance, pieces - 1) > _SIGNIFICANT:
        return NONE
    return centres, relative


def level_from_differences(differences: np.ndarray) -> float:
    """The standard deviation of normal noise with such differences, from their median.

    The median ignores outliers and oscillations at the beginning of a rest.
    """
    return float(np.median(np.abs(differences)) / (_NORMAL_MEDIAN * np.sqrt(2)))
