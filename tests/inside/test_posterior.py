"""What a fit's tangent absorbs says nothing of what it left out."""

import numpy as np
import pytest

from fracjax._inside._columns import Column, Columns
from fracjax._inside._posterior import About, Worth

SAMPLES = 300
RNG = np.random.default_rng(3)
TANGENT = RNG.standard_normal((SAMPLES, 3))
FRICTION, SPRING, CURVE = (RNG.standard_normal((SAMPLES, width)) for width in (1, 2, 1))
RESIDUAL = RNG.standard_normal(SAMPLES) + 0.4 * FRICTION[:, 0]
WORTH = Worth(1.0, SAMPLES)


def about(absorbed: float = 0.0) -> About:
    """Inner products of columns and a residual, to which so much of the tangent is added."""
    more = absorbed * TANGENT.sum(axis=1)
    effects = {
        "dry_friction": [Column((), FRICTION + more[:, None])],
        "quadratic_damping": [Column((), SPRING - more[:, None])],
    }
    others = {"drive_curve": [Column((), CURVE)]}
    columns = Columns(effects, others, RESIDUAL + more, TANGENT, 10.0)
    return About.of(columns, frozenset({"dry_friction"}))


def test_inner_products_are_those_of_what_the_tangent_leaves():
    def left(signals: np.ndarray) -> np.ndarray:
        return signals - TANGENT @ np.linalg.lstsq(TANGENT, signals)[0]

    one, response = about(), left(RESIDUAL)
    curve = 10.0 * CURVE / np.linalg.norm(CURVE)
    columns = left(np.concatenate([curve, FRICTION, SPRING], axis=1))
    np.testing.assert_allclose(one.inner.columns, columns.T @ columns, atol=1e-9)
    np.testing.assert_allclose(one.inner.along, columns.T @ response, atol=1e-9)
    assert one.inner.square == pytest.approx(response @ response)
    assert (one.samples, one.freedom) == (SAMPLES, 3)


def test_what_the_tangent_absorbs_counts_for_nothing():
    plain, absorbed = about().posterior(WORTH), about(5.0).posterior(WORTH)
    assert plain.best.names == absorbed.best.names == ("dry_friction",)
    for names, probability in plain.sets.items():
        assert absorbed.sets[names] == pytest.approx(probability, abs=1e-9)


def test_coefficients_are_those_of_the_regression_where_the_prior_is_wide():
    one = about()
    best = one.posterior(WORTH).best
    (coefficient,) = one.coefficients(best, WORTH)
    whole = np.concatenate([FRICTION, TANGENT], axis=1)
    assert coefficient[0] == pytest.approx(np.linalg.lstsq(whole, RESIDUAL)[0][0], rel=0.05)
