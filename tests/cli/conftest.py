"""What the tests of this folder share."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import fracjax._diagnose
import fracjax._fit
from fracjax._blocks import FOH
from fracjax._fit import Fit
from fracjax._io import read, write_text
from fracjax._operators import Grid
from tests.cli.helpers import STEP, diagnosis_of
from tests.remedies import remedies_work as remedies_work
from tests.remedies import watch

watch()


@pytest.fixture(scope="session")
def loop(tmp_path_factory) -> str:
    """FOH's response over four periods, with noise, in a file."""
    drive = 50 - 45 * np.cos(2 * np.pi * STEP * np.arange(400))
    with jax.enable_x64(True):
        response = np.asarray(FOH(0.05, 0.05)(jax.numpy.asarray(drive), Grid(STEP)))
    path = tmp_path_factory.mktemp("cli") / "loop.csv"
    columns = {"time_s": STEP * np.arange(400), "voltage_V": drive}
    noise = np.random.default_rng(1).normal(0, 0.01, drive.size)
    write_text(path, {**columns, "displacement_um": response + noise})
    return str(path)


@pytest.fixture(scope="session")
def fitted(loop) -> Fit:
    """A real fit, quick: the fractional integral alone."""
    return fracjax._fit.fit(fracjax.parse_model("creep"), read(loop), starts=1)


@pytest.fixture
def quick(monkeypatch, fitted):
    """Fits and diagnoses that take no time, and what they were called with."""
    calls: list[dict] = []

    def fit(model, recordings, *, progress, **options):
        progress("fitting")
        calls.append({"model": model, "recordings": recordings, **options})
        scores = replace(fitted.scores, bic=float(len(calls)))
        return replace(fitted, model=replace(fitted.model, name=model.name), scores=scores)

    def diagnose(model, recordings, *, progress, **options):
        progress("diagnosing")
        calls.append({"model": model, "recordings": recordings, **options})
        return diagnosis_of(fitted)

    monkeypatch.setattr(fracjax._fit, "fit", fit)
    monkeypatch.setattr(fracjax._diagnose, "diagnose", diagnose)
    return calls


@pytest.fixture(autouse=True)
def _somewhere_empty(empty_folder):
    """Every test writes into a folder of its own."""
