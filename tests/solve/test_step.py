"""The step of a fit's simulation: halved until it no longer matters beside the noise, or said."""

from dataclasses import replace

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._operators import Grid
from fracjax._prepare import prepare
from fracjax._solve import Solved, _numerics, refine_all, silent, solve_from
from tests.helpers import specified

STEP = 4e-3
SAMPLES = 800
FINER = 16
LAW = {"gain": 0.1, "creep_gain": 0.02, "mu": -0.15, "frequency": 25.0, "damping": 0.3}
MODEL = fj.parse_model("pea_dynamics")
STARTS = 4


def several_tones(times: np.ndarray) -> np.ndarray:
    """A drive [V], its fastest tone at 20 samples per period: enough to see, not to simulate."""
    parts = ((15, 0.7, 0.0), (10, 2.3, 1.0), (7, 5.9, 2.0), (5, 11.7, 3.0))
    return 50 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)


def record(
    seed: int, noise: float = 1e-3, **law: float
) -> tuple[fj.Recording, np.ndarray, fj.Noise]:
    """A recording of the law on a grid 16 times finer, its noise, and what is told of that."""
    fine = several_tones(np.arange((SAMPLES - 1) * FINER + 1) * STEP / FINER)
    block = MODEL.with_values(LAW | law).block
    with jax.enable_x64(True):
        response = block.respond(fine, Grid(np.asarray(STEP / FINER)))
    clean = np.asarray(response)[::FINER]
    sigma = noise * float(np.ptp(clean))
    added = sigma * np.random.default_rng(seed).standard_normal(SAMPLES)
    known = specified(sigma)
    return fj.Recording(fine[::FINER], clean + added, STEP), added, known


def fit(recordings, noise: fj.Noise | None, **options) -> fj.Fit:
    options = {"history": "constant", "settling": 0, "starts": STARTS} | options
    return fj.fit(MODEL, recordings, noise=noise, **options)


@pytest.fixture(scope="module")
def fitted() -> list[tuple[fj.Fit, np.ndarray]]:
    made = [record(seed) for seed in range(4)]
    return [(fit(recording, known), added) for recording, added, known in made]


def test_a_mode_near_the_sampling_rate_is_recovered(fitted):
    inside = [
        estimate.interval[0] <= LAW[estimate.name] <= estimate.interval[1]
        for found, _ in fitted
        for estimate in found.estimates
    ]
    assert len(inside) == 4 * len(LAW)
    assert np.sum(inside) >= 17
    for found, added in fitted:
        assert found.scores.rmse == pytest.approx(np.sqrt(np.mean(added**2)), rel=0.01)
        assert found.preparation.oversampling > 1
        assert found.warnings == ()


def test_at_the_recordings_own_step_it_is_not(fitted, monkeypatch):
    monkeypatch.setattr(_numerics, "FINEST", 1)
    recording, added, known = record(0)
    coarse = fit(recording, known)
    assert coarse.preparation.oversampling == 1
    assert coarse.scores.rmse > 1.01 * np.sqrt(np.mean(added**2))
    assert [w.split(" is ")[0] for w in coarse.warnings] == ["The discretisation error"]
    assert coarse.to_dict()["warnings"] == list(coarse.warnings)


def test_a_light_mode_takes_the_finest_grid(monkeypatch):
    """At four samples per period of its ringing, sixteen steps per sample are not enough."""
    law = {"frequency": 60.0, "damping": 0.02}
    recording, _, known = record(0, **law)
    options = {"noise": known, "history": "constant", "settling": 0, "starts": 2}
    found = fj.fit(MODEL.with_values(LAW | law), recording, **options)
    assert (found.preparation.oversampling, found.warnings) == (32, ())
    monkeypatch.setattr(_numerics, "FINEST", 16)
    coarse = fj.fit(MODEL.with_values(LAW | law), recording, **options)
    assert [w.split(" is ")[0] for w in coarse.warnings] == ["The discretisation error"]


def test_a_noise_told_by_the_fit_is_told_again_on_the_finer_grid(fitted):
    recording, added, _ = record(0)
    found = fit(recording, None)
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.is_leftover
    assert noise.sigma == pytest.approx(np.sqrt(np.mean(added**2)), rel=0.05)
    assert found.preparation.oversampling == fitted[0][0].preparation.oversampling
    errors = {e.name: e.standard_error for e in fitted[0][0].estimates}
    assert {e.name: e.standard_error for e in found.estimates} == pytest.approx(errors, rel=0.2)


def test_of_own_parameters_each_recordings_error_counts():
    (first, _, known), (second, _, _) = record(0), record(1, frequency=20.0)
    found = fit([first, second], known, own=("frequency",))
    estimates = {e.name: e for e in found.estimates}
    for name, value in {**LAW, "frequency@1": 25.0, "frequency@2": 20.0}.items():
        if name != "frequency":
            estimate = estimates[name]
            assert abs(estimate.value - value) < 3.5 * estimate.standard_error, name


def test_a_step_that_is_fine_costs_one_look(monkeypatch):
    """One simulation of a slow mode on the finer grid, and no second fit."""
    recording, _, known = record(2, noise=0.05, frequency=3.0)
    looks = []
    respond_rows = _numerics.respond_rows

    def looked(blocks, problems):
        looks.extend(problem.oversampling for problem in problems)
        return respond_rows(blocks, problems)

    monkeypatch.setattr(_numerics, "respond_rows", looked)
    found = fit(recording, known)
    assert looks == [2 * found.preparation.oversampling]


def test_a_grid_is_refined_as_far_as_what_the_fit_leaves_asks_for():
    """Beside a mismatch far above the noise the step matters the less."""
    recording, _, known = record(0)
    drifting = replace(recording, response=recording.response + np.arange(SAMPLES) / SAMPLES)
    grids = {}
    with jax.enable_x64(True):
        for name, one in (("right", recording), ("drifting", drifting)):
            prepared = prepare([one], noise=known, history="constant", settling=0)
            prepared = prepared.with_oversampling(1)
            solved = solve_from([MODEL.with_values(LAW).block], prepared)
            for share in (0.0, 0.1):
                ((finer, error),) = refine_all([solved], silent, [share])
                grids[name, share] = finer.preparation.oversampling
                assert error <= _numerics.tolerated_error(_numerics.TARGET, solved, share)
    assert grids["right", 0.1] == grids["right", 0.0] > grids["drifting", 0.1]
    assert grids["drifting", 0.0] > grids["drifting", 0.1]


@pytest.mark.parametrize(
    ("errors", "grid"),
    [
        ([8.0, 4.0, 0.4, 0.2, 0.1, 0.05], 4),  # the first that meets the target
        ([16.0, 8.0, 4.0, 2.6, 1.7, 1.1], 32),  # still on its way
        ([2.9, 1.7, 1.3, 1.2, 1.3, 1.4], 2),  # no longer
        ([1.9, 1.3, 0.95, 0.8, 0.8, 0.9], 4),  # under the limit, where any is
        ([np.nan, np.nan, 7.0, 5.0, 5.0, 5.0], 4),  # too coarse to be simulated at all
        ([np.nan] * 6, 1),
    ],
)
def test_a_grid_is_no_finer_than_the_error_falls(errors, grid, monkeypatch):
    """At a kink that meets a sample a fractional derivative hardly converges."""
    recording, _, known = record(0)
    changes = np.array(errors)[::-1]

    def whitened(_, problems):
        """Such that each halving changes it by the error of the grid before."""
        coarser = int(np.log2(problems[0][0].oversampling))
        return [np.array([0.0, changes[: changes.size - coarser].sum()])]

    monkeypatch.setattr(_numerics, "_whitened", whitened)
    monkeypatch.setattr(Solved, "whitened_derivative", lambda _: np.array([[1.0], [0.0]]))
    with jax.enable_x64(True):
        prepared = prepare([recording], noise=known, history="constant")
        prepared = prepared.with_oversampling(1)
        solved = solve_from([MODEL.with_values(LAW).block], prepared)
        ((found, error),) = _numerics._accurate_grids([solved], [0.5])
    assert found.oversampling == grid
    assert error == pytest.approx(np.nan_to_num(errors[int(np.log2(grid))], nan=np.inf))
