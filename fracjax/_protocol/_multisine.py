r"""A random-phase multisine of odd lines, with detection lines between them.

    u(t) = A Σ_k k^-s cos(2π k f0 t + φ_k),   k odd, φ_k uniform

Of every four odd lines one, drawn at random, stays empty: what the response has there is odd
distortion, what it has at even lines even distortion, and the scatter between periods is noise.
The line beside it is the best linear approximation.

Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012), chapter 4.
"""

from __future__ import annotations

import numpy as np

GROUP = 4
"""Odd lines of which one is a detection line."""
SETTLING, MEASURED = 1, 2
"""Periods until transients have faded, and those that are measured."""


def excited_lines(highest: int, rng: np.random.Generator) -> np.ndarray:
    """The excited lines (K,) up to the `highest`: odd ones without one of every `GROUP`."""
    odd = np.arange(1, highest + 1, 2)
    whole = odd[: odd.size // GROUP * GROUP].reshape(-1, GROUP)
    kept = np.ones(whole.shape, dtype=bool)
    kept[np.arange(len(whole)), rng.integers(GROUP, size=len(whole))] = False
    return np.concatenate([whole[kept], odd[whole.size :]])


def multisine(samples: int, highest: int, tilt: float) -> np.ndarray:
    """One period (N,) of lines up to the `highest`, whose amplitudes fall as k^-`tilt`, at most 1
    in size; it begins near zero."""
    rng = np.random.default_rng(0)
    lines = excited_lines(highest, rng)
    spectrum = np.zeros(samples // 2 + 1, dtype=complex)
    spectrum[lines] = 1.0 * lines**-tilt * np.exp(2j * np.pi * rng.uniform(size=lines.size))
    wave = np.fft.irfft(spectrum, samples)
    wave /= np.abs(wave).max()
    return np.roll(wave, -int(np.argmin(np.abs(wave))))
