"""Refits of modes that ring."""

import numpy as np
import pytest
from scipy.signal import TransferFunction, chirp, lsim

import fracjax as fj
from benchmarks.concealed.build import Spec, build
from fracjax._blocks import EFFECTS
from fracjax._diagnose._layers import Layer, wrapped
from fracjax._diagnose._rivals import rivals_of
from fracjax._diagnose._views import block_of
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare import prepare
from fracjax._recording import Recording

STEP, SIGMA = 1e-4, 2e-3
TIMES = STEP * np.arange(2500)


FINE = STEP / 16 * np.arange(16 * TIMES.size)
SETTING = prepare([Recording(np.sin(9 * TIMES), np.sin(9 * TIMES), STEP, "V", "um")]).setting


def moved(frequency: float, damping: float, drive: np.ndarray) -> np.ndarray:
    """A drive at the times `FINE` through a mode, at the times `TIMES`."""
    w = 2 * np.pi * frequency
    mode = TransferFunction([w * w], [1, 2 * damping * w, w * w])
    return (np.asarray(lsim(mode, drive - drive[0], FINE)[1]) + drive[0])[::16]


def ringing(first_share: float) -> Recording:
    """A drive with corners through two lightly damped modes, and nothing else."""
    generator = np.random.default_rng(0)
    corners = np.arange(0, TIMES[-1] + 0.02, 0.02)
    drive = np.interp(TIMES, corners, generator.uniform(10, 90, corners.size))
    held = np.interp(FINE, TIMES, drive)
    one, other = moved(610, 0.01, held), moved(985, 0.02, held)
    response = 0.1 * (first_share * one + (1 - first_share) * other)
    noise = SIGMA * generator.standard_normal(drive.size)
    return Recording(drive, response + noise, STEP, "V", "um")


@pytest.mark.parametrize(
    ("share", "name"),
    [
        pytest.param(
            0.6,
            "second_mode",
            marks=pytest.mark.slow,
        ),
        (1.0, "resonance"),
    ],
)
def test_a_mode_that_rings_is_refitted_to_the_noise_and_two_are_two(share, name):
    diagnosis = fj.diagnose("creep", ringing(share), noise=SIGMA)
    assert [e.name for e in diagnosis.effects] == [name]
    found = {p.name: p.value for p in diagnosis.effects[0].parameters}
    assert found["frequency"] == pytest.approx(610, rel=0.01)
    assert found["damping"] == pytest.approx(0.01, rel=0.3)
    assert diagnosis.held_out.extended_rmse == pytest.approx(SIGMA, rel=0.1)


@pytest.mark.slow
def test_a_sweep_through_a_mode_finds_it_alone():
    """The mode lies in the band of the drive, where the base fit follows it as well as it can."""
    sweep = 50 + 40 * np.asarray(chirp(FINE, 50, FINE[-1], 900, phi=-90))
    noise = 0.02 * np.random.default_rng(0).standard_normal(TIMES.size)
    recording = Recording(sweep[::16], 0.1 * moved(610, 0.01, sweep) + noise, STEP, "V", "um")
    diagnosis = fj.diagnose("foh", recording, noise=0.02)
    (effect,) = diagnosis.effects
    assert (effect.name, effect.confusable_with) == ("resonance", ())
    found = {p.name: p.value for p in effect.parameters}
    assert found["frequency"] == pytest.approx(610, rel=2e-3)
    assert found["damping"] == pytest.approx(0.01, rel=0.1)


def test_a_small_effect_beside_a_large_one_is_found_about_its_refit():
    """Columns about the model alone do not show it: a ninth of what the other one leaves."""
    pair = ("coulomb_friction", "mains_interference")
    made = build(Spec("two", pair, (1.0, 3.0), "foh", "bursts", 500.0, 3000, "ar", 1e-3, 7))
    _, drive, response = made.recording.T
    effects = fj.diagnose("foh", Recording(drive, response, 2e-3, "V", "um")).effects
    assert len(effects) == 2
    assert {*pair} <= {name for e in effects for name in (e.name, *e.confusable_with)}


def test_the_shapes_of_effects_stay_plausible_in_a_refit():
    """A mode of critical damping is a lag, and a drift within a fiftieth of the time a start."""
    mode = EFFECTS["resonance"].trials(SETTING)[0]
    wild = set_values(mode, {"damping": 0.9, "frequency": 1e6})
    block = wrapped(fj.parse_model("foh").block, [Layer(EFFECTS["resonance"], wild)])
    own = named_parameters(block)
    for name in ("second.damping", "second.frequency"):
        one = own[name]
        assert one.plausible[0] / 3 < one.lower < one.upper < 3 * one.plausible[1]
        assert one.lower <= one.value <= one.upper


def test_a_shape_becomes_the_trial_that_holds_it():
    """Mains of 60 Hz are no trial of 50 Hz at its upper bound."""
    block = block_of(EFFECTS["mains_interference"], {"frequency": 60.02}, SETTING)
    assert named_parameters(block)["frequency"].value == pytest.approx(60.02)


def test_the_rivals_of_names_are_their_look_alikes_and_what_is_simpler():
    groups = [{"drive_lag", "delay"}, {"creep", "viscoelastic_layer"}]
    apart = {"creep": {"viscoelastic_layer"}, "second_mode": {"resonance"}}
    sets = rivals_of(["delay", "second_mode"], groups, apart)
    assert {frozenset(each) for each in sets} == {
        frozenset(each)
        for each in (
            ["delay", "second_mode"],
            ["drive_lag", "second_mode"],
            ["delay", "resonance"],
            ["delay"],
            ["second_mode"],
        )
    }
    # Two of which one is the other's stand-in are no set.
    assert not any(
        {"creep", "viscoelastic_layer"} <= {*each}
        for each in rivals_of(["creep", "delay"], [{"creep", "viscoelastic_layer", "delay"}], apart)
    )
