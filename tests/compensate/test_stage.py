"""Compensation of a stage that shares nothing with the models."""

import json
from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from benchmarks.compensation import real_time, signals, stage
from benchmarks.compensation import run as run_bench


def test_the_stage_has_the_hysteresis_it_is_said_to_have():
    """19.5 % of the height at full swing, in its reading, and less of it in a smaller loop."""
    times = stage.STEP * np.arange(250)
    shares = []
    for half in (50.0, 7.0):
        swings = np.tile(50 - half * np.cos(2 * np.pi * times), 3)
        drive = np.concatenate([np.linspace(0, 98, 100), np.linspace(98, 50 - half, 100), swings])
        loop = stage.measure(drive, seed=0)[-250:]
        shares.append(np.abs(loop[1:125] - loop[126:][::-1]).max() / np.ptp(loop))
    assert shares[0] == pytest.approx(0.195, abs=2e-3)
    assert shares[1] < 0.7 * shares[0]


@pytest.mark.slow
@pytest.mark.parametrize(("drive", "most"), [("foh", 0.02), ("foh, extended", 0.006)])
def test_a_stage_that_shares_nothing_with_the_models_is_tracked(drive, most):
    """Check 1 on the sine: the largest steady error over the stroke, the zero set."""
    used = {one.name: one for one in run_bench.identified(Path(run_bench.__file__).parent / "fits")}
    one = used[drive]
    desired = signals.motions(2.2, 7.3)["sine 1 Hz"][: -round(signals.PERIOD / stage.STEP)]
    motion = fj.Trajectory(desired, stage.STEP)
    found = fj.compensate(one.model, motion, history=one.history, offset=one.offset)
    error = signals.steady(stage.measure(found.drive, seed=2) - desired)
    assert np.abs(error - error.mean()).max() < most * np.ptp(signals.steady(desired))


@pytest.mark.slow
@pytest.mark.parametrize(("law", "low", "high"), [("stops", 1.3, 7.1), ("relays", 1.8, 10.3)])
def test_a_motion_that_is_not_known_ahead_is_tracked_in_a_loop(law, low, high):
    """At 10 Hz and 2 kHz: below .6 % of the stroke, where no hysteresis would leave 12 %."""
    fit = Path(real_time.__file__).parent / "fits" / f"real-time-{law}.json"
    offset = json.loads(fit.read_text(encoding="utf-8"))["offsets"][0]
    inverse = real_time.stream(fj.load_model(fit), offset)
    shape = real_time.motions()["sine 10 Hz"][:2000]
    desired = np.concatenate([np.linspace(0, low, 1000), low + (high - low) * shape])
    drive = inverse.run(desired, inverse.start(0.0)).output
    read = stage.measure(drive, 2, 0.0, real_time.LAWS[law], real_time.STEP)
    error = (read - desired)[1500:]
    assert np.sqrt(np.mean(error**2)) < 6e-3 * (high - low)
