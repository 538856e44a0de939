"""Compensation of a stage that shares nothing with the models."""

from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from benchmarks.compensation import run as run_bench
from benchmarks.compensation import signals, stage


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
