"""The dynamics of recordings whose law of hysteresis is none of the product's."""

import numpy as np
import pytest
from scipy.signal import lsim

from fracjax._path import denoised, view_of
from fracjax._path._curves import curves_of
from fracjax._path._drive import limited
from fracjax._path._fading import path_length
from tests.path.helpers import plays, preisach, relays, signal_of, through, twin_rates

STEP, NOISE = 1e-3, 1e-3
DRIVE = twin_rates()
TIMES = STEP * np.arange(DRIVE.size)


def smooth_plane(drive: np.ndarray) -> np.ndarray:
    """A response (N,) of the span 1, of a Preisach plane with many relays."""
    up, down, _ = relays(7, -0.1, 1.1, 4000)
    response = preisach(drive, (up, down, np.exp(-4 * (up - down)))) + 1000 * drive
    return response / np.ptp(response)


LAWS = {"plays": plays(DRIVE), "plane": smooth_plane(DRIVE)}


def creeping(law: np.ndarray) -> np.ndarray:
    kernel = np.log10(1 + TIMES / 0.01)
    steps = np.diff(law, prepend=law[0])
    return law + 0.04 * np.convolve(steps, kernel)[: law.size]


def lagging(law: np.ndarray) -> np.ndarray:
    return law[0] + lsim(([1.0], [0.003, 1.0]), law - law[0], TIMES, interp=True)[1]


def drifting(law: np.ndarray) -> np.ndarray:
    return law + 0.25 * -np.expm1(-TIMES)


def named(view) -> set:
    """What the posterior holds all but certain."""
    return {n for n in view.posterior.best.names if view.posterior.probability_of(n) > 0.95}


@pytest.mark.parametrize("law", LAWS)
def test_nothing_is_named_where_a_law_is_all_there_is(law):
    view = view_of([signal_of(DRIVE, LAWS[law], NOISE)])
    assert view.posterior.best.names == ()
    assert np.std(view.residual) < 1.1 * NOISE


@pytest.mark.parametrize(
    ("law", "effect", "names"),
    [
        ("plays", creeping, {"creep", "viscoelastic_layer"}),
        ("plays", lagging, {"drive_lag", "sensor_lag", "delay"}),
        ("plane", drifting, {"thermal_drift"}),
    ],
)
def test_an_effect_is_named_whatever_the_law(law, effect, names):
    view = view_of([signal_of(DRIVE, effect(LAWS[law]), NOISE)])
    present = 1 - sum(p for own, p in view.posterior.sets.items() if not own & names)
    assert present > 0.95
    assert set(view.posterior.best.names) <= names
    assert np.std(view.residual) < 1.15 * NOISE
    (name,) = set(view.posterior.best.names) & names
    shape = view.shape_of(name)
    if effect is lagging:
        constant = shape.get("time_constant") or 1 / (2 * np.pi * shape["corner"])
        assert constant == pytest.approx(0.003, rel=0.5)


def test_what_changes_with_the_path_is_told_from_what_changes_in_time():
    """Of cycles at two rates, with a rest between them, the gain falls with the path travelled."""
    levels, counts = [0.0], []
    for rest in (40, 340, 40):
        for pieces in (60, 110):
            levels += [1.0, 0.3, 0.8, 0.3, 1.0, 0.0]
            counts += [pieces] * 6
        levels, counts = [*levels, 0.0], [*counts, rest]
    drive = through(levels, counts)
    path = path_length(drive, 0.0)
    worn = plays(drive) * (1 + 0.15 * np.expm1(-path / (0.3 * path[-1])))
    view = view_of([signal_of(drive, worn, NOISE)])
    assert named(view) == {"degradation"}
    assert np.std(view.residual) < 1.1 * NOISE


def test_two_near_modes_are_told_from_one_that_stiffness_carries():
    """One mode beside a stiff rest fits better than one alone, and is not the end of it."""
    shares = [(0.55, 22.0, 0.03), (0.45, 34.0, 0.05)]
    law = LAWS["plays"]
    parts = []
    for share, frequency, damping in shares:
        w = 2 * np.pi * frequency
        own = lsim(([w**2], [1, 2 * damping * w, w**2]), law - law[0], TIMES, interp=True)[1]
        parts.append(share * own)
    view = view_of([signal_of(DRIVE, law[0] + sum(parts), NOISE)])
    assert named(view) == {"second_mode"}
    shape = view.shape_of("second_mode")
    frequencies = shape["frequency"], shape["frequency"] * shape["ratio"]
    assert sorted(frequencies) == pytest.approx([22.0, 34.0], rel=0.02)
    assert np.std(view.residual) < 1.15 * NOISE


@pytest.mark.parametrize("share", [0.45, 0.8])
def test_a_limited_rate_is_named_where_a_mode_could_take_its_place(share):
    rate = share * np.abs(np.diff(DRIVE)).max()
    view = view_of([signal_of(DRIVE, plays(limited(DRIVE, rate)), NOISE)])
    assert named(view) == {"slew_rate_limit"}
    assert view.shape_of("slew_rate_limit")["rate"] == pytest.approx(rate / STEP, rel=0.1)


def test_two_recordings_are_one_actuator():
    """What each meets once the other meets too, and each has a zero of its own."""
    one, other = np.split(DRIVE[:-1], 2)
    parts = [(one, plays(one)), (other, plays(other) + 3.0)]
    signals = [signal_of(u, y, NOISE, seed=k) for k, (u, y) in enumerate(parts)]
    view = view_of(signals)
    assert view.curves.met_again > max(curves_of([u]).met_again for u, _ in parts) + 0.2
    assert view.posterior.best.names == ()
    assert np.std(view.residual) < 1.1 * NOISE


def test_a_measured_drive_with_noise_names_nothing_that_is_not_there():
    noisy = DRIVE + 2e-4 * np.random.default_rng(8).standard_normal(DRIVE.size)
    smooth, error = denoised(noisy)
    own = signal_of(smooth, LAWS["plays"], NOISE)
    signal = own.__class__(**{**vars(own), "drive_error": error})
    assert named(view_of([signal])) == set()
