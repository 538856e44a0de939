"""What a drive can show is what is named on it."""

from dataclasses import replace

import numpy as np
import pytest

from fracjax._path import can_show, view_of
from fracjax._path._chain import IN_SERIES
from fracjax._path._dynamics import columns_of
from fracjax._path._fading import loop_of
from fracjax._path._motion import Motion
from tests.path.helpers import signal_of, through, twin_rates

NOISE = 1e-3
TWINS = twin_rates()
LADDER = through([0.0, 0.1, 0.0, 0.25, 0.0, 0.45, 0.0, 0.7, 0.0, 1.0, 0.0], [200] * 10)


def shown(drive: np.ndarray) -> dict:
    return {v.effect: v for v in can_show([signal_of(drive, drive, NOISE)], "um")}


def with_effect(drive: np.ndarray, name: str, size: float):
    """A recording with an effect whose median shape changes the response by `size`, peak to
    peak."""
    motion = Motion(drive, drive, lambda other: other, 1e-3, error=0.0, periodic=False)
    own = columns_of(name, [motion])
    if name in IN_SERIES:
        # What is in series has one size for each shape: the one that is nearest.
        column = min((c.values[:, 0] for c in own), key=lambda c: abs(np.log(np.ptp(c) / size)))
        return signal_of(drive, drive + column, NOISE)
    column = own[len(own) // 2].values[:, 0]
    return signal_of(drive, drive + size * column / np.ptp(column), NOISE)


def presence(signal, names: set[str]) -> float:
    """The probability that one of several effects is there."""
    return 1 - sum(p for own, p in view_of([signal]).posterior.sets.items() if not own & names)


@pytest.mark.parametrize(
    ("name", "alike"),
    [
        ("creep", {"viscoelastic_layer"}),
        ("drive_lag", {"sensor_lag", "delay"}),
        ("mains_interference", set()),
    ],
)
def test_twice_the_size_is_named_and_a_third_is_not(name, alike):
    size, names = shown(TWINS)[name].size, {name, *alike}
    assert presence(with_effect(TWINS, name, 2 * size), names) > 0.95
    assert presence(with_effect(TWINS, name, size / 3), names) < 0.95


def test_the_typical_loop_opens_along_a_fifth_of_the_stroke_and_lags():
    drive = np.concatenate([np.linspace(2, 7, 1001), np.linspace(7, 2, 1001)[1:]])
    path = np.abs(drive[:1001] - 2) / 5
    rising, falling = np.split(loop_of(drive, 5.0), [1001])
    np.testing.assert_allclose(rising, 0.5 * (1 - np.exp(-path / 0.2)), atol=2e-3)
    assert falling[-1] == pytest.approx(-0.5, abs=0.01)


def test_amplitudes_that_are_met_once_do_not_show_a_gain_that_drifts():
    visible = shown(LADDER)["gain_drift"]
    assert visible.size is None
    assert visible.reason
    assert shown(TWINS)["gain_drift"].size is not None


def test_less_noise_shows_less():
    much, little = (
        {v.effect: v.size or 0.0 for v in can_show([signal_of(TWINS, TWINS, noise)], "um")}
        for noise in (NOISE, NOISE / 10)
    )
    ratios = [little[name] / size for name, size in much.items() if size]
    assert len(ratios) > 5
    assert max(ratios) < 0.5


def test_the_response_counts_by_its_span_alone():
    signal = signal_of(TWINS, TWINS, NOISE)
    mirrored = replace(signal, response=signal.response[::-1].copy())
    assert can_show([signal], "um") == can_show([mirrored], "um")


def test_it_names_every_effect_once_in_alphabetical_order():
    names = [v.effect for v in can_show([signal_of(LADDER, LADDER, NOISE)], "um")]
    assert names == sorted(set(names))
    assert {"creep", "drive_lag", "degradation", "resonance", "slew_rate_limit"} <= set(names)
