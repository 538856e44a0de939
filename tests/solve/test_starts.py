"""Searches from several starts."""

import os
from types import SimpleNamespace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import lsim

import fracjax as fj
from fracjax._computing import Clock, within
from fracjax._prepare import prepare
from fracjax._solve import _solve, solve_from
from fracjax._solve._modes import measured_modes
from fracjax._solve._solve import starts_of
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


def test_a_search_ends_where_it_is_when_the_time_is_over():
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        whole = solve_from(starts_of(block, 4, 0), preparation)
        with within(Clock(1e-9)):
            ended = solve_from(starts_of(block, 4, 0), preparation)
    assert whole.converged
    assert not ended.converged
    assert ended.evaluations < whole.evaluations
    assert np.isfinite(ended.cost)


def test_starts_that_come_to_one_place_go_on_as_one():
    """Of a start given twice the second stops after its first looks, and is no worse for it."""
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        once, twice = (solve_from([block] * times, preparation) for times in (1, 2))
    assert once.evaluations > 10
    assert once.evaluations < twice.evaluations <= once.evaluations + 6
    assert twice.cost == once.cost


def followed(monkeypatch, courses: dict[str, list[float]], aim: float = np.inf) -> tuple:
    """Which start wins, and χ² where each ends, where descents take these courses from 100."""
    ends = dict.fromkeys(courses, np.inf)

    def descend(at, looks):
        left = at.course[1:] if at.course[1:] else at.course
        ends[at.objective.name] = at.course[0]
        return at._replace(course=left, cost=at.course[0], converged=not at.course[1:])

    class Course(NamedTuple):
        name: str

        def at(self, _: int) -> SimpleNamespace:
            place = 1e3 * list(courses).index(self.name)
            return SimpleNamespace(residual=np.array([place]), cost=100.0)

    class Fake(NamedTuple):
        course: list[float]
        cost: float
        converged: bool
        objective: Course
        position: int = 0
        evaluations: int = 0

    monkeypatch.setattr(_solve, "begin", lambda s, *_: Fake(courses[s], np.inf, False, Course(s)))
    monkeypatch.setattr(_solve, "descend", descend)
    monkeypatch.setattr(_solve, "solved_at", lambda objective, *_, **__: objective.name)
    starts: list = list(courses)
    return _solve.solve_from(starts, prepare([record(0)], history="constant"), aim), ends


def test_a_start_that_would_overtake_the_best_is_followed(monkeypatch):
    """One start ends at once, the other falls from far above to below it, on more looks than the
    first rounds have."""
    courses = {"near": [6.0, 6.0], "far": [45.0, 20.0, 8.0, 1.0], "idle": [50.0, 49.0, 48.0]}
    assert followed(monkeypatch, courses)[0] == "far"


def test_a_start_is_followed_only_while_it_may_reach_the_aim(monkeypatch):
    slow = [99.0, 98.0, 97.0, 96.0]
    courses = {"steep": [50.0, 20.0, 6.0, 5.0], "slow": slow}
    assert followed(monkeypatch, courses, aim=10.0) == ("steep", {"steep": 5.0, "slow": 99.0})
    # Twenty rounds of 1 lead from 99 to 79.
    assert followed(monkeypatch, {"slow": slow}, aim=80.0)[1] == {"slow": 96.0}
    assert followed(monkeypatch, {"slow": slow}, aim=78.0)[1] == {"slow": 99.0}
    # What has nearly ended goes no further: nineteen rounds of .1 lead from 49.9 to 48.
    stuck = {"stuck": [50.0, 49.9, 49.8, 20.0]}
    assert followed(monkeypatch, stuck, aim=40.0)[1] == {"stuck": 49.9}


def test_there_are_as_many_starts_as_are_asked_for():
    block = fj.parse_model("foh").block
    starts = starts_of(block, 4, seed=0)
    assert len(starts) == 4
    assert starts[0] is block
    assert len({float(start.alpha.value) for start in starts}) == 4  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("frequency", "damping", "rate"), [(1.3, 0.003, 100.0), (151_000.0, 0.003, 1e6)]
)
def test_a_light_mode_is_found_wherever_it_is(frequency, damping, rate):
    generator = np.random.default_rng(1)
    count, turn = 8000, 2 * np.pi * frequency
    drive = generator.normal(size=count)
    times = np.arange(count) / rate
    law = ([turn**2], [1, 2 * damping * turn, turn**2])
    response = 0.1 * lsim(law, drive, times)[1]
    noise = 1e-3 * response.std() * generator.normal(size=count)
    found = fj.fit("gain >> resonance", fj.Recording(drive, response + noise, 1 / rate))
    assert found.parameters["resonance.frequency"].value == pytest.approx(frequency, rel=1e-3)
    assert found.scores.r_squared > 0.9


def test_measured_modes_are_those_of_the_response():
    times = np.arange(4000) / 1000
    generator = np.random.default_rng(2)
    drive = generator.normal(size=4000)
    poles = [(40.0, 0.01), (170.0, 0.02)]
    responses = [
        lsim(([(6 * f) ** 2], [1, 4 * np.pi * z * f, (2 * np.pi * f) ** 2]), drive, times)[1]
        for f, z in poles
    ]
    response = np.sum(responses, axis=0)
    frequencies, dampings = measured_modes(fj.Recording(drive, response, 1e-3))
    strongest = np.argsort(frequencies[:2])
    assert frequencies[strongest] == pytest.approx([40, 170], rel=0.02)
    assert dampings[strongest] == pytest.approx([0.01, 0.02], rel=0.7)
