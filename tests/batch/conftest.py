"""What the tests of this folder share."""

from pathlib import Path

import pytest

import fracjax as fj
from tests.batch.helpers import fit_by, recording, save


@pytest.fixture(scope="session")
def fitted() -> fj.Fit:
    return fj.fit(fj.parse_model("creep"), recording(0), starts=2)


@pytest.fixture
def quick(monkeypatch, fitted) -> list[dict]:
    """Fits that take no time, and what they were called with."""
    calls: list[dict] = []

    def fit(model, recording, **options):
        calls.append({"model": model, "source": recording.source, **options})
        return fitted

    fit_by(monkeypatch, fit)
    return calls


@pytest.fixture
def data() -> Path:
    for k in range(7):
        save(Path(f"data/{k}.csv"), k)
    return Path("data")


@pytest.fixture(autouse=True)
def _somewhere_empty(empty_folder):
    """Every test writes into a folder of its own."""
