"""The trials of six effects, in common and uncommon settings."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks import EFFECTS, FOH, Setting
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare import prepare
from fracjax._recording import Recording
from tests.blocks.linear import GRID, smooth
from tests.helpers import respond

NAMES = (
    "sensor_lag",
    "second_mode",
    "cubic_nonlinearity",
    "amplitude_dependence",
    "backlash",
    "sensor_nonlinearity",
)

each_effect = pytest.mark.parametrize("name", NAMES)

SETTINGS = {
    "common": Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 20.0, 3e3, 2e3, 0.0, 0.0),
    "bipolar, fast": Setting(-150.0, 30.0, 0.2, 2e-5, 0.03, 5e2, 3e5, 1e5, -0.15, 0.0),
}


def driven(setting: Setting) -> tuple[np.ndarray, FOH]:
    """A drive from end to end with its fastest part near the top, and a base of the span."""
    times = np.arange(1500) * setting.step
    fastest = 2 * np.pi * setting.top_frequency * times
    shape = np.sin(fastest / 7) + 0.5 * np.sin(fastest)
    drive = setting.drive_centre + setting.drive_span * shape / np.ptp(shape)
    slope = setting.response_span / setting.drive_span
    return drive, FOH(k_l=0.6 * slope, k_h=0.2 * slope, k_p=0.0, alpha=0.14, beta=-0.13)


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
@each_effect
def test_every_trial_is_of_a_sensible_size(name, setting):
    effect = EFFECTS[name]
    drive, base = driven(setting)
    plain = respond(base, drive, Grid(setting.step, "constant"))
    assert np.ptp(plain) == pytest.approx(setting.response_span, rel=0.5)
    for trial in effect.trials(setting):
        change = respond(effect.insert(base, trial), drive, Grid(setting.step, "constant")) - plain
        assert 1e-4 < np.std(change) / np.ptp(plain) < 0.3


@each_effect
def test_reverse_mode_is_forward_mode(name):
    """In the parameters and in the drive, also where plays start from an open interval."""
    drive = jnp.asarray(smooth(np.arange(300) * 5e-3))
    block = EFFECTS[name].trials(Setting(3.0, 8.0, 5.0, 5e-3, 1.5, 5.0, 80.0, 40.0, 0.0, 0.0))[0]
    aim = jnp.asarray(np.random.default_rng(4).standard_normal(300))
    values = {n: jnp.asarray(p.value) for n, p in named_parameters(block).items()}

    def project(values, drive):
        return aim @ set_values(block, values)(drive, Grid(5e-3, "periodic"))

    at = values, drive
    towards = {n: 0.3 * v for n, v in values.items()}, jnp.roll(aim, 7)
    forward = jax.jit(lambda: jax.jvp(project, at, towards)[1])()
    reverse = jax.jit(lambda: jax.vjp(project, *at)[1](1.0))()
    parts = jax.tree_util.tree_map(lambda a, b: float(jnp.sum(a * b)), reverse, towards)
    assert sum(jax.tree_util.tree_leaves(parts)) == pytest.approx(float(forward), rel=1e-9)


@each_effect
def test_trials_lie_where_the_literature_has_them(name):
    for trial in EFFECTS[name].trials(SETTINGS["common"]):
        for parameter in named_parameters(trial).values():
            low, high = parameter.plausible
            assert np.all(low <= parameter.value)
            assert np.all(parameter.value <= high)


@each_effect
def test_an_effect_is_no_other(name):
    """What the base's gain and offset leave of one trial is nowhere that of a look-alike."""
    drive, base = driven(SETTINGS["common"])
    plain = respond(base, drive, GRID)
    absorbed = np.linalg.qr(np.column_stack([plain, drive, np.ones_like(plain)]))[0]

    def direction(effect, trial) -> np.ndarray:
        change = respond(effect.insert(base, trial), drive, GRID) - plain
        change = change - absorbed @ (absorbed.T @ change)
        # What a recording gives no scale for, such as a converter's steps, moves nothing here.
        return change / max(float(np.linalg.norm(change)), 1e-9)

    trial = EFFECTS[name].trials(SETTINGS["common"])[0]
    own = direction(EFFECTS[name], trial)
    for other in EFFECTS[name].separated_by.keys() & EFFECTS.keys():
        for rival in EFFECTS[other].trials(SETTINGS["common"]):
            assert abs(own @ direction(EFFECTS[other], rival)) < 0.99999


@pytest.mark.parametrize("step", [1e-8, 1e-3, 4.0, 60.0, 3600.0])
def test_trials_are_within_their_bounds_at_any_rate(step):
    """A reading a minute, of a magnet that is stepped, had a mode below the least frequency."""
    samples = np.arange(400)
    drive = 50 - 50 * np.cos(2 * np.pi * samples / 100)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(samples.size)
    setting = prepare([Recording(drive, 0.1 * drive + noise, step, "V", "um")]).setting
    for name, effect in EFFECTS.items():
        for trial in effect.trials(setting):
            for parameter in named_parameters(trial).values():
                value = np.asarray(parameter.value)
                assert np.all(parameter.lower <= value), name
                assert np.all(value <= parameter.upper), name
