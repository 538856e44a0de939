"""Jumps: a mismatch that no effect of the catalogue makes, described by its times and sizes."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._conclusion import Conclusion
from fracjax._diagnose._held_out import predict_stretches
from fracjax._diagnose._jumps import Jumps, _of_steps, _steps, find_jumps, hidden_in_noise
from fracjax._diagnose._next_experiment import recorded_limits
from fracjax._diagnose._procedure import Course
from fracjax._diagnose._stage import Layer, Stage
from fracjax._prepare import prepare
from fracjax._solve import silent, solve_from
from tests.helpers import specified

STEP, SIGMA = 5e-3, 0.01
TIMES = STEP * np.arange(600)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES) * np.linspace(1, 0.4, TIMES.size)
TOLD = specified(SIGMA)


def recording(*jumps: tuple[float, float], seed: int = 3) -> fj.Recording:
    """LFDH with noise, and jumps (time [s], size [um])."""
    plain = fj.simulate(fj.parse_model("lfdh"), DRIVE, STEP, "constant").response
    noise = SIGMA * np.random.default_rng(seed).standard_normal(TIMES.size)
    response = plain + noise + sum(size * (at - 1e-9 <= TIMES) for at, size in jumps)
    return fj.Recording(DRIVE, response, STEP, "V", "um", source=f"{seed}.csv")


def fitted(*recordings: fj.Recording) -> Stage:
    """LFDH at its optimum."""
    preparation = prepare(list(recordings), history="constant", noise=TOLD)
    block = fj.parse_model("lfdh", preparation.setting).block
    return Stage("lfdh", block, (), solve_from([block], preparation))


def found(*recordings: fj.Recording, least: float = 10.0) -> Jumps | None:
    """What is found where LFDH was fitted."""
    with jax.enable_x64(True):
        return find_jumps(fitted(*recordings), least)


@pytest.mark.parametrize("scale", [1.0, 30.0])
def test_times_and_sizes_are_found_small_or_large(scale):
    """The larger ones drag the base's orders so far that a linear test alone is off."""
    told = found(recording((0.8, 0.06 * scale), (1.9, -0.05 * scale)))
    assert told is not None
    (take,), (own,) = told.preparation.takes, told.solved.own
    assert sorted(take.jumps) == pytest.approx([160, 380], abs=1 if scale == 1 else 0)
    sizes = dict(zip(take.jumps, own[-2:], strict=True))
    assert [sizes[k] for k in sorted(sizes)] == pytest.approx(
        [0.06 * scale, -0.05 * scale], abs=5 * SIGMA / np.sqrt(30)
    )
    assert told.solved.cost / told.solved.samples == pytest.approx(1, abs=0.15)
    assert told.searched == pytest.approx(2 * np.log(told.solved.samples))


@pytest.mark.parametrize("size", [0.03, 0.06, 2.0])
@pytest.mark.parametrize("seed", range(5))
def test_jumps_are_not_gradual(size, seed):
    told = found(recording((0.8, size), (1.9, -0.9 * size), seed=seed))
    assert told is not None
    assert not told.gradual
    assert "Record the same drive again, since such jumps" in told.sentence


@pytest.mark.parametrize("seed", range(5))
def test_what_takes_a_while_is_gradual(seed):
    plain = recording(seed=seed)
    slow = 0.06 * np.tanh((TIMES - 0.9) / 0.15) - 0.05 * np.tanh((TIMES - 2.1) / 0.15)
    told = found(fj.Recording(DRIVE, plain.response + slow, STEP, "V", "um"))
    assert told is not None
    assert told.gradual
    assert "but these are gradual" in told.sentence


def test_what_is_back_at_once_is_a_tail_of_the_noise_and_tells_nothing():
    """A reading that is off by thirty times the noise once, beside a jump that stays and alone."""
    off = [(0.8, 0.3), (0.8 + STEP, -0.3)]
    for lasting in ([(1.9, 0.06)], []):
        seen = recording(*off, *lasting)
        with jax.enable_x64(True):
            base = fitted(seen)
            told = find_jumps(base, 10.0)
        assert told is not None
        assert told.count == 2 + len(lasting)
        ahead = told.ahead_of(base.solved)
        assert told._brief(0) == [slice(160, 162)]
        if lasting:
            wanted = ahead_without_samples(told, base, slice(160, 162)) - 2 * np.log(600)
            assert ahead == pytest.approx(wanted)
            assert ahead > 10
        else:
            assert ahead == -np.inf
            assert base.solved.cost - told.solved.cost > 500


def ahead_without_samples(told: Jumps, base: Stage, out: slice) -> float:
    """What jumps take from χ² of a recording, but for some samples, in units of what they leave."""
    (own,), (others,) = told.solved.whitened, base.solved.whitened
    return float(np.sum(np.delete(others**2 - own**2, np.r_[out]))) / told.solved.excess_ratio


def test_noise_alone_jumps_nowhere():
    assert found(recording(), least=0.0) is None


def test_what_gains_too_little_is_not_fitted():
    assert found(recording((0.8, 0.06)), least=1e6) is None


def test_a_jump_of_one_recording_is_not_one_of_another():
    told = found(recording(seed=1), recording((1.0, 0.1), seed=2))
    assert told is not None
    assert [take.jumps for take in told.preparation.takes] == [(), (200,)]
    assert told.sentence.startswith("It looks like a jump of the response: +0.")
    assert " um at 1 s of 2.csv. Record the same drive again" in told.sentence


@pytest.mark.parametrize("jumps", [True, False])
def test_no_name_is_given_to_an_effect_that_follows_jumps(jumps):
    """Jumps tell more than electrostriction where there are some, and less where it is there."""
    seen = recording((0.8, 0.06), (1.9, 0.05))
    if not jumps:
        law = 3e-5 * (DRIVE - 50) ** 2
        seen = fj.Recording(DRIVE, recording().response + law, STEP, "V", "um")
    with jax.enable_x64(True):
        base = fitted(seen)
        effect = EFFECTS["electrostriction"]
        layer = Layer(effect, effect.trials(base.preparation.setting)[0])
        solved = solve_from([effect.insert(base.solved.block, layer.trial)], base.preparation)
        first: Any = SimpleNamespace(least=1e-9)
        stage = base.extended(layer, solved)
        course = Course(first, True, [], first, [], {}, stage, None)
        conclusion = Conclusion(fj.parse_model("lfdh"), base, 0.0, None, predict_stretches, course)
    assert (conclusion.jumps is not None) is jumps
    if jumps:
        extended: Any = SimpleNamespace(estimates=())
        assert conclusion.stage is base  # so that no fit with the follower is reported
        assert conclusion._effects(extended) == ()
        assert conclusion._next_experiment("unexplained", recorded_limits([seen]), silent) is None


@pytest.mark.parametrize(("ahead", "told"), [(26.0, True), (24.0, False)])
def test_jumps_exclude_an_effect_as_another_effect_does(ahead, told, monkeypatch):
    """A single step had been told of weak drifts and creep, by 10 to 14 in BIC."""
    monkeypatch.setattr(Jumps, "ahead_of", lambda self, other: ahead)
    with jax.enable_x64(True):
        base = fitted(recording((0.8, 0.06), (1.9, 0.05)))
        first: Any = SimpleNamespace(least=1e-9)
        course = Course(first, True, [], first, [], {}, base, None)
        conclusion = Conclusion(fj.parse_model("lfdh"), base, 0.0, None, predict_stretches, course)
        assert (conclusion.jumps is not None) is told


def test_a_reading_held_for_a_moment_is_no_tail_of_the_noise_and_can_be_left_out():
    """It makes the tails of the residual that it is judged among, and the floor from a short rest
    seem so doubtful that no place stands out."""
    drive = np.concatenate([np.zeros(100), DRIVE - 10])
    plain = fj.simulate(fj.parse_model("lfdh"), drive, STEP, "constant").response
    response = plain + SIGMA * np.random.default_rng(5).standard_normal(drive.size)
    response[400:406] -= 150 * SIGMA
    held = fj.Recording(drive, response, STEP, "V", "um")
    found = fj.diagnose("lfdh", held)
    assert found.verdict == "unexplained"
    assert found.p_value < 1e-6
    assert " um at 2 s" in found.sentence
    assert " um at 2.03 s" in found.sentence
    assert fj.diagnose("lfdh", held, mask=[(1.99, 2.04)]).verdict == "none"


def periods(*jumps: tuple[float, float], slow: float = 0.0) -> fj.Recording:
    """Six settled cycles of LFDH, whose differences tell the noise; jumps, and a wandering sum."""
    drive = 50 - 40 * np.cos(2 * np.pi * 2 * TIMES)
    plain = fj.simulate(fj.parse_model("lfdh"), drive, STEP, "periodic").response
    generator = np.random.default_rng(4)
    noise = SIGMA * generator.standard_normal(TIMES.size)
    noise += slow * np.cumsum(generator.standard_normal(TIMES.size))
    response = plain + noise + sum(size * (at <= TIMES) for at, size in jumps)
    return fj.Recording(drive, response, STEP, "V", "um", source="cycles.csv")


def hidden(seen: fj.Recording) -> tuple[Jumps, fj.Noise] | None:
    with jax.enable_x64(True):
        preparation = prepare([seen], history="periodic")
        block = fj.parse_model("lfdh", preparation.setting).block
        base = Stage("lfdh", block, (), solve_from([block], preparation))
        return hidden_in_noise(base, 0)


def test_jumps_that_the_floor_holds_are_told_with_the_noise_beside_them():
    found = hidden(periods((1.13, 0.08), (2.06, -0.05)))
    assert found is not None
    jumps, beside = found
    assert beside.sigma == pytest.approx(SIGMA, rel=0.1)
    assert jumps.preparation.takes[0].jumps == pytest.approx([226, 412], abs=1)


@pytest.mark.parametrize("slow", [0.0, 0.1 * SIGMA, SIGMA])
def test_noise_of_one_colour_holds_no_jumps(slow):
    assert hidden(periods(slow=slow)) is None


def test_a_diagnosis_that_cannot_see_jumps_for_noise_says_so():
    found = fj.diagnose("lfdh", periods((1.13, 0.3), (2.06, -0.2)))
    assert found.verdict == "none"
    (warning,) = (w for w in found.warnings if "the noise floor contains what looks like" in w)
    for told in (warning, found.sentence):
        assert "like jumps of the response: +0.3 um at 1.13 s, -0.2 um at 2.06 s; with" in told


def test_of_several_recordings_the_one_whose_noise_hides_jumps_is_told():
    one, other = periods(), periods((1.13, 0.3), (2.06, -0.2))
    found = fj.diagnose("lfdh", [one, replace(other, source="jumps.csv")])
    assert found.verdict == "none"
    (warning,) = (w for w in found.warnings if "the noise floor contains what looks like" in w)
    assert warning.startswith("jumps.csv: the noise floor contains")
    assert "But in jumps.csv the noise floor contains" in found.sentence
    assert "+0.3 um at 1.13 s" in warning


@pytest.mark.parametrize("taps", [(2.0,), (1.5, -0.6, 0.2)])
def test_what_every_step_takes_is_that_of_the_step_itself(taps):
    """Inner products and squares of all steps by one cumulative sum, beside each step whitened."""
    preparation = prepare([recording()], history="constant", noise=TOLD)
    (problem,) = preparation.problems()
    generator = np.random.default_rng(8)
    weights = problem.weights * generator.uniform(0, 2, problem.weights.size)
    whitening = np.pad(taps, (0, problem.whitening.size - len(taps)))
    problem = replace(problem, weights=weights, whitening=whitening)
    signals = generator.standard_normal((weights.size, 4))
    products, squares = _of_steps(problem, signals)
    for at in (0, 1, 7, 300, 595, 599):
        (step,) = _steps((problem,), [(0, at)])
        np.testing.assert_allclose(products[at], step @ signals, atol=1e-10)
        assert squares[at] == pytest.approx(step @ step, abs=1e-10)
