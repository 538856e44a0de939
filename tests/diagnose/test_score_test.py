"""The score test: family-wise p, and projection beside the fit."""

import numpy as np
from scipy.stats import kstest

import fracjax as fj
from fracjax._diagnose._score import EffectScore, Residual, family_wise_p


def scores_of(directions: np.ndarray, residual: np.ndarray) -> EffectScore:
    ones = np.ones(len(directions))
    effect = fj.EFFECTS["creep"]
    alone = tuple((k,) for k in range(len(directions)))
    return EffectScore(effect, [], directions @ residual, ones, 0 * ones, ones, directions, alone)


def test_the_family_wise_p_is_uniform_where_nothing_is_missing():
    generator = np.random.default_rng(3)
    directions = generator.standard_normal((30, 200)) + 2 * generator.standard_normal(200)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    p_values = [
        family_wise_p([scores_of(directions, generator.standard_normal(200))], 1e9, seed)
        for seed in range(150)
    ]
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_projection_removes_what_the_fit_can_absorb():
    generator = np.random.default_rng(4)
    basis = np.linalg.qr(generator.standard_normal((50, 4)))[0]
    residual = Residual(generator.standard_normal(50), basis)
    columns = generator.standard_normal((3, 50))
    assert np.abs(residual.project(columns) @ basis).max() < 1e-12
    assert np.abs(residual.project((basis @ np.ones(4))[None])).max() < 1e-12
