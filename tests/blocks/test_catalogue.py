"""Every entry of the catalogue: trials, insertion, and no size, no effect."""

from itertools import pairwise
from typing import get_args

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS, Setting
from fracjax._blocks._effect import Site
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare import prepare
from tests.blocks.helpers import DRIVE, STEP, foh
from tests.helpers import close, respond

SETTINGS = {
    "common": Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 10.0, 3e3, 2e3, 0.0, 1e-3),
    "bipolar, fast": Setting(-150.0, 30.0, 0.2, 2e-5, 0.01, 5e2, 3e5, 1e5, -0.15, 0.0),
    "slow": Setting(40.0, 85.0, 1500.0, 0.5, 3600.0, 0.01, 2.0, 0.3, -3.0, 0.5),
}
FITTING = Setting(
    float(DRIVE.min()), float(DRIVE.max()), 5.0, STEP, 0.74, 5.0,
    float(np.abs(np.diff(DRIVE)).max() / STEP), 200.0, 0.0, 0.05,
)  # fmt: skip
# The values at which an effect does nothing; extreme where no amplitude can be zero.
NOTHING = {
    "creep": {"gamma": 0.0},
    "drive_lag": {"time_constant": 1e-14},
    "delay": {"delay": 0.0},
    "resonance": {"frequency": 1e11},
    "electrostriction": {"q": 0.0},
    "minor_loop_memory": {"weights": np.zeros(12)},
    "saturation": {"threshold": 85.0},
    "thermal_drift": {"amplitude": 0.0, "slope": 0.0},
    "mains_interference": {"cosines": np.zeros(5), "sines": np.zeros(5)},
    "coulomb_friction": {"amplitude": 0.0},
    "lost_contact": {"share": 0.0, "compliance": 0.0},
    "slew_rate_limit": {"rate": 1e9},
    "gain_drift": {"gain": 0.0},
    "degradation": {"gain": 0.0},
    "viscoelastic_layer": {"strength": 0.0},
    "clock_skew": {"skew": 0.0},
    "quantisation": {"share": 0.0},
    "sensor_lag": {"corner": 1e14},
    "second_mode": {"frequency": 1e11},
    "cubic_nonlinearity": {"q_3": 0.0},
    "amplitude_dependence": {"alpha": 0.0},
    "backlash": {"weight": 0.0},
    "sensor_nonlinearity": {"s_2": 0.0, "s_3": 0.0},
}
each_effect = pytest.mark.parametrize("name", EFFECTS)


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@each_effect
def test_trials_of_one_law_have_one_structure_and_lie_within_bounds(name, setting):
    trials = EFFECTS[name].trials(setting)
    assert len(trials) >= 1
    laws = {type(trial) for trial in trials}
    assert len({jax.tree_util.tree_structure(trial) for trial in trials}) == len(laws)
    shapes = {tuple(np.shape(x) for x in jax.tree_util.tree_leaves(trial)) for trial in trials}
    assert len(shapes) <= len(laws)
    for trial in trials:
        for parameter in named_parameters(trial).values():
            assert np.all(parameter.lower <= parameter.value)
            assert np.all(parameter.value <= parameter.upper)
            low, high = parameter.plausible
            assert np.all(low <= high)


def test_trials_of_a_resonance_at_500_khz():
    EFFECTS["resonance"].trials(Setting(0.0, 100.0, 10.0, 2e-6, 0.01, 5e3, 2e6, 1e6, 0.0, 0.0))


@each_effect
def test_trials_differ_and_change_the_base(name):
    effect, grid = EFFECTS[name], Grid(STEP, "constant")
    plain = np.asarray(respond(foh, DRIVE, grid))
    changed = [
        np.asarray(respond(effect.insert(foh, trial), DRIVE, grid))
        for trial in effect.trials(FITTING)
    ]
    # A load that is held down well is not thrown.
    changed = [c for c in changed if name != "lost_contact" or np.abs(c - plain).max() > 1e-9]
    assert len(changed) > 10 or name != "lost_contact"
    assert all(np.abs(response - plain).max() > 1e-9 for response in changed)
    assert all(np.abs(one - other).max() > 0 for one, other in pairwise(changed))


@each_effect
def test_an_effect_of_no_size_leaves_the_base_alone(name):
    effect, grid = EFFECTS[name], Grid(STEP, "constant")
    trial = effect.trials(FITTING)[0]
    inserted = effect.insert(foh, set_values(trial, NOTHING[name]))
    drive = DRIVE.at[-1].set(85.0)
    close(respond(inserted, drive, grid), respond(foh, drive, grid), 1e-9)


def test_the_null_of_every_effect_is_known():
    assert NOTHING.keys() == EFFECTS.keys()


@each_effect
def test_an_entry_says_what_it_is(name):
    effect = EFFECTS[name]
    assert effect.name == name
    assert effect.site in get_args(Site)
    for text in (effect.sentence, effect.equation, effect.source, effect.concealed_by):
        assert text.strip() == text
        assert len(text) > 5
    assert effect.separated_by.keys() <= EFFECTS.keys() - {name}
    assert effect.separated_by
    assert all(len(experiment) > 10 for experiment in effect.separated_by.values())
    assert effect.axes
    places = {"time", "frequency", "level", "rate", "reversal", "phase", "harmonics"}
    assert set(effect.axes) <= places
    assert len(set(effect.axes)) == len(effect.axes)


def test_site_of_insertion():
    grid = Grid(STEP, "constant")
    plain = respond(foh, DRIVE, grid)
    for effect in EFFECTS.values():
        for block in {type(trial): trial for trial in effect.trials(FITTING)}.values():
            inserted = respond(effect.insert(foh, block), DRIVE, grid)
            match effect.site_of(block):
                case "drive":
                    wanted = respond(foh, respond(block, DRIVE, grid), grid)
                case "additive":
                    wanted = plain + respond(block, DRIVE, grid)
                case _:
                    wanted = respond(block, plain, grid)
            close(inserted, wanted, 1e-10)


@pytest.mark.parametrize(
    ("rate", "counts"), [(2000, (5, 5)), (250, (2, 2)), (330, (3, 2)), (90, (1, 1))]
)
def test_the_mains_has_the_harmonics_that_the_rate_can_show(rate, counts):
    """One folded down from above it, such as 250.1 Hz at 250 Hz, would follow any slow drift."""
    times = np.arange(600) / rate
    drive = 50 - 40 * np.cos(2 * np.pi * 0.01 * rate * times)
    setting = prepare([fj.Recording(drive, 0.1 * drive, 1 / rate)]).setting
    found = {}
    for trial in EFFECTS["mains_interference"].trials(setting):
        known = named_parameters(trial)
        found[round(float(known["frequency"].value), -1)] = known["cosines"].value.size
    assert found == dict(zip((50.0, 60.0), counts, strict=True))
