"""Diagnoses that ask which dynamics recordings show, whatever their law of hysteresis."""

import json

import numpy as np
import pytest
from scipy.signal import lsim

import fracjax as fj
from fracjax._diagnose._views import path_view
from fracjax._prepare import prepare
from fracjax._recording import Recording
from tests.diagnose.helpers import white
from tests.path.helpers import plays, through, twin_rates

STEP, SIGMA = 1e-3, 1e-3
TWINS = twin_rates()


def recorded(drive: np.ndarray, response: np.ndarray, seed: int = 0, **names) -> Recording:
    noise = SIGMA * np.random.default_rng(seed).standard_normal(drive.size)
    return Recording(drive, response + noise, STEP, "V", "um", **names)


@pytest.fixture(scope="module")
def lagging():
    """Plays of curved envelope, behind a lag of 3 ms, without a model."""
    law = plays(TWINS)
    times = STEP * np.arange(TWINS.size)
    response = law[0] + lsim(([1.0], [0.003, 1.0]), law - law[0], times, interp=True)[1]
    return fj.diagnose(None, recorded(TWINS, response), noise=SIGMA, max_time=30)


def test_without_a_model_the_dynamics_have_a_name(lagging):
    (effect,) = lagging.effects
    assert {effect.name, *effect.confusable_with} & {"sensor_lag", "drive_lag", "delay"}
    assert lagging.sentence.startswith("Whatever law of hysteresis the actuator has")
    assert lagging.base.model.name == "prandtl_ishlinskii"


def test_what_the_drive_can_show_is_written(lagging, tmp_path):
    lagging.save(tmp_path / "diagnosis.json")
    shown = json.loads((tmp_path / "diagnosis.json").read_text())["can_show"]
    assert shown == [vars(entry) for entry in lagging.can_show]
    sizes = {entry["effect"]: entry["size"] for entry in shown}
    assert 0 < sizes["mains_interference"] < sizes["creep"] < 0.2


def test_a_steady_recording_is_read_beside_one_that_is_not():
    """The columns of the two once had different numbers."""
    phase = 2 * np.pi * np.arange(1500) / 300
    steady = recorded(0.5 - 0.5 * np.cos(phase), plays(0.5 - 0.5 * np.cos(phase)))
    drive = through([0.0, 0.0, 1.0, 0.0, 0.0], [300, 200, 200, 300])
    resting = recorded(drive, plays(drive), seed=1)
    diagnosis = fj.diagnose(None, [steady, resting], noise=SIGMA, max_time=20)
    assert diagnosis.effects == ()
    assert [take.recording for take in diagnosis.base.preparation.takes] == [steady, resting]


def test_a_reading_a_minute_of_a_loop_that_is_stepped_is_diagnosed():
    """Of a magnet's sixty readings curves had taken up all noise, and a mode lay below the least
    frequency."""
    steps = [*np.linspace(0, 1, 11), *np.linspace(0.9, 0, 10), *np.linspace(0.05, 1, 20)]
    drive = np.array([*steps, *np.linspace(0.95, 0, 20)])
    response = plays(drive) + 1e-4 * np.random.default_rng(0).standard_normal(drive.size)
    diagnosis = fj.diagnose(None, fj.Recording(drive, response, 60.0, "A", "T"), max_time=30)
    assert diagnosis.effects == ()


def test_recordings_share_the_states_of_their_path():
    fast, slow = (through([0.0, 1.0, 0.0, 1.0, 0.0], [n] * 4) for n in (100, 300))
    recordings = [recorded(u, plays(u), seed=k) for k, u in enumerate((fast, slow))]
    both = path_view(prepare(recordings, noise=white(SIGMA)))[0]
    alone = [path_view(prepare([r], noise=white(SIGMA)))[0] for r in recordings]
    assert both.curves.branches < sum(view.curves.branches for view in alone)
    assert both.posterior.best.names == ()
    assert np.std(both.residual) < 1.1 * SIGMA
