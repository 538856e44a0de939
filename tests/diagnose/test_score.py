"""The score of effects whose trials add up: what all gains of a law take together."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from fracjax._blocks import EFFECTS
from fracjax._diagnose._refit import unlike
from fracjax._diagnose._score import EffectScore, _families
from fracjax._parameters import named_parameters

SAMPLES = 60


def scored(columns: np.ndarray, residual: np.ndarray, families, one_sided=False) -> EffectScore:
    """Of columns (K, n) beside which the fit absorbs nothing."""
    norms, some = np.linalg.norm(columns, axis=1), np.ones(len(columns))
    directions = columns / norms[:, None]
    effect: Any = SimpleNamespace(one_sided=one_sided)
    return EffectScore(
        effect, [], directions @ residual, norms, some, some, directions, families
    )  # fmt: skip


def drawn(seed: int) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    residual = generator.standard_normal(SAMPLES)
    return 0.5 * generator.standard_normal((4, SAMPLES)), residual


def test_the_log_evidence_of_a_family_is_the_ratio_of_its_densities():
    """Gains of unit normal priors: r is normal with the covariance 1 + DᵀD."""
    columns, residual = drawn(0)
    score = scored(columns, residual, ((0, 1, 2, 3),))
    zero = np.zeros(SAMPLES)
    known: Any = np.eye(SAMPLES) + columns.T @ columns
    wanted = multivariate_normal.logpdf(residual, zero, known) - norm.logpdf(residual).sum()
    assert score.log_evidence == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_an_effect_of_one_sign_is_believed_in_that_sign_alone(sign):
    """The half of its prior: twice the density, times how much of the posterior has that sign."""
    columns, _ = drawn(1)
    norm_squared = float(columns[0] @ columns[0])
    residual = sign * 5 * columns[0] / np.sqrt(norm_squared)
    both = scored(columns[:1], residual, ((0,),)).log_evidence
    one = scored(columns[:1], residual, ((0,),), one_sided=True).log_evidence
    right = norm.logcdf(sign * 5 * np.sqrt(norm_squared / (1 + norm_squared)))
    assert one - both == pytest.approx(np.log(2) + right, rel=1e-9)


def test_a_family_promises_what_its_gains_take_together_and_no_noise():
    columns, noise = drawn(2)
    residual = noise + columns.T @ np.array([2.0, -3.0, 2.0, 1.0])
    taken = residual @ residual - np.linalg.lstsq(columns.T, residual)[1][0]
    together = scored(columns, residual, ((0, 1, 2, 3),))
    assert together.promised == pytest.approx(taken - 3)
    apart = scored(columns, residual, tuple((k,) for k in range(4)))
    assert apart.promised == pytest.approx(apart.height**2)
    assert apart.promised < taken
    # A trial that is the sum of others adds nothing.
    more = np.concatenate([columns, [columns.sum(axis=0)]])
    assert scored(more, residual, ((0, 1, 2, 3, 4),)).promised == pytest.approx(taken - 3)


def test_trials_of_one_family_differ_in_gains_alone(setting):
    families = {name: _families(e.trials(setting)) for name, e in EFFECTS.items()}
    for name, effect in EFFECTS.items():
        listed = sorted(k for family in families[name] for k in family)
        assert listed == list(range(len(effect.trials(setting))))
    # Two laws of memory, of twelve and of six thresholds, each of one family; of the mains one for
    # each frequency.
    assert [len(family) for family in families["minor_loop_memory"]] == [14, 14, 8, 8]
    assert len(families["creep"]) == len(EFFECTS["creep"].trials(setting))
    mains = [named_parameters(t)["cosines"] for t in EFFECTS["mains_interference"].trials(setting)]
    for family in families["mains_interference"]:
        assert len(family) == 2 * np.size(mains[family[0]].value)


def test_a_refit_starts_once_from_each_family():
    columns, residual = drawn(3)
    score = scored(columns, residual + 3 * columns.sum(axis=0), ((0, 1), (2, 3)))
    chosen = unlike(score, 4)
    assert len(chosen) == 2
    assert {k // 2 for k in chosen} == {0, 1}
    assert score.best in chosen
