"""What the stage is driven with: the record that identifies it, a second one, and three motions.

Everything starts at rest at 0 V, where the sensor is zeroed, so that no memory is unknown.
"""

from __future__ import annotations

import numpy as np

from benchmarks.compensation.stage import STEP

FULL = 98.0  # V
PERIOD, REPEATS = 3.0, 3  # s, 1
APPROACH = 1.5  # s
SWINGS = (2.0, 8.0)  # s, the record's part at 1 Hz, its first rise left out


def record() -> np.ndarray:
    """The identifying drive (N,): amplitudes, biases, rates, holds for creep, rests for noise."""
    return np.concatenate(
        [
            _held(1, 0),
            _swings(2, 1.0, 0, FULL),
            _falling(5, 1.0, 0, FULL, 0.15),
            _ramp(1, 0, 50),
            _held(2, 50),
            _swings(1, 2.0, 50, FULL),
            _ramp(0.5, 50, FULL),
            _held(1, FULL),
            _falling(4, 1.0, FULL, 0, 0.2),
            _ramp(0.5, FULL, 0),
            _swings(0.5, 4.0, 0, FULL),
            _swings(4, 0.25, 0, 90),
            _held(1.5, 0),
        ]
    )


def second_record() -> np.ndarray:
    """A drive (N,) that no fit sees: other amplitudes, rates and corners."""
    return np.concatenate(
        [
            _held(0.5, 0),
            _ramp(0.7, 0, 85),
            _ramp(0.4, 85, 25),
            _swings(2, 1.5, 25, 70),
            _held(1, 25),
            _ramp(0.5, 25, 92),
            _falling(4, 0.75, 92, 10, 0.4),
            _ramp(0.5, 92, 5),
        ]
    )


def motions(low: float, high: float) -> dict[str, np.ndarray]:
    """Desired motions (N,) [um]: from zero to `low`, then between two ends, repeated."""
    t = _times(PERIOD)
    tent = 1 - np.abs(1 - 2 * (t % 1))
    shapes = {
        "sine 1 Hz": (1 - np.cos(2 * np.pi * t)) / 2,
        "falling sine": (1 - np.cos(2 * np.pi * t)) / 2 * (1 - t / 4),
        "triangle and trapezoid": np.where(t < 1, tent, np.clip(1.5 * tent, 0, 1) * 0.6),
    }
    approach = _swings(2 * APPROACH, 0.5 / APPROACH, 0, low)[: round(APPROACH / STEP)]
    return {
        name: np.concatenate([approach, np.tile(low + (high - low) * shape, REPEATS)])
        for name, shape in shapes.items()
    }


def steady(values: np.ndarray) -> np.ndarray:
    """The last repeat (M,) of a motion or of what belongs to it (N,)."""
    return values[-round(PERIOD / STEP) :]


def _times(seconds: float) -> np.ndarray:
    return STEP * np.arange(round(seconds / STEP))


def _held(seconds: float, level: float) -> np.ndarray:
    return np.full(round(seconds / STEP), float(level))


def _ramp(seconds: float, start: float, end: float) -> np.ndarray:
    return start + (end - start) * _times(seconds) / seconds


def _swings(seconds: float, rate: float, start: float, end: float) -> np.ndarray:
    return _falling(seconds, rate, start, end, 1.0)


def _falling(seconds: float, rate: float, start: float, end: float, last: float) -> np.ndarray:
    """Swings at a rate [Hz] from `start`, whose height falls linearly to a share of the first."""
    t = _times(seconds)
    height = 1 - (1 - last) * t / seconds
    return start + (end - start) * height * (1 - np.cos(2 * np.pi * rate * t)) / 2
