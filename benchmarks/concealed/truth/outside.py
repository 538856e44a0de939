"""Truths outside the catalogue: what a diagnosis must leave without a name."""

from __future__ import annotations

import numpy as np

from ..drives import Array, Signal


def jumps(t: Array, y: Array, size: float, times: list[float], heights: list[float]) -> Array:
    """Depoling events: y + size * sum_i height_i (t > time_i); size in um, times in s."""
    return y + size * sum(c * (t >= s) for c, s in zip(heights, times, strict=True))


def chirped_tone(
    t: Array, y: Array, size: float, start: float, sweep: float, phase: float
) -> Array:
    """y + size sin(2 pi (f + sweep t/2) t + phase): a tone that glides; f in Hz, sweep in Hz/s."""
    return y + size * np.sin(2 * np.pi * (start + 0.5 * sweep * t) * t + phase)


def beating_tone(
    t: Array, y: Array, size: float, frequency: float, gap: float, phase: float
) -> Array:
    """y + size (sin 2 pi f t + sin(2 pi (f + gap) t + phase)): two machines nearby; Hz, um."""
    first = np.sin(2 * np.pi * frequency * t)
    return y + size * (first + np.sin(2 * np.pi * (frequency + gap) * t + phase))


def kinked_input(
    drive: Signal, t: Array, size: float, at: list[float], turns: list[float]
) -> Array:
    """u + size * sum_i turn_i |u - at_i|: straight pieces that meet at the voltages `at`."""
    v = drive(t)
    return v + size * sum(c * np.abs(v - x) for c, x in zip(turns, at, strict=True))


def encoder_ripple(t: Array, y: Array, size: float, pitch: float, phase: float) -> Array:
    """y + size sin(2 pi y/pitch + phase): an interpolating encoder's error; um."""
    return y + size * np.sin(2 * np.pi * y / pitch + phase)
