"""Robust losses: what outliers do not draw away."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize

import fracjax as fj
from fracjax._fit import LOSSES
from fracjax._fit._robust import _SHAPES
from tests.fit.creep import CLEAN, SAMPLES, SIGMA, TRUE, errors, fit, record, response_of
from tests.helpers import by_name


@pytest.mark.parametrize("loss", _SHAPES)
def test_a_loss_its_weight_and_its_slope_belong_together(loss):
    shape, z, step = _SHAPES[loss], np.array([0.1, 0.7, 1.2, 1.5, 3.0, 20.0]), 1e-6
    areas = [quad(lambda t: 2 * t * shape.weight(t), 0, end, points=[1.345])[0] for end in z]
    np.testing.assert_allclose(shape.twice(z), areas, rtol=1e-7)
    curvature = ((z + step) * shape.weight(z + step) - (z - step) * shape.weight(z - step)) / (
        2 * step
    )
    np.testing.assert_allclose(shape.slope(z), curvature, rtol=1e-6, atol=1e-9)


@pytest.fixture(scope="module")
def spoilt() -> tuple[fj.Recording, np.ndarray]:
    """A twentieth of the samples wrong by 20 to 60 sigma, all to one side."""
    generator = np.random.default_rng(5)
    bad = generator.choice(SAMPLES, SAMPLES // 20, replace=False)
    response = CLEAN.copy()
    response[bad] += SIGMA * generator.uniform(20, 60, bad.size)
    return record(response), bad


def test_least_squares_is_drawn_away_by_outliers(spoilt, plain):
    found = by_name(fit(spoilt[0]))
    good = by_name(plain)
    assert any(abs(found[n].value - TRUE[n]) > 5 * good[n].standard_error for n in TRUE)
    assert all(found[n].standard_error > 5 * good[n].standard_error for n in TRUE)


@pytest.mark.parametrize("loss", _SHAPES)
def test_robust_losses_are_not(spoilt, plain, loss):
    recording, bad = spoilt
    found = fit(recording, loss=loss)
    assert found.converged
    assert max(errors(found)) < 4
    for name, estimate in by_name(found).items():
        # A little wider than without outliers: the others do as much work as before.
        ratio = estimate.standard_error / by_name(plain)[name].standard_error
        assert 0.9 < ratio < 1.5, name
    assert found.robust is not None
    assert found.robust.weights[0][bad].max() < 0.2
    assert 0.05 <= found.robust.downweighted < 0.15
    assert found.robust.scale == pytest.approx(1.0, rel=0.15)
    assert found.to_dict()["loss"]["name"] == loss


def test_the_optimum_of_a_robust_loss_is_that_of_the_loss_itself(spoilt):
    """Against a direct minimisation of the soft_l1 loss over gain, order and offset."""
    found = fit(spoilt[0], loss="soft_l1")
    assert found.robust is not None
    scale = found.robust.scale * SIGMA

    def cost(v: np.ndarray) -> float:
        z = (spoilt[0].response - v[2] - response_of({"k_c": v[0], "mu": v[1]})) / scale
        return float(np.sum(_SHAPES["soft_l1"].twice(np.abs(z))))

    # A good start is enough: what is asked is whether anything near is lower.
    values = [by_name(found)["k_c"].value, by_name(found)["mu"].value, found.offsets[0]]
    best = minimize(cost, values, method="Nelder-Mead", options={"maxfev": 120})
    assert cost(np.array(values)) <= best.fun * (1 + 1e-5)


def test_without_outliers_a_robust_loss_changes_little(plain):
    found = fit(record(CLEAN), loss="huber")
    for name, estimate in by_name(found).items():
        assert abs(estimate.value - by_name(plain)[name].value) < 0.6 * estimate.standard_error
        assert estimate.standard_error == pytest.approx(
            by_name(plain)[name].standard_error, rel=0.25
        )


def test_an_unknown_loss_is_refused():
    with pytest.raises(fj.InputError, match=f'expected one of {", ".join(LOSSES)}, found "l3"'):
        fit(record(CLEAN), loss="l3")
