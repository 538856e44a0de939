"""Masks and weights: what of a recording counts."""

import numpy as np
import pytest

import fracjax as fj
from tests.fit.creep import CLEAN, SAMPLES, SIGMA, TRUE, errors, fit, record, response_of


def test_a_masked_stretch_has_no_say(plain):
    response = CLEAN.copy()
    response[200:300] += 3.0
    found = fit(record(response), mask=[(0.4, 0.598)])
    assert max(errors(found)) < 4
    assert found.to_dict()["samples_left_out"] == [100]
    # The very same as with weights of 0, whatever the stretch holds.
    weights = np.ones(SAMPLES)
    weights[200:300] = 0
    response[200:300] = 7.0
    other = fit(record(response), weights=weights)
    assert [e.value for e in other.estimates] == [e.value for e in found.estimates]
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def test_a_weight_of_four_is_half_the_noise(plain):
    found = fit(record(CLEAN), weights=np.full(SAMPLES, 4.0))
    half = fit(
        record(CLEAN), noise=fj.Noise(SIGMA / 2, "um", "specification", np.ones(1), SIGMA / 2)
    )
    for one, other in zip(found.estimates, half.estimates, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-9)


def test_a_bad_period_does_not_spoil_the_measured_noise():
    drive = np.tile(40 - 20 * np.cos(2 * np.pi * np.arange(100) / 100), 8)
    response = response_of(TRUE, drive).copy()
    response[430:470] += 5.0
    found = fit(record(response, drive), noise=None, mask=[(0.86, 0.938)])
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(SIGMA, rel=0.15)
    assert max(errors(found)) < 4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"mask": [(3.0, 4.0)]}, "expected times within 0 to 1.198 s, found 3 to 4 s"),
        ({"mask": [(0.5, 0.2)]}, "found 0.5 to 0.2 s"),
        ({"mask": [(0.0, 1.19)]}, "expected at least 32 samples that count, found 4"),
        ({"weights": np.ones(7)}, r"expected 600 numbers, none below 0, found shape \(7,\)"),
        ({"weights": -np.ones(SAMPLES)}, "none below 0, found values below 0 or not finite"),
        (
            {"weights": [np.ones(SAMPLES)] * 2},
            "expected an array for each of 1 recordings, found 2",
        ),
    ],
)
def test_weights_that_do_not_fit_are_refused(options, said):
    with pytest.raises(fj.InputError, match=said):
        fit(record(CLEAN), **options)
