"""Recordings, a batch of them, and fits that take no time."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import fracjax as fj
from fracjax._batch import _rows
from fracjax._fit import Outcome
from fracjax._io import write_text
from fracjax._parameters import replace_parameters

STEP = 0.01
OUT = Path("results")


def signals(seed: int, samples: int = 250) -> tuple[np.ndarray, np.ndarray]:
    """A drive [V] that does not repeat, and a response [um] that lags behind it, with noise."""
    times = STEP * np.arange(samples)
    drive = 40 + 15 * np.sin(3.1 * times) + 10 * np.sin(8.3 * times + seed)
    noise = np.random.default_rng(seed).normal(0, 0.02, samples)
    return drive, 0.1 * drive - 2e-3 * np.gradient(drive, STEP) + noise


def recording(seed: int, samples: int = 250, source: str = "recording") -> fj.Recording:
    return fj.Recording(*signals(seed, samples), STEP, "V", "um", source=source)


def save(path: Path, seed: int, samples: int = 250) -> Path:
    drive, response = signals(seed, samples)
    columns = {"time_s": STEP * np.arange(samples), "voltage_V": drive}
    path.parent.mkdir(exist_ok=True)
    write_text(path, columns | {"displacement_um": response})
    return path


def fit_by(monkeypatch, fit: Callable[..., fj.Fit]) -> None:
    """Let a batch fit by this function, recordings that would be fitted together too."""

    def fit_all(models, recordings, **options):
        pairs = zip(models, recordings, strict=True)
        return [Outcome(fit(model, recording, **options)) for model, recording in pairs]

    monkeypatch.setattr(_rows, "fit", fit)
    monkeypatch.setattr(_rows, "fit_all", fit_all)


def batch(recordings, **options) -> pd.DataFrame:
    return fj.fit_batch("creep", recordings, **{"out": OUT, "starts": 2} | options)


def told(recordings, **options) -> list[dict[str, Any]]:
    """The rows of a batch, one by one."""
    return [
        {str(k): v for k, v in row.items()}
        for row in batch(recordings, **options).to_dict("records")
    ]


def cheap_model() -> fj.Model:
    """Creep of a known order, which is quick to compile."""
    order = fj.Parameter(0.0072, fixed=True)
    return fj.Model(replace_parameters(fj.blocks.Creep(), {"mu": order}))
