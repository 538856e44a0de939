"""A static curve of no catalogued shape: a mismatch that is described, and given no name."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._conclusion import Conclusion
from fracjax._diagnose._curve import Bent, Curve, find_curve
from fracjax._diagnose._held_out import predict_stretches
from fracjax._diagnose._next_experiment import recorded_limits
from fracjax._diagnose._procedure import Course
from fracjax._diagnose._stage import Layer, Stage
from fracjax._operators import Grid
from fracjax._parameters import set_values
from fracjax._prepare import prepare
from fracjax._solve import silent, solve_from
from tests.helpers import specified

STEP, SIGMA = 5e-3, 0.003
TIMES = STEP * np.arange(800)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES)
AT = np.array([22.0, 41.0, 60.0, 79.0])
TOLD = specified(SIGMA)


def bent(values: np.ndarray, turns: list[float] | np.ndarray, at: np.ndarray = AT) -> np.ndarray:
    """Straight pieces that meet at four values."""
    return values + np.abs(values[:, None] - at) @ turns


def lfdh(drive: np.ndarray) -> np.ndarray:
    return fj.simulate(fj.parse_model("lfdh"), drive, STEP, "constant").response


def recording(response: np.ndarray) -> fj.Recording:
    noise = SIGMA * np.random.default_rng(3).standard_normal(TIMES.size)
    return fj.Recording(DRIVE, response + noise, STEP, "V", "um")


def kinked_drive() -> fj.Recording:
    """An odd curve about the loop's middle, whose two branches plays can follow."""
    return recording(lfdh(bent(DRIVE, [0.01, -0.015, 0.015, -0.01])))


def fitted(seen: fj.Recording) -> Stage:
    """LFDH at its optimum."""
    preparation = prepare([seen], history="constant", noise=TOLD)
    block = fj.parse_model("lfdh", preparation.setting).block
    return Stage("lfdh", block, (), solve_from([block], preparation))


def with_effect(base: Stage, name: str) -> Stage:
    effect = EFFECTS[name]
    layer = Layer(effect, effect.trials(base.preparation.setting)[0])
    solved = solve_from([effect.insert(base.solved.block, layer.trial)], base.preparation)
    return base.extended(layer, solved)


def concluded(base: Stage, stage: Stage) -> Conclusion:
    first: Any = SimpleNamespace(least=1e-9)
    course = Course(first, True, [], first, [], {}, stage, None)
    return Conclusion(fj.parse_model("lfdh"), base, 0.0, None, predict_stretches, course)


def test_the_block_is_its_equation():
    block = Bent(10.0, 90.0)
    turns = np.random.default_rng(1).normal(size=12)
    with jax.enable_x64(True):
        found = set_values(block, {"turns": turns})(DRIVE, Grid(np.asarray(STEP), "constant"))
    np.testing.assert_allclose(found, bent(DRIVE, turns, np.asarray(block.kinks)), rtol=1e-12)
    assert block.kinks[0] == pytest.approx(10 + 80 / 24)


def slopes_of(curve: Curve, low: float, high: float) -> np.ndarray:
    """The slope of each twelfth of a range, but for the first and last, over the mean."""
    edges = low + (np.arange(12) + 0.5) / 12 * (high - low)
    np.testing.assert_allclose(curve.kinks, edges)
    slopes = np.diff(bent(edges, curve.turns, edges)) / np.diff(edges)
    return slopes / slopes.mean()


def test_a_kinked_drive_is_found_with_its_slopes():
    with jax.enable_x64(True):
        base = fitted(kinked_drive())
        curve = find_curve(base, 0.0)
    assert curve is not None
    assert (curve.argument, curve.unit, curve.or_else) == ("drive", "V", "")
    assert curve.solved.cost < 1.15 * curve.solved.samples < 0.5 * base.solved.cost
    slopes = slopes_of(curve, 10, 90)
    edges = curve.kinks
    true = np.diff(bent(edges, [0.01, -0.015, 0.015, -0.01])) / np.diff(edges)
    np.testing.assert_allclose(slopes, true / true.mean(), atol=0.012)
    low, high = edges[np.argmax(slopes)], edges[np.argmax(slopes) + 1]
    assert f"its mean slope) from {low:.4g} to {high:.4g} V and flattest (" in curve.sentence


def test_what_gains_too_little_is_not_fitted():
    """The linear test foretells what a curve so slight gains, to a hundredth."""
    with jax.enable_x64(True):
        base = fitted(kinked_drive())
        curve = find_curve(base, 0.0)
        assert curve is not None
        gained = base.solved.cost - curve.solved.cost
        assert find_curve(base, 0.98 * gained) is not None
        assert find_curve(base, 1.02 * gained) is None


class Table(fj.AbstractBlock):
    """What was recorded before, whatever the drive: of no source, it is a test's."""

    scale: fj.Parameter
    values: np.ndarray

    def __init__(self, values: np.ndarray):
        self.scale, self.values = fj.Parameter(1.0, gain=True), values

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return self.scale.value * jnp.interp(jnp.arange(drive.size) * grid.step, TIMES, self.values)


def test_where_drive_and_response_are_nearly_one_it_may_be_a_curve_of_either():
    """Of a gain alone they are."""
    seen = recording(0.1 * bent(DRIVE, [0.01, -0.015, 0.015, -0.01]))
    with jax.enable_x64(True):
        curve = find_curve(fitted(seen), 0.0)
    assert curve is not None
    assert {curve.argument, curve.or_else} == {"drive", "response"}
    assert f"(or of the {curve.or_else}, which fits nearly as well)" in curve.sentence


def test_a_law_that_does_not_hear_the_drive_has_no_curve_of_it():
    plain = lfdh(DRIVE)
    seen = recording(bent(plain, [0.02, -0.03, 0.01, 0.01], np.array([3.0, 5.0, 6.0, 8.0])))
    preparation = prepare([seen], history="constant", noise=TOLD)
    with jax.enable_x64(True):
        block = Table(plain)
        base = Stage("table", block, (), solve_from([block], preparation))
        curve = find_curve(base, 1.0)
    assert curve is not None
    assert curve.argument == "response"


@pytest.mark.slow
def test_a_sensor_with_a_table_of_its_own_is_a_curve_of_the_response():
    plain = lfdh(DRIVE) - 40.0
    low, span = plain.min(), np.ptp(plain)
    turns = [0.02, -0.03, 0.01, 0.01]
    seen = recording(bent(plain, turns, low + span * np.array([0.15, 0.4, 0.6, 0.85])))
    with jax.enable_x64(True):
        curve = find_curve(fitted(seen), 0.0)
    assert curve is not None
    assert (curve.argument, curve.unit) == ("response", "um")
    assert curve.solved.cost < 1.2 * curve.solved.samples
    assert "gap shifted" in curve.sentence
    # Where the reading says so, whose zero is another than the model's.
    share = (curve.kinks[[0, -1]] - seen.response.min()) / np.ptp(seen.response)
    np.testing.assert_allclose(share, [1 / 24, 23 / 24], atol=0.01)


@pytest.mark.parametrize("name", ["minor_loop_memory", "electrostriction"])
def test_no_name_is_given_to_an_effect_that_follows_a_curve(name):
    with jax.enable_x64(True):
        base = fitted(kinked_drive())
        conclusion = concluded(base, with_effect(base, name))
        assert conclusion.curve is not None
        extended: Any = SimpleNamespace(estimates=())
        assert conclusion.stage is base  # so that no fit with the follower is reported
        assert conclusion._effects(extended) == ()
        limits = recorded_limits([kinked_drive()])
        assert conclusion._next_experiment("unexplained", limits, silent) is None


def memory(drive: np.ndarray) -> np.ndarray:
    """A play, sample by sample."""
    state, found = drive[0], []
    for value in drive:
        state = min(max(state, value - 12.0), value + 12.0)
        found.append(state)
    return np.array(found)


@pytest.mark.parametrize(
    ("name", "response"),
    [
        ("electrostriction", lfdh(DRIVE + 3e-4 * (DRIVE - 50) ** 2)),
        ("minor_loop_memory", lfdh(DRIVE) + 0.02 * memory(DRIVE)),
    ],
)
def test_a_law_of_the_catalogue_keeps_its_name(name, response):
    with jax.enable_x64(True):
        base = fitted(recording(response))
        stage = with_effect(base, name)
        assert stage.solved.cost < 1.3 * base.solved.samples < base.solved.cost
        assert concluded(base, stage).curve is None


def test_nothing_is_looked_for_where_nothing_is_missing():
    """To look would need the fit, which this stage has not."""
    unseen: Any = SimpleNamespace(preparation=SimpleNamespace(takes=[SimpleNamespace(noise=TOLD)]))
    for least, is_real in ((0.5, True), (1e-9, False)):
        first: Any = SimpleNamespace(least=least)
        course = Course(first, is_real, [], first, [], {}, unseen, None)
        model = fj.parse_model("lfdh")
        assert Conclusion(model, unseen, 0.0, None, predict_stretches, course).curve is None
