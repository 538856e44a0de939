"""Steps in time of the response, and what is not one."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fracjax as fj
from fracjax._diagnose._jumps import jumps_of
from fracjax._path import Prior
from tests.diagnose.helpers import TIMES, creeping

SAMPLES = 1500


def view_of(error: np.ndarray) -> Any:
    """A view of a fit with an offset and a trend, under white noise of unit sd."""
    counted = np.arange(SAMPLES) >= 100
    tangent = counted[:, None] * np.column_stack([np.ones(SAMPLES), np.arange(SAMPLES)])
    fitted = SimpleNamespace(
        whitened=lambda signals: (signals.T * counted).T,
        error=error,
        counted=counted,
        problems=[SimpleNamespace(response=error)],
    )
    prior = Prior(1e3 * tangent, lambda signals: signals, 0.0)
    law = SimpleNamespace(count=int(counted.sum()) - 2)
    return SimpleNamespace(fitted=fitted, prior=prior, law=law)


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SAMPLES)


def test_jumps_are_found_at_their_samples_with_their_sizes():
    ramp = np.arange(SAMPLES)
    error = noise(3) + 3.0 * (ramp >= 431) - 2.0 * (ramp >= 902) + 0.01 * ramp
    jumps = jumps_of(view_of(error))
    assert np.abs(np.subtract(jumps.samples, (431, 902))).max() <= 3
    np.testing.assert_allclose(jumps.sizes, (3.0, -2.0), atol=0.5)
    assert jumps.excess == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("seed", range(8))
def test_noise_does_not_jump(seed):
    assert jumps_of(view_of(noise(seed)))[:3] == ((), (), 0.0)


@pytest.mark.slow
def test_a_jump_is_told_and_no_drift_is_named():
    generator = np.random.default_rng(1)
    steps = 0.03 * (TIMES >= 4.4) + 0.02 * (TIMES >= 9.1)
    diagnosis = fj.diagnose("creep", creeping(steps + 0.01 * generator.standard_normal(TIMES.size)))
    assert (diagnosis.verdict, diagnosis.effects) == ("unexplained", ())
    jumps = re.findall(r"by ([\d.]+) µm at ([\d.]+) s", diagnosis.sentence)
    np.testing.assert_allclose(np.array(jumps, float), [(0.03, 4.4), (0.02, 9.1)], atol=0.01)
