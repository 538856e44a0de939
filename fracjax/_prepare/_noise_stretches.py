"""The noise of stretches of samples that hold nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from ._autoregression import Autoregression, autoregression, removed_power
from ._noise import NONE, Method, Noise, Whitened, level_from_differences, white_noise
from ._tone import Tone

PIECES = 12
"""Pieces of a recording in which the level of the noise is followed.  Chosen by judgement."""
_SHORTEST_PIECE = 40
"""Fewest samples of a piece.  Chosen by judgement."""
_SIGNIFICANT = 1e-4
"""p-value below which the level of the noise counts as varying.  Chosen by judgement."""
_LOUDER = 1.2
"""A stretch this many times as loud as the later ones still holds what has not settled.  Chosen by
judgement."""
_LOUD = 4.0
"""A stretch this many times as loud as the quietest quarter holds an event, which is in three
successive differences of periods.  Noise whose level varies by this much within a recording is
rare.  Chosen by judgement."""
_PARTS, _FEWEST_PARTS = 8, 2
"""Parts of a stretch by which its beginning is judged, and how many of them remain at least."""
_MOST_TONES = 8
"""Most tones that are taken out of noise.  Chosen by judgement."""
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
        tones: the number of tones among the terms.
    """

    samples: np.ndarray
    start: int
    terms: np.ndarray
    tones: int = 0

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

    @classmethod
    def settled(cls, samples: np.ndarray, start: int) -> Stretch:
        """A stretch without its slow relaxation, and without its beginning (n,) where that is
        louder than the rest: a ringing, or a course that the relaxation does not follow.
        """
        length = samples.size // _PARTS
        whole = cls.without_relaxation(samples, start)
        parts = whole.samples[: length * _PARTS].reshape(_PARTS, length)
        first = min(first_settled(list(parts)), _PARTS - _FEWEST_PARTS) * length
        return cls.without_relaxation(samples[first:], start + first) if first else whole

    @property
    def removed(self) -> int:
        """The number of degrees of freedom that the terms have removed."""
        return self.terms.shape[1]

    def without_tone(self, tone: Tone) -> Stretch:
        """The stretch minus a tone of any amplitude and phase."""
        phases = 2 * np.pi * tone.frequency * np.arange(self.samples.size)
        pair = np.stack([np.cos(phases), np.sin(phases)], axis=1)
        terms = np.linalg.qr(np.concatenate([self.terms, pair], axis=1))[0]
        samples = self.samples - terms @ (terms.T @ self.samples)
        return Stretch(samples, self.start, terms, self.tones + 1)


def first_settled(parts: Sequence[np.ndarray]) -> int:
    """The index of the first of successive parts (n,) that is not louder than the later ones.

    Noise is everywhere, and what decays from a start is not: a first cycle, a ringing, a creep.
    """
    levels = np.array([np.sqrt(np.mean(part**2)) for part in parts])
    # The level of n samples is known to one part in √(2n).
    largest = max(_LOUDER, 1 + 4 / np.sqrt(2 * parts[0].size))
    settled = (
        k for k in range(len(levels) - 1) if levels[k] <= largest * np.median(levels[k + 1 :])
    )
    return next(settled, len(levels) - 1)


def without_events(stretches: list[Stretch]) -> list[Stretch]:
    """The stretches that are not far louder than others: an event is in some, noise is in all."""
    levels = np.array([np.sqrt(np.mean(s.samples**2)) for s in stretches])
    loudest = _LOUD * np.percentile(levels, 25, method="lower")
    return [s for s, level in zip(stretches, levels, strict=True) if level <= loudest]


def noise_in(
    stretches: list[Stretch],
    unit: str,
    method: Method,
    shared: float = 1.0,
    *,
    resolution: float = np.inf,
    least: float = 0.0,
) -> Noise:
    """The noise of stretches that hold nothing else than noise and tones.

    `shared` says how many of their samples hold the same noise.  The level is followed along the
    recording if it exceeds the response's `resolution` [unit]: a noise below a converter's step is
    hidden while the response stays on one code, and visible next to a change of code.  Stretches
    that show less than `least` [unit] are taken as white noise of that level.

    A tone is deterministic and no noise: each that is significant is taken out, and the strongest
    is reported.
    """

    def with_tones(stretches: Sequence[Stretch]) -> Noise:
        colour = autoregression([s.samples for s in stretches], [s.terms for s in stretches])
        return noise_of(stretches, colour, unit, method, shared, resolution=resolution, least=least)

    noise = with_tones(stretches)
    if noise.tone is None:
        return noise
    strongest = noise.tone
    for _ in range(_MOST_TONES):
        if noise.tone is None:
            break
        stretches = [s.without_tone(noise.tone) for s in stretches]
        noise = with_tones(stretches)
    return replace(noise, removed_tone=strongest)


def noise_of(
    stretches: Sequence[Stretch],
    colour: Autoregression,
    unit: str,
    method: Method,
    shared: float = 1.0,
    *,
    resolution: float = np.inf,
    least: float = 0.0,
) -> Noise:
    """The noise of stretches whose autoregression is known, with the tones in them; as `noise_in`
    elsewhere."""
    if np.sqrt(np.mean(np.concatenate([s.samples for s in stretches]) ** 2)) <= least:
        samples = sum(s.samples.size for s in stretches)
        return replace(white_noise(least, unit, method), effective=samples / shared, shared=shared)
    coefficients, innovation = colour
    squares = sum(np.sum(s.samples**2) + removed_power(colour, s.terms) for s in stretches)
    sigma = float(np.sqrt(squares / sum(s.samples.size for s in stretches)))
    taps = coefficients / innovation
    series = [s.samples * np.sqrt(s.samples.size / (s.samples.size - s.removed)) for s in stretches]
    skipped = taps.size - 1
    whitened = [np.convolve(s, taps, "valid") for s in series]
    starts = [s.start + skipped for s in stretches]
    profile = _level_profile(whitened, starts, shared) if resolution < sigma else NONE
    if profile[0].size:
        whitened = [
            w / np.interp(start + np.arange(w.size), *profile)
            for w, start in zip(whitened, starts, strict=True)
        ]
    # The fitted terms have removed the slowest lines.
    slow = tuple(1 + (s.removed - 2 * s.tones + 1) // 2 for s in stretches)
    return Noise(
        sigma,
        unit,
        method,
        coefficients,
        innovation,
        effective=sum(w.size for w in whitened) / shared,
        shared=shared,
        course=profile,
        whitened=Whitened(tuple(whitened), slow, taps, sigma, shared),
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
    if chdtrc(pieces - 1, np.sum((relative**2 - 1) ** 2) / variance) > _SIGNIFICANT:
        return NONE
    return centres, relative


def level_without_motion(signal: np.ndarray, used: np.ndarray) -> Any:
    """The standard deviation (…) of the white noise in signals (…, N), from second differences.

    A smooth motion has small second differences, and noise has large ones: √6 times its level.
    Only differences of successive samples that are `used` (…, N) count.
    """
    whole = used[..., 2:] & used[..., 1:-1] & used[..., :-2]
    bends = np.where(whole, np.diff(signal, 2), np.nan)
    return np.nan_to_num(level_from_differences(bends) / np.sqrt(3))  # 0 where none counts
