"""Searches from several starts."""

import os

import jax
import jax.numpy as jnp
import numpy as np

import fracjax as fj
from fracjax._fit import prepare, solve_from
from fracjax._fit._solve import starts_of
from tests.fit.helpers import DRIVE, KNOWN, SIGMA, STEP, record, white


class Steep(fj.AbstractBlock):
    """A law whose derivative is of the order of 1e200, as Bouc–Wen's may be far from its range."""

    q: fj.Parameter

    def __init__(self):
        self.q = fj.Parameter(0.5, lower=0.0, upper=1.0)

    @property
    def linear(self) -> bool:
        return True

    def __call__(self, drive, grid):
        return drive * (1 + 1e-3 * jnp.sin(1e200 * self.q.value))


def test_a_derivative_near_overflow_does_not_stop_a_search():
    recording = fj.Recording(DRIVE, 1.2 * DRIVE + SIGMA * white(0), STEP)
    preparation = prepare([recording], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        found = solve_from([fj.blocks.Creep() >> Steep()], preparation)
    assert np.isfinite(found.cost)


def test_starts_side_by_side_end_where_they_end_one_after_the_other(monkeypatch):
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        found = {}
        for cores in (1, 4):
            monkeypatch.setattr(os, "cpu_count", lambda cores=cores: cores)
            found[cores] = solve_from(starts_of(block, 6, 0), preparation)
    assert found[1].start_costs == found[4].start_costs
    np.testing.assert_array_equal(found[1].simulations[0], found[4].simulations[0])


def test_starts_that_come_to_one_place_go_on_as_one():
    """Of a start given twice the second stops after its first looks, and is no worse for it."""
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        once, twice = (solve_from([block] * times, preparation) for times in (1, 2))
    assert once.evaluations > 10
    assert once.evaluations < twice.evaluations <= once.evaluations + 6
    assert twice.cost == once.cost
