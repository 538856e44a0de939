"""What was adopted first is judged again beside what came later."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from fracjax._diagnose import _procedure
from fracjax._diagnose._held_out import Predict, predict_stretches
from fracjax._diagnose._judgement import Judged
from fracjax._diagnose._refit import Refit
from fracjax._diagnose._stage import Stage
from fracjax._parameters import named_parameters
from fracjax._solve import silent
from tests.diagnose.stages import judged, stage_of


def judged_again(
    names: tuple[str, ...],
    beside: tuple[str, ...],
    monkeypatch,
    predict: Predict = predict_stretches,
) -> tuple[list[str], str | None]:
    """The effects that stay when each but the last is judged again among `beside`, and the one that
    was too small to."""
    monkeypatch.setattr(_procedure, "scored", lambda *_: [])
    monkeypatch.setattr(_procedure, "residual_of", lambda *_: None)
    monkeypatch.setattr(
        _procedure, "judge", lambda base, less, *_: [judged(less, name) for name in beside]
    )
    with jax.enable_x64(True):
        base, stage = stage_of(()), stage_of(names)
        rounds = [_procedure.Round(judged(base, name), []) for name in names]
        stage, rounds, small = _procedure._reconsidered(base, stage, rounds, predict, 0, silent)
    assert [layer.effect.name for layer in stage.layers] == [r.winner.name for r in rounds]
    return [r.winner.name for r in rounds], small


def reconsidered(names: tuple[str, ...], beside: tuple[str, ...], monkeypatch) -> list[str]:
    """The effects that stay."""
    return judged_again(names, beside, monkeypatch)[0]


def test_what_was_first_adopted_gives_way_to_what_does_better_beside_the_second(monkeypatch):
    """A bent sensor bends the line as electrostriction does, less well."""
    beside = ("sensor_nonlinearity", "electrostriction")
    found = reconsidered(("sensor_nonlinearity", "drive_lag"), beside, monkeypatch)
    assert found == ["drive_lag", "electrostriction"]


def test_where_more_than_noise_is_left_the_idle_is_dropped_and_nothing_judged_again(monkeypatch):
    monkeypatch.setattr(_procedure, "residual_is_noise", lambda base, stage: False)
    beside, names = (
        ("sensor_nonlinearity", "electrostriction"),
        ("sensor_nonlinearity", "drive_lag"),
    )
    assert reconsidered(names, beside, monkeypatch) == list(names)
    idle = ("slew_rate_limit", "electrostriction", "drive_lag")
    assert reconsidered(idle, beside, monkeypatch) == ["electrostriction", "drive_lag"]


@pytest.mark.parametrize(("rmse", "stays"), [(2.2, True), (1.8, False)])
def test_what_was_first_adopted_stays_where_the_better_fit_foretells_worse(
    rmse, stays, monkeypatch
):
    def predict(solved: Any) -> Any:
        squares = any(name.endswith(".q") for name in named_parameters(solved.block))
        return SimpleNamespace(rmse=rmse if squares else 1.0)

    names, beside = (
        ("sensor_nonlinearity", "drive_lag"),
        ("sensor_nonlinearity", "electrostriction"),
    )
    found, _ = judged_again(names, beside, monkeypatch, predict)
    assert found == (list(names) if stays else ["drive_lag", "electrostriction"])


@pytest.mark.parametrize(("needed", "grid"), [(1, 1), (4, 4)])
def test_what_is_judged_again_runs_on_the_grid_that_it_needs_itself(needed, grid, monkeypatch):
    """Plays before a fractional law may have asked for one thirty times as fine."""
    grids = []

    def judge(_: Any, less: Stage, *__: Any) -> list[Judged]:
        grids.append(less.preparation.oversampling)
        return []

    def refine_until_accurate(solved: Any, *_: Any) -> tuple[Any, float]:
        assert solved.preparation.oversampling == 1
        return solved.on(solved.preparation.with_oversampling(needed)), 0.0

    monkeypatch.setattr(_procedure, "scored", lambda *_: [])
    monkeypatch.setattr(_procedure, "residual_of", lambda *_: None)
    monkeypatch.setattr(_procedure, "judge", judge)
    monkeypatch.setattr(_procedure, "refine_until_accurate", refine_until_accurate)
    names = ("electrostriction", "drive_lag")
    with jax.enable_x64(True):
        base, stage = stage_of(()), stage_of(names)
        base = base.on(base.preparation.with_oversampling(1))
        stage = stage.on(stage.preparation.with_oversampling(8))
        rounds = [_procedure.Round(judged(base, name), []) for name in names]
        _procedure._reconsidered(base, stage, rounds, predict_stretches, 0, silent)
    assert grids == [grid]


def test_what_was_adopted_beside_one_that_has_given_way_is_judged_again(monkeypatch):
    beside = ("electrostriction", "drive_lag")
    found = reconsidered(("sensor_nonlinearity", "resonance"), beside, monkeypatch)
    assert found == ["electrostriction", "drive_lag"]


def test_what_is_small_beside_the_right_effect_goes_too_but_is_told(monkeypatch):
    """It was judged beside what stood in for that, which had left it more to do."""
    monkeypatch.setattr(
        _procedure, "_is_worth_naming", lambda base, stage, winner: winner.name != "drive_lag"
    )
    names, beside = ("sensor_nonlinearity", "drive_lag"), ("electrostriction", "drive_lag")
    assert judged_again(names, beside, monkeypatch) == (["electrostriction"], "drive_lag")


@pytest.mark.parametrize(("ahead", "named"), [(11.0, ["first", "second"]), (9.0, ["other"])])
def test_one_effect_is_preferred_to_two_that_do_no_more(ahead, named, monkeypatch):
    """The first to be adopted, ahead by little, may have needed the second to do what one does."""
    base = stage_of(())

    def at(name: str, cost: float, free: int) -> Judged:
        found = judged(base, "electrostriction")
        solved = replace(found.solved, cost=cost, free=found.solved.free + free)
        gained = base.solved.bic - solved.bic
        effect = replace(found.layer.effect, name=name)
        score: Any = SimpleNamespace(effect=effect, trials=[found.layer.trial], best=0)
        return replace(found, refit=Refit(score, solved), delta_bic=gained, altogether=gained)

    pair = 550.0
    alone = pair + ahead + float(np.log(base.solved.samples))
    first, other, second = at("first", 570.0, 0), at("other", alone, 0), at("second", pair, 1)
    monkeypatch.setattr(
        _procedure,
        "judge",
        lambda base, stage, *_: [first, other] if not stage.layers else [second],
    )
    monkeypatch.setattr(_procedure, "best_of", lambda found: found[0] if found else None)
    seen: Any = SimpleNamespace(least=0.0, scores=[], height=1e3)
    rest: Any = SimpleNamespace(least=1.0, scores=[])
    monkeypatch.setattr(
        _procedure, "detect", lambda stage, *_: seen if len(stage.layers) < 2 else rest
    )
    monkeypatch.setattr(_procedure, "_is_worth_naming", lambda *_: True)
    monkeypatch.setattr(
        _procedure, "_reconsidered", lambda b, stage, rounds, *_: (stage, rounds, None)
    )
    course = _procedure.run(base, 0.0, predict_stretches, 0, silent)
    assert [round_.winner.name for round_ in course.rounds] == named
    assert list(course.stage.adopted) == named
    assert course.opening == [first, other]


def test_the_right_effects_stay_and_an_idle_one_goes(monkeypatch):
    beside = ("sensor_nonlinearity", "electrostriction")
    assert reconsidered(("electrostriction", "drive_lag"), beside, monkeypatch) == [
        "electrostriction",
        "drive_lag",
    ]
    idle = ("slew_rate_limit", "electrostriction", "drive_lag")
    assert reconsidered(idle, beside, monkeypatch) == ["electrostriction", "drive_lag"]
