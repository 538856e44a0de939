"""Noise that a fit leaves: its size, its colour, its course."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._diagnose import _detect, _procedure
from fracjax._diagnose._judgement import SIGNIFICANCE
from fracjax._diagnose._stage import Stage
from fracjax._prepare import prepare, residual_noise
from fracjax._solve import silent, solve_from
from tests.diagnose.stages import DRIVE, NOISE, STEP, TIMES, fine_judged


def test_what_a_refit_gains_where_each_noise_is_what_it_leaves_itself(monkeypatch):
    """-2 ln of the likelihood falls by 2 N ln of the noise's, and each number costs ln n."""

    def noise(sigma: float, square: float = 1.0) -> Any:
        return SimpleNamespace(
            is_leftover=True,
            innovation=sigma,
            sigma=sigma,
            method="residual",
            whitened_square=square,
        )

    take = SimpleNamespace(
        noise=noise(2.0),
        recording=SimpleNamespace(response=np.zeros(100)),
        used=np.arange(100) >= 20,
    )
    preparation = SimpleNamespace(takes=[take], with_noises=lambda noises: noises)
    of_base = SimpleNamespace(free=5, simulations=[np.zeros(100)])
    base: Any = SimpleNamespace(solved=of_base, preparation=preparation)
    solved: Any = SimpleNamespace(free=8, samples=80, simulations=[np.zeros(100)])
    for left, gained in ((1.0, 160 * np.log(2) - 3 * np.log(80)), (2.0, -3 * np.log(80))):
        monkeypatch.setattr(_procedure, "residual_noise", lambda *_, left=left: noise(left))
        found, seen = _procedure._with_noise_of(base, solved)
        noises: Any = seen
        assert found == pytest.approx(gained)
        assert [n.sigma for n in noises] == [left]
    monkeypatch.setattr(_procedure, "residual_noise", lambda *_: noise(2.5))
    assert _procedure._with_noise_of(base, solved) == (-np.inf, preparation)
    # A line that no filter holds is in no innovation, and costs its whitened squares.
    monkeypatch.setattr(_procedure, "residual_noise", lambda *_: noise(2.0))
    take.noise = noise(2.0, square=4.0)
    assert _procedure._with_noise_of(base, solved)[0] == pytest.approx(80 * 3 - 3 * np.log(80))


def test_of_a_specified_noise_a_better_fit_tells_the_colour(monkeypatch):
    """Its size stays; what it gains is what the residual's own innovation has lost."""
    white = fj.Noise(0.5, "um", "specification", np.ones(1), 0.5, is_leftover=True)
    left = {0.0: replace(white, sigma=2.0, innovation=2.0, method="residual")}
    left[1.0] = replace(left[0.0], sigma=0.5, innovation=0.4, filter=np.array([1.0, -0.6]))
    monkeypatch.setattr(_procedure, "residual_noise", lambda left_over, *_: left[-left_over[0]])
    take = SimpleNamespace(
        noise=white, recording=SimpleNamespace(response=np.zeros(100)), used=np.ones(100, bool)
    )
    preparation = SimpleNamespace(takes=[take], with_noises=lambda noises: noises)
    of_base = SimpleNamespace(free=5, simulations=[np.zeros(100)])
    base: Any = SimpleNamespace(solved=of_base, preparation=preparation)
    solved: Any = SimpleNamespace(free=5, samples=100, simulations=[np.ones(100)])
    found, noises = _procedure._with_noise_of(base, solved)
    assert found == pytest.approx(200 * np.log(2.0 / 0.4))
    (seen,) = noises  # type: ignore[misc]
    assert (seen.sigma, seen.method) == (0.5, "specification")
    assert seen.innovation == pytest.approx(0.4)
    assert seen.filter.tolist() == [1.0, -0.6]
    # Where even that leaves more than the noise, nothing of the colour is known.
    left[1.0] = replace(left[1.0], sigma=0.6)
    assert _procedure._with_noise_of(base, solved) == (-np.inf, preparation)


def opened(disturbance: np.ndarray, rests: bool = True) -> tuple[Stage, _procedure.Course]:
    """LFDH, fitted to itself with a disturbance [share of the response], the last quarter of the
    drive a rest, or none; and a course on which nothing was refitted."""
    drive = np.where(TIMES < 2.25, DRIVE, DRIVE[450]) if rests else DRIVE
    response = fj.simulate("lfdh", drive, STEP, "constant").response
    response = response + np.ptp(response) * disturbance
    preparation = prepare([fj.Recording(drive, response, STEP, "V", "um")], history="constant")
    block = fj.parse_model("lfdh", preparation.setting).block
    with jax.enable_x64(True):
        solved = solve_from([block], preparation)
        (take,) = preparation.takes
        if take.noise is None:
            left = residual_noise(response - solved.simulations[0], take.used, take.recording)
            preparation = preparation.with_noises([left])
            solved = solve_from([block], preparation)
        base = Stage("lfdh", block, (), solved)
        seen = _detect.detect(base, 0, silent)
    return base, _procedure.Course(seen, True, [], seen, [], {}, base, None)


def test_where_no_effect_gains_anything_noise_may_be_larger_outside_a_rest():
    louder = NOISE * np.where(TIMES < 2.25, 2.0, 1.0)
    base, course = opened(louder)
    (told,) = [take.noise for take in base.preparation.takes]
    assert told is not None
    assert told.method == "static"
    assert course.first.least < SIGNIFICANCE
    with jax.enable_x64(True):
        explained = _procedure.with_noise_profile(base, course, 0, silent)
        assert explained is not None
        again, quiet = explained
        assert quiet.first.least >= SIGNIFICANCE
        (followed,) = [take.noise for take in again.preparation.takes]
        assert followed is not None
        ratio = followed.sigma / told.sigma
        assert np.std(louder) / np.std(NOISE[TIMES > 2.25]) == pytest.approx(ratio, rel=0.2)
        # An effect that would have been an improvement is no noise.
        gaining = replace(course, judged={"a": fine_judged("a", 20.0, True)})
        assert _procedure.with_noise_profile(base, gaining, 0, silent) is None
        # What is smooth from sample to sample is none either.
        wave = 0.006 * np.sin(9 * TIMES + TIMES**2) * (TIMES < 2.25)
        assert _procedure.with_noise_profile(*opened(NOISE + wave), 0, silent) is None


def test_a_noise_that_a_fit_left_over_may_vary_along_the_recording():
    louder = NOISE * np.where(TIMES < 1.5, 0.5, 2.0)
    base, course = opened(louder, rests=False)
    # A loud stretch that by chance is tilted: sure, were it of the noise's average size.
    course = replace(course, first=replace(course.first, p_value=1e-5))
    with jax.enable_x64(True):
        explained = _procedure.with_noise_profile(base, course, 0, silent)
        assert explained is not None
        (followed,) = [take.noise for take in explained[0].preparation.takes]
        assert followed is not None
        sizes = followed.course[1]
        assert sizes[-3:].mean() == pytest.approx(4 * sizes[:3].mean(), rel=0.25)
        wave = 0.006 * np.sin(9 * TIMES + TIMES**2) * (TIMES < 2.25)
        assert _procedure.with_noise_profile(*opened(NOISE + wave, False), 0, silent) is None
