"""What a setting tells of recordings, and the trials of eight effects on a sweep."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fracjax._blocks import EFFECTS, ThrownLoad
from fracjax._operators import Grid
from fracjax._prepare._setting import setting_of
from tests.blocks.motion import BASE, DRIVE, NAMES, PLAIN, RATE, recorded
from tests.helpers import respond

EFFECTS_HERE = [name for name in NAMES if name in EFFECTS]


def test_the_setting_tells_rates_and_levels_of_the_recordings():
    one, other = recorded(PLAIN), recorded(0.1 * np.round(PLAIN / 0.1))
    setting = setting_of([one, other])
    rates = np.diff(DRIVE) * RATE
    assert setting.top_rate == pytest.approx(np.abs(rates).max())
    assert setting.rms_rate == pytest.approx(np.sqrt(np.mean(rates**2)))
    assert setting.response_low == min((r.response - r.response[0]).min() for r in (one, other))
    assert setting.resolution == 0
    assert setting_of([other]).resolution == pytest.approx(0.1)


@pytest.mark.parametrize("name", EFFECTS_HERE)
def test_every_trial_is_of_a_sensible_size(name):
    """A load is thrown by some of its trials only."""
    setting, effect = setting_of([recorded(0.05 * np.round(PLAIN / 0.05))]), EFFECTS[name]
    sizes: dict[bool, list[float]] = {False: [], True: []}
    for trial in effect.trials(setting):
        changed = respond(effect.insert(BASE, trial), DRIVE, Grid(1 / RATE, "constant"))
        change = (changed - changed.mean()) - (PLAIN - PLAIN.mean())
        size = float(np.abs(change).max() / np.ptp(PLAIN))
        sizes[isinstance(trial, ThrownLoad)].append(size)
    assert all(1e-5 < size < 0.3 for size in sizes[False])
    assert not sizes[True] or any(1e-5 < size < 0.3 for size in sizes[True])


@pytest.mark.parametrize("name", EFFECTS_HERE)
def test_a_program_of_the_derivatives_compiles_quickly(name):
    """It does not grow with the recording: no loop is unrolled over samples or recursed over."""
    effect = EFFECTS[name]
    trial = effect.trials(setting_of([recorded(0.05 * np.round(PLAIN / 0.05))]))[0]

    def size(samples: int) -> int:
        def simulate(scale, u):
            return effect.insert(BASE, trial)(scale * u, Grid(1 / RATE))

        derivative = jax.jacfwd(simulate)
        program = jax.make_jaxpr(derivative)(1.0, jnp.zeros(samples))
        return len(str(program).splitlines())

    assert size(4000) == size(1000)
