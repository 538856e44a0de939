"""Laplace's evidence for an effect, beside the whole information matrix, and its two limits."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS, AbstractBlock
from fracjax._diagnose._evidence import spared, strain
from fracjax._diagnose._stage import Layer
from fracjax._parameters import named_parameters, replace_parameters, set_values
from fracjax._prepare import layout_of, prepare
from fracjax._solve import Solved, fit_block, jacobian, solve_from
from tests.helpers import specified

STEP, SAMPLES = 5e-3, 1200


def solved_with(name: str, values: dict[str, float], noise: float) -> tuple[Solved, Layer]:
    """Creep and an effect, fitted to a recording of both with noise of this share of the span."""
    times = STEP * np.arange(SAMPLES)
    drive = 50 + 30 * np.sin(2 * np.pi * 0.7 * times) + 12 * np.sin(2 * np.pi * 6.1 * times)
    base, effect = fj.parse_model("creep").block, EFFECTS[name]
    response = fj.simulate(fj.Model(base), drive, STEP, "constant").response
    sigma = noise * float(np.ptp(response))
    blank = fj.Recording(drive, response, STEP)
    told = specified(sigma)
    layer = Layer(effect, effect.trials(prepare([blank], noise=told).setting)[0])
    truth: AbstractBlock = effect.insert(base, layer.trial)
    truth = set_values(truth, {f"{layer.place}.{n}": v for n, v in values.items()})
    response = fj.simulate(fj.Model(truth), drive, STEP, "constant").response
    response = response + sigma * np.random.default_rng(0).standard_normal(SAMPLES)
    preparation = prepare([fj.Recording(drive, response, STEP)], noise=told, history="constant")
    return solve_from([truth], preparation), layer


@pytest.fixture(autouse=True)
def _doubles():
    with jax.enable_x64(True):
        yield


def test_it_is_what_the_whole_information_matrix_says():
    solved, layer = solved_with("resonance", {"frequency": 60.0}, 0.01)
    derivative = jacobian(solved.block, solved.preparation.problems())[1]
    layout, parameters = layout_of(solved.block), named_parameters(solved.block)
    names = [name for name, size in layout.shapes + layout.gains for _ in range(size)]
    own = [k for k, name in enumerate(names) if name in ("second.frequency", "second.damping")]
    sizes = np.linalg.norm(derivative, axis=0)
    information = (derivative / sizes).T @ (derivative / sizes)
    covariance = (np.linalg.inv(information) / np.outer(sizes, sizes))[np.ix_(own, own)]
    expected = []
    for k in own:
        parameter = parameters[names[k]]
        low, high = np.log(parameter.plausible)
        assert parameter.logarithmic
        expected.append((high - low) / 3.92 * float(parameter.value))
    # What is left over counts as noise.
    for cost, left in ((0.9 * solved.samples, 1.0), (4.0 * solved.samples, 4.0)):
        scaled = np.linalg.inv(left * covariance)
        whole = np.eye(2) + np.diag(expected) @ scaled @ np.diag(expected)
        wanted = 2 * np.log(SAMPLES) - np.linalg.slogdet(whole)[1]
        found = spared(replace(solved, cost=cost), layer)
        assert found == pytest.approx(wanted, rel=1e-4)


def test_numbers_that_the_data_do_not_know_cost_nothing():
    """An inertia far above the drive's band: neither its frequency nor its damping shows."""
    solved, layer = solved_with("resonance", {"frequency": 5e4}, 0.01)
    hidden = set_values(solved.block, {"second.frequency": 5e4})
    unknown = replace(solved, blocks=(hidden,))
    assert spared(unknown, layer) == pytest.approx(2 * np.log(SAMPLES), rel=0.01)


def test_a_number_of_no_expected_size_costs_what_the_noise_makes_of_it():
    solved, layer = solved_with("minor_loop_memory", {}, 0.01)
    nothing = set_values(solved.block, {"second.weights": np.zeros(12)})
    idle = replace(solved, block=nothing, blocks=(nothing,))
    assert spared(idle, layer) == pytest.approx(12 * np.log(SAMPLES) - 12)


def test_with_little_noise_it_is_less_than_with_much():
    values = {"frequency": 60.0}
    clear, noisy = (spared(*solved_with("resonance", values, noise)) for noise in (1e-4, 0.1))
    assert clear < noisy


def test_what_a_gain_beyond_its_usual_range_costs_is_what_a_fit_without_it_leaves_more():
    """A kink of the wrong sign: held at none, all other numbers at their best."""
    values = {"share": -0.03, "threshold": -10.0}
    solved, layer = solved_with("lost_contact", values, 3e-4)
    none = fj.Parameter(0.0, fixed=True)
    held_at_none = replace_parameters(solved.block, {"second.share": none})
    held = fit_block(held_at_none, solved.preparation, 8, 0)
    rise = strain(solved, layer)
    assert rise > 100
    assert held.cost - solved.cost == pytest.approx(rise, rel=0.1)
    # The other sign is that of a contact that is lost.
    assert strain(*solved_with("lost_contact", values | {"share": 0.03}, 3e-4)) < 9
