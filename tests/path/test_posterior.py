"""The posterior over sets of effects."""

import numpy as np
import pytest

from fracjax._path import Inner, Kind, Law, evidence, misfit, of_effects, search, select
from fracjax._path import _posterior as posterior_module

SAMPLES = 400
NAMES = ("creep", "delay", "resonance", "gain_drift")
SHAPES = 5


def columns_of(seed: int) -> np.ndarray:
    """For each effect five shapes that are alike, 20 noise deviations long."""
    rng = np.random.default_rng(seed)
    own = rng.standard_normal((len(NAMES), 1, SAMPLES))
    shapes = own + 0.5 * rng.standard_normal((len(NAMES), SHAPES, SAMPLES))
    columns = shapes.reshape(-1, SAMPLES).T
    return 20 * columns / np.linalg.norm(columns, axis=0)


def law_of(columns, response, *, one_sided=False, apart=None, unknown=0.0) -> Law:
    kinds = [
        Kind(name, k * SHAPES + s, k * SHAPES + s + 1, one_sided)
        for k, name in enumerate(NAMES)
        for s in range(SHAPES)
    ]
    inner = Inner(columns.T @ columns, columns.T @ response, float(response @ response), 0.0)
    return Law("law", kinds, inner, SAMPLES, unknown, apart or {})


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(1000 + seed).standard_normal(SAMPLES)


def test_nothing_is_found_in_noise():
    posteriors = [select(law_of(columns_of(seed), noise(seed))) for seed in range(12)]
    assert all(p.best.names == () for p in posteriors)
    strongest = [max(p.probability_of(name) for name in NAMES) for p in posteriors]
    assert max(strongest) < 0.5


@pytest.mark.parametrize("seed", range(5))
def test_a_planted_effect_is_found_with_its_shape(seed):
    columns = columns_of(seed)
    posterior = select(law_of(columns, columns[:, 7] + noise(seed)))
    assert posterior.best.names == ("delay",)
    assert posterior.best.kinds == (7,)
    assert posterior.probability_of("delay") > 0.99
    assert sum(posterior.sets.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(5))
def test_two_effects_are_found_together(seed):
    columns = columns_of(seed)
    posterior = select(law_of(columns, columns[:, 1] - 0.8 * columns[:, 12] + noise(seed)))
    assert set(posterior.best.names) == {"creep", "resonance"}
    assert posterior.sets[frozenset({"creep", "resonance"})] > 0.8


def test_an_effect_of_one_sign_is_not_found_with_the_other():
    columns = columns_of(0)
    law = law_of(columns, -columns[:, 7] + noise(0), one_sided=True)
    assert "delay" not in select(law).best.names
    law = law_of(columns, columns[:, 7] + noise(0), one_sided=True)
    assert select(law).best.names == ("delay",)


def test_effects_that_are_apart_are_not_combined():
    columns = columns_of(0)
    apart = {"creep": {"resonance"}, "resonance": {"creep"}}
    law = law_of(columns, columns[:, 1] - 0.8 * columns[:, 12] + noise(0), apart=apart)
    assert all({"creep", "resonance"} - names for names in select(law).sets)


def test_what_a_law_does_not_know_makes_it_less_sure():
    columns = columns_of(1)
    response = 0.3 * columns[:, 7] + noise(1)
    sure = select(law_of(columns, response)).probability_of("delay")
    doubtful = select(law_of(columns, response, unknown=0.01)).probability_of("delay")
    assert sure > 0.95 > 0.8 > doubtful


def test_a_misfit_that_stays_counts_as_noise():
    columns = columns_of(2)
    response = 0.4 * columns[:, 7] + noise(2)
    elsewhere = 6 * np.random.default_rng(77).standard_normal(SAMPLES)
    alone, beside = (select(law_of(columns, r)) for r in (response, response + elsewhere))
    assert alone.best.names == ("delay",)
    assert beside.best.names == ()
    assert misfit(law_of(columns, response + elsewhere), beside.best) > 20


def test_the_evidence_of_a_hypothesis_is_above_that_of_nothing_where_it_is_true():
    columns = columns_of(3)
    law = law_of(columns, columns[:, 7] + noise(3))
    posterior = select(law)
    nothing = next(h for h in posterior.hypotheses if not h.names)
    assert evidence(law, posterior.best) > evidence(law, nothing) + 20
    assert misfit(law, posterior.best) < misfit(law, nothing)


def test_its_probabilities_are_frequencies(monkeypatch):
    """Effects drawn from the prior are there as often as the posterior says."""
    monkeypatch.setattr(posterior_module, "EACH", 1.0)
    rng = np.random.default_rng(4)
    stated, present = [], []
    for case in range(120):
        columns = columns_of(case % 5)
        response = rng.standard_normal(SAMPLES)
        there = rng.random(len(NAMES)) < 0.5
        # Sets of up to three are searched.
        there[rng.integers(len(NAMES))] &= not there.all()
        for k in np.flatnonzero(there):
            # Sizes that the noise hides and that it does not, from the prior's.
            size = rng.choice(posterior_module.SIZES)
            shape = k * SHAPES + rng.integers(SHAPES)
            response += size * rng.standard_normal() * columns[:, shape]
        posterior = search(law_of(columns, response), 0.0)
        stated += [posterior.probability_of(name) for name in NAMES]
        present += there.tolist()
    stated, present = np.array(stated), np.array(present)
    bins = np.digitize(stated, [0.4, 0.6, 0.95])
    counts = np.bincount(bins, minlength=4)
    assert counts.min() >= 15
    for k in range(4):
        own = bins == k
        error = 4 * np.sqrt(0.25 / own.sum())
        assert np.mean(present[own]) == pytest.approx(np.mean(stated[own]), abs=min(error, 0.15))


def test_effects_that_are_asked_for_are_found_as_by_the_search():
    """So that a set which no search has met is weighed as one that it has."""
    columns = columns_of(3)
    response = columns @ np.repeat([1.0, 0.0, 0.5, 0.0], SHAPES) + noise(3)
    law = law_of(columns, response)
    listed = {h.names: h for h in search(law, 0.1).hypotheses}
    for names in [(), ("creep",), ("creep", "resonance")]:
        assert of_effects(law, names, 0.1) == listed[names]
