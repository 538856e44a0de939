"""The course of a diagnosis: when it looks, and when it stops."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import pytest

from fracjax._diagnose import _detect, _procedure
from fracjax._diagnose._judgement import SIGNIFICANCE, Judged
from fracjax._solve import silent
from tests.diagnose.stages import NOTHING, fine_judged, judged, stage_of


@pytest.mark.parametrize(
    ("height", "numerics", "is_looked_into"),
    [(6.0, 0.9, True), (6.0, 1.1, False), (100.0, 9.0, True), (100.0, 11.0, False)],
)
def test_only_a_mismatch_far_beyond_the_numerical_error_is_looked_into(
    height, numerics, is_looked_into, monkeypatch
):
    asked = []
    scored: Any = [SimpleNamespace(height=height), SimpleNamespace(height=1.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], 1e-9))
    monkeypatch.setattr(_procedure, "judge", lambda *_: asked.append(True) or [])
    unused: Any = None
    with jax.enable_x64(True):
        course = _procedure.run(stage_of(()), numerics, unused, 0, silent)
    assert bool(asked) is is_looked_into
    assert course.rounds == []


@pytest.mark.parametrize(("guessed", "asked"), [(True, [0.0]), (False, [])])
def test_where_only_a_fit_tells_the_noise_refits_are_asked_though_nothing_shows(
    guessed, asked, monkeypatch
):
    """Seen against itself a mismatch is no larger than its noise."""
    found, least = [fine_judged("a", 100.0, plausible=True)], []

    def judge(*_: Any, **asked: Any) -> list[Judged]:
        least.append(asked["least"])
        return found

    scored: Any = [SimpleNamespace(height=2.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], 0.5))
    monkeypatch.setattr(_procedure, "judge", judge)
    with jax.enable_x64(True):
        stage = stage_of(())
        (take,) = stage.preparation.takes
        assert take.noise is not None
        noise = replace(take.noise, is_leftover=guessed)
        stage = stage.on(stage.preparation.with_noises([noise]))
        course = _procedure.run(stage, 0.0, NOTHING, 0, silent)
    assert least == asked
    assert course.rounds == []
    assert course.opening == (found if guessed else [])
    assert list(course.judged) == (["a"] if guessed else [])


@pytest.mark.parametrize(
    ("guessed", "may", "rounds"), [(True, True, 0), (True, False, 1), (False, True, 1)]
)
def test_a_noise_that_hid_behind_the_mismatch_is_read_before_the_rounds_go_on(
    guessed, may, rounds, monkeypatch
):
    seen = iter([SIGNIFICANCE / 2, 0.5])
    scored: Any = [SimpleNamespace(height=2.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], next(seen)))
    with jax.enable_x64(True):
        stage = stage_of(())
        (noise,) = (take.noise for take in stage.preparation.takes if take.noise is not None)
        noise = replace(noise, is_leftover=guessed)
        stage = stage.on(stage.preparation.with_noises([noise]))
        less = stage.preparation.with_noises([replace(noise, sigma=0.9 * noise.sigma)])
        monkeypatch.setattr(_procedure, "_with_noise_of", lambda *_: (20.0, less))
        found = [judged(stage, "drive_lag")]
        monkeypatch.setattr(_procedure, "judge", lambda *_, **__: found)
        course = _procedure.run(stage, 0.0, NOTHING, 0, silent, may_read_again=may)
        clearer = _procedure.with_noise_without_mismatch(stage, course)
    assert len(course.rounds) == rounds
    # Whoever asked for it early finds it.
    assert (clearer is not None) == guessed
