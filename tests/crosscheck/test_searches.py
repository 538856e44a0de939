"""Particle swarm and differential evolution on functions whose least value is known."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fracjax._crosscheck._evolution import DifferentialEvolution
from fracjax._crosscheck._swarm import ParticleSwarm

SEARCHES = (ParticleSwarm(40, 300), DifferentialEvolution(40, 300))
SIZE = 3


def bowl(x, target):
    """Convex and badly scaled, 0 at the target."""
    return jnp.sum(jnp.asarray([1.0, 30.0, 1e3]) * (x - target) ** 2)


def rastrigin(x, target):
    """0 at the target, and a local minimum near each point of a grid around it."""
    z = 8 * (x - target)
    return jnp.sum(z**2 + 10 - 10 * jnp.cos(2 * jnp.pi * z))


def broken(x, target):
    """Half of the cube infinite, as `objective` makes what is not a number."""
    return jnp.where(x[0] < 0.5, jnp.inf, bowl(x, target))


FUNCTIONS = (bowl, rastrigin, broken)


@eqx.filter_jit
def ended(search, which, target, draws):
    """A search's end; a point outside the unit cube would win at once."""

    def fenced(x):
        value = jax.lax.switch(which, FUNCTIONS, x, target)
        return jnp.where(jnp.any((x < 0) | (x > 1)), -1e6, value)

    return search(fenced, draws)


def least(search, function, target, seed):
    which = jnp.asarray(FUNCTIONS.index(function))
    draws = search.draw(SIZE, np.random.default_rng(seed))
    return ended(search, which, jnp.asarray(target), draws)


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
@pytest.mark.parametrize("function", [bowl, rastrigin])
def test_the_least_of_a_known_function_is_found(search, function):
    target = np.array([0.31, 0.62, 0.47])
    found = least(search, function, target, 0)
    assert 0 <= found.cost < 1e-8
    np.testing.assert_allclose(found.position, target, atol=1e-5)
    assert found.evaluations == 40 * 300
    assert found.cost == pytest.approx(float(function(found.position, target)), abs=1e-15)


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
@given(target=st.lists(st.floats(-1, 2), min_size=SIZE, max_size=SIZE), seed=st.integers(0, 999))
@settings(max_examples=25)
def test_no_search_leaves_the_cube_and_each_finds_the_least_in_it(search, target, seed):
    found = least(search, bowl, target, seed)
    assert np.all((found.position >= 0) & (found.position <= 1))
    exact = float(bowl(np.clip(target, 0, 1), np.array(target)))
    assert exact * (1 - 1e-12) <= found.cost <= exact * (1 + 1e-3) + 1e-6


@pytest.mark.parametrize("search", SEARCHES, ids=lambda s: type(s).__name__)
def test_a_search_goes_around_where_the_model_breaks_down(search):
    found = least(search, broken, [0.2, 0.6, 0.5], 1)
    np.testing.assert_allclose(found.position, [0.5, 0.6, 0.5], atol=1e-4)


def test_three_others_are_drawn_evenly_and_never_twice():
    """Each of the 5 · 4 · 3 triples of six members' others, about 1,000 times of 60,000."""
    others = DifferentialEvolution(6, 60_000).draw(1, np.random.default_rng(0)).others
    assert others.shape == (60_000, 6, 3)
    for member in range(6):
        triples, counts = np.unique(others[:, member], axis=0, return_counts=True)
        assert len(triples) == 60
        assert all(len({member, *triple}) == 4 for triple in triples.tolist())
        assert np.sum((counts - 1000) ** 2 / 1000) < 110  # chi-square of 59, p = 1e-4 at 107
