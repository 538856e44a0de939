"""The posterior over sets of effects, where the truth is drawn."""

import numpy as np
import pytest

from fracjax._diagnose._gram import Gram
from fracjax._diagnose._selection import Kind, Posterior, select

SAMPLES, EFFECTS, EACH = 400, 8, 3
KINDS = [
    Kind(f"effect {k}", EACH * k + j, EACH * k + j + 1, one_sided=False, is_shape=k == 7)
    for k in range(EFFECTS)
    for j in range(EACH)
]


class Drawn:
    """Columns and shapes, and residuals with and without them."""

    def __init__(self, seed: int):
        self.generator = np.random.default_rng(seed)
        self.columns = self.generator.standard_normal((SAMPLES, EFFECTS * EACH))
        self.shapes = self.generator.standard_normal((SAMPLES, 20))
        self.noise = self.generator.standard_normal(SAMPLES)

    def posterior(self, residual: np.ndarray) -> Posterior:
        tangent = np.ones((SAMPLES, 1))
        gram = Gram(residual, self.columns, self.shapes, tangent, SAMPLES)
        return select(gram, KINDS, small=3e-3)


def test_noise_alone_is_none():
    probabilities = [
        drawn.posterior(drawn.noise).sets[frozenset()] for drawn in map(Drawn, range(20))
    ]
    assert min(probabilities) > 0.5
    assert np.mean(probabilities) > 0.75


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_one_effect_is_named_with_its_kind(size):
    drawn = Drawn(1)
    posterior = drawn.posterior(drawn.noise + size * drawn.columns[:, 7])
    assert posterior.best.names == ("effect 2",)
    assert KINDS[posterior.best.kinds[0]].start == 7
    assert posterior.probability_of("effect 2") > 0.99


def test_two_effects_are_both_there():
    drawn = Drawn(2)
    posterior = drawn.posterior(drawn.noise + drawn.columns[:, 0] - 0.6 * drawn.columns[:, 12])
    assert set(posterior.best.names) == {"effect 0", "effect 4"}


def test_a_shape_is_no_effect_and_hides_none():
    drawn = Drawn(3)
    shape = drawn.shapes @ drawn.generator.standard_normal(20)
    posterior = drawn.posterior(drawn.noise + 0.3 * shape)
    assert posterior.shape > 0.99
    assert posterior.best.names == ()
    # Beside shapes that are larger than the noise an effect of their own class says nothing.
    beside = drawn.posterior(drawn.noise + 0.3 * shape + drawn.columns[:, 3] + drawn.columns[:, 22])
    assert beside.best.names == ("effect 1",)


def test_look_alikes_share_the_probability():
    drawn = Drawn(4)
    drawn.columns[:, 9] = drawn.columns[:, 0] + 0.02 * drawn.columns[:, 9]
    posterior = drawn.posterior(drawn.noise + 0.5 * drawn.columns[:, 0])
    both = [posterior.probability_of(f"effect {k}") for k in (0, 3)]
    assert min(both) > 0.2
    assert sum(both) > 0.98


def test_a_misfit_of_no_column_counts_as_noise():
    drawn = Drawn(5)
    posterior = drawn.posterior(6 * drawn.noise)
    assert posterior.sets[frozenset()] > 0.5
    # An effect that is significant beside the noise is not beside the misfit.
    assert drawn.posterior(drawn.noise + 0.3 * drawn.columns[:, 0]).best.names == ("effect 0",)
    assert drawn.posterior(6 * drawn.noise + 0.3 * drawn.columns[:, 0]).best.names == ()


@pytest.mark.slow
def test_the_probability_is_how_often_it_is_right():
    """Of effects drawn as the prior has them, near the noise."""
    said, true = [], []
    for seed in range(60):
        drawn = Drawn(100 + seed)
        k = int(drawn.generator.integers(EFFECTS))
        column = drawn.columns[:, EACH * k + int(drawn.generator.integers(EACH))]
        posterior = drawn.posterior(drawn.noise + 0.2 * drawn.generator.standard_normal() * column)
        names, probability = max(posterior.sets.items(), key=lambda pair: pair[1])
        if names:
            said.append(probability)
            true.append(names == {f"effect {k}"})
    assert np.mean(true) >= np.mean(said) - 0.1
