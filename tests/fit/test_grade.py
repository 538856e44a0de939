"""What a fit is worth: never less than a constant, the same in all units, and said in its words."""

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._fit import shortcomings_of
from fracjax._recording import Recording
from fracjax._report import fit_sentence

STEP = 2e-3
TIMES = STEP * np.arange(1500)
SWEEP = 50 + 45 * np.sin(2 * np.pi * (0.4 + 0.4 * TIMES) * TIMES)
WHITE = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)


def even() -> Recording:
    """A response that is even in the drive, under smooth noise from repeats."""
    drive = 80 * np.sin(2 * np.pi * 2 * TIMES)
    smooth = np.asarray(lfilter([0.02], [1, -1.8, 0.82], WHITE))
    return Recording(drive, (drive / 40) ** 2 + smooth, STEP, "V", "um")


def steep() -> Recording:
    """A smooth response that no drive explains."""
    return Recording(SWEEP, 1 + TIMES - 0.4 * TIMES**2 + 0.05 * SWEEP / 50 + WHITE, STEP, "V", "um")


@pytest.mark.parametrize("model", ["foh", "lfdh"])
@pytest.mark.parametrize("recording", [even(), steep()], ids=["even", "steep"])
def test_no_fit_is_worse_than_a_constant_and_none_claims_more(model, recording):
    found = fj.fit(model, recording, starts=4)
    assert found.scores.r_squared >= -1e-9
    assert found.shortcomings
    sentence = fit_sentence([found])
    assert ("does not describe" in sentence) == (found.scores.r_squared < 0.5)
    assert ("only in part" in sentence) == (found.scores.r_squared >= 0.5)


@pytest.mark.parametrize(
    ("drive", "response"), [(("V", 1.0), ("nm", 1e3)), (("mV", 1e3), ("um", 1.0))]
)
def test_units_change_no_fit(drive, response):
    law = fj.simulate(fj.parse_model("creep"), SWEEP, STEP, "constant").response
    curved = law + 0.002 * law**2 / np.ptp(law) + WHITE
    base = fj.fit("lfdh", Recording(SWEEP, curved, STEP, "V", "um"), starts=4)
    scaled = Recording(drive[1] * SWEEP, response[1] * curved, STEP, drive[0], response[0])
    other = fj.fit("lfdh", scaled, starts=4)
    assert other.scores.r_squared == pytest.approx(base.scores.r_squared, abs=1e-9)
    assert other.noise.sigma == pytest.approx(response[1] * base.noise.sigma, rel=1e-4)
    for one, two in zip(base.estimates, other.estimates, strict=True):
        # Of all units only those of drive and response differ.
        factor = (response[1] if "um" in one.unit else 1) / (drive[1] if "V" in one.unit else 1)
        assert two.value == pytest.approx(factor * one.value, rel=1e-3), one.name


def test_a_floor_is_not_the_mismatch_of_a_fit():
    drive = SWEEP
    response = 0.1 * drive + 0.4 * np.sin(drive / 15) + WHITE
    found = fj.fit("foh", Recording(drive, response, STEP, "V", "um"), starts=4)
    assert found.noise.method == "residual"
    assert found.noise.sigma == pytest.approx(0.005, rel=0.2)
    assert found.scores.rmse > 3 * found.noise.sigma
    assert "neighbouring samples show at most" in fit_sentence([found])
    assert found.to_dict()["noise"]["relative_error"] is None
    assert found.to_dict()["shortcomings"]


def test_shortcomings_are_the_gravest_first_and_none_where_there_are_none():
    assert shortcomings_of(1.0, 0.5, 0.999, ()) == ()
    useless, far, bound = shortcomings_of(8.0, 1.0, 0.2, ("alpha",))
    assert "20 %" in useless
    assert "8 times the noise floor" in far
    assert bound == "alpha ended on its bound"
    assert "constant" in shortcomings_of(8.0, 9.0, -0.1, ())[0]
