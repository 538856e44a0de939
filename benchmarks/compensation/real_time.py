"""The inverse in a loop: motions that are not known ahead, three stages, six controllers.

    python -m benchmarks.compensation.real_time --out benchmarks/compensation

Each stage (`stage.py`) has another law of hysteresis, none of them fracjax's, before the same creep,
mode and sensor.  A model is fitted to one record of it; `--identify` fits anew, else the fits kept
in fits/ are used.  The loop runs at 2 kHz.

real_time.csv: rms and largest error of the sensor's reading in shares of the motion's stroke, its
first quarter left out.  `offline` is `compensate` with the whole motion known; `linear part` an
inverse of gain, creep, lag and mode without hysteresis; `plays` of hysteresis without them; `PI`
feedback alone, as fast as its gain margin of 6 dB allows; `inverse + PI` both.

adaptive.csv: a stage whose gain falls by 8 % and whose zero moves, as when it warms under load: the
inverse as it was fitted beside the one whose gains follow.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

import fracjax as fj
from benchmarks.compensation.stage import NOISE, Duhem, Relays, Stage, Stops, measure, rested
from benchmarks.versions import versions
from fracjax import blocks

STEP = 5e-4  # s
LOW, HIGH = -20.0, 120.0  # V, as such stacks bear
LAWS = {"stops": Stops, "relays": Relays, "Duhem": Duhem}
SLOW = 18.0  # Hz, a tenth of the mode
_LOOP = 0.5, 60.0  # of PI: the proportional gain, and the integral's rate [1/s]


def times(seconds: float) -> np.ndarray:
    return STEP * np.arange(round(seconds / STEP))


def record() -> np.ndarray:
    """The identifying drive (N,): swings of several heights and rates, holds, and a chirp."""
    t = times(3.0)
    falling = 49 * (1 - np.cos(2 * np.pi * 2 * t) * (1 - t / 3.2))
    slow = 49 * (1 - np.cos(2 * np.pi * times(2.0)))
    held = np.concatenate([np.linspace(falling[-1], 60, 400), np.full(1600, 60.0)])
    chirp = 60 + 8 * np.sin(2 * np.pi * (1 + 35 * times(2.0)) * times(2.0))
    inner = 45 + 25 * np.sin(2 * np.pi * 3 * times(1.0)) + 12 * np.sin(2 * np.pi * 11 * times(1.0))
    back = np.linspace(45, 0, 1000)
    ramp = np.linspace(chirp[-1], 45, 200)
    return np.concatenate(
        [np.zeros(400), slow, falling, held, chirp, ramp, inner, back, np.zeros(1000)]
    )


def motions() -> dict[str, np.ndarray]:
    """Shapes (N,) between 0 and 1 of motions."""
    t = times(2.0)
    walk = np.cumsum(np.random.default_rng(5).standard_normal(t.size))
    walk = lfilter(*butter(3, SLOW, fs=1 / STEP), walk - walk[0])
    shapes = {
        f"sine {rate:g} Hz": (1 - np.cos(2 * np.pi * rate * t)) / 2
        for rate in (1, 3, 10, SLOW, 50, 100)
    }
    shapes["falling sine 5 Hz"] = (1 - np.cos(2 * np.pi * 5 * t) * (1 - t / 2.5)) / 2
    shapes["triangle 5 Hz"] = 1 - np.abs(1 - 2 * (5 * t % 1))
    shapes["random walk"] = (walk - walk.min()) / np.ptp(walk)
    return shapes


def structure(recording: fj.Recording) -> fj.Model:
    """Lag, plays of a curve, the sensor's curve, creep, and a mode."""
    low, high = float(recording.drive.min()), float(recording.drive.max())
    span = float(np.ptp(recording.response))
    weights = span / (high - low) * np.append(0.6, np.full(12, 0.03))
    block = (
        blocks.DriveLag(1e-3)
        >> blocks.PrandtlIshlinskii(weights, low=low, high=high)
        >> blocks.SensorNonlinearity(centre=span / 2, span=span)
        >> blocks.LogarithmicCreep(0.01, 0.01)
        >> blocks.Resonance(200.0, 0.05)
    )
    return fj.Model(block, "drive_lag >> prandtl_ishlinskii >> curve >> creep >> resonance")
