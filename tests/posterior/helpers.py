"""Models with known posteriors, and fits of them."""

import json
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import fracjax as fj
from fracjax._posterior import Logarithmic, Normal, Row
from tests.helpers import specified

STEP = 4e-3
SAMPLES = 240
TIMES = STEP * np.arange(SAMPLES)
DRIVE = 40 + 15 * np.sin(2 * np.pi * 2.3 * TIMES) + 9 * np.sin(2 * np.pi * 9.1 * TIMES + 1)


class Cubic(fj.AbstractBlock):
    """Two gains, y = a u + b u³: a linear model, whose posterior is known."""

    a: fj.Parameter
    b: fj.Parameter

    def __init__(self):
        self.a = fj.Parameter(0.1, "response/drive", gain=True)
        self.b = fj.Parameter(0.0, "response/drive^3", gain=True)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return self.a.value * drive + self.b.value * drive**3


def recording_of(block: fj.AbstractBlock, sigma: float, seed: int = 0) -> fj.Recording:
    clean = np.asarray(block(jnp.asarray(DRIVE), fj.Grid(STEP)))
    noise = np.random.default_rng(seed).standard_normal(SAMPLES)
    return fj.Recording(DRIVE, clean + 2.0 + sigma * noise, STEP, "V", "um")


def fit_of(block: fj.AbstractBlock, recording: fj.Recording, sigma: float) -> fj.Fit:
    model = fj.Model(block, "law")
    return fj.fit(model, recording, noise=specified(sigma), history="constant", starts=1)


def by_name(posterior: fj.Posterior) -> dict[str, Row]:
    return {row.name: row for row in posterior.rows}


SHARP = {"noise.sigma": Logarithmic(Normal(np.log(0.05), 1e-9))}


def diagnosis_file(folder: Path, **fields) -> Path:
    told = {"schema": "fracjax.diagnosis/1", "model": "law", "verdict": "none", "effects": []}
    path = folder / "diagnosis.json"
    path.write_text(json.dumps(told | fields), encoding="utf-8")
    return path
