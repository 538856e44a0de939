"""Where refits start."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from fracjax._blocks import EFFECTS
from fracjax._diagnose import _refit, _round
from fracjax._diagnose._refit import Refit, refit_further, starts_from
from fracjax._diagnose._score import EffectScore, _families, kind_of
from fracjax._parameters import named_parameters, set_values
from fracjax._solve import silent
from tests.diagnose.stages import cost_of, judged, known, stage_of


def test_a_refit_also_starts_from_what_was_found_before_and_a_law_of_fewer_numbers_from_its_own(
    monkeypatch,
):
    begun: list[Any] = []

    def solve(starts: list[Any], *_: Any) -> Any:
        begun.append(starts)
        return SimpleNamespace(
            block=starts[0], cost=-float(len(begun)), excess_ratio=1.0, free=1, samples=9
        )

    monkeypatch.setattr(_refit, "solve_from", solve)
    effect = EFFECTS["minor_loop_memory"]
    with jax.enable_x64(True):
        stage = stage_of(())
        trials = list(effect.trials(stage.preparation.setting))
        count = len(trials)
        score = EffectScore(
            effect=effect, trials=trials, z=np.ones(count), norms=np.ones(count),
            concealments=np.zeros(count), sizes=np.ones(count), directions=np.eye(count),
            families=_families(trials),
        )  # fmt: skip
        inside = set_values(stage.solved.block, {"delta": 0.4})
        earlier = effect.insert(inside, trials[0])
        _refit.refit(score, stage, [stage.solved.block], 0, np.inf, [earlier])
    kinds = [{kind_of(start) for start in starts} for starts in begun]
    assert all(len(kind) == 1 for kind in kinds)
    assert len(set.union(*kinds)) == 4  # two sites, twelve thresholds or six
    assert begun[0][0] is earlier
    of_six = [starts for starts in begun if len(starts) == 1]
    assert len(of_six) == 2
    assert named_parameters(of_six[0][0])["first.delta"].value == 0.4


@pytest.mark.parametrize(("stuck", "better"), [(50.0, True), (0.0, False)])
def test_more_starts_leave_a_basin_and_keep_what_they_cannot_better(stuck, better):
    with jax.enable_x64(True):
        stage = stage_of(())
        attempt = judged(stage, "drive_lag").refit
        best = attempt.solved
        early = replace(attempt, solved=replace(best, cost=best.cost + stuck))
        found = refit_further(early, stage, 0)
    assert (found is not early) is better
    assert found.solved.cost == pytest.approx(best.cost, abs=1.0)


@pytest.mark.parametrize(
    ("left", "rivals", "asked"),
    [(1.05, [], []), (1.05, ["c", "f"], ["b", "c", "f"]), (1.5, ["c"], ["a", "b", "c", "d"])],
)
def test_those_on_whose_order_the_name_depends_are_sought_further(left, rivals, asked, monkeypatch):
    """Those that gain most where the best leaves more than noise, else the best and its rivals.  Of
    a thousand samples the power of the noise is known to .13 (three standard errors)."""
    gains = {"b": 300.0, "a": 400.0, "e": 50.0, "d": 100.0, "c": 200.0, "f": 5.0}
    answers = {
        name: SimpleNamespace(
            name=name, delta_bic=gain, preparation=known(), solved=cost_of(1000 * left, -gain)
        )
        for name, gain in gains.items()
    }
    found: list[Any] = [
        (SimpleNamespace(attempt=name, stage=None), answer) for name, answer in answers.items()
    ]
    tried: list[Any] = []

    def sought(attempt: Any, *_: Any) -> Any:
        tried.append(attempt)
        return attempt

    monkeypatch.setattr(_round, "refit_further", sought)
    monkeypatch.setattr(_round, "best_of", lambda _: answers["b"])
    monkeypatch.setattr(_round, "rivals_of", lambda *_: [answers[name] for name in rivals])
    before: Any = cost_of(5000.0)
    assert _round._refitted_further(before, found, 0, silent) == found
    assert tried == asked


def test_a_look_alike_begins_with_the_numbers_that_the_two_laws_share():
    """One mode begins where the first of two has been found, round the base beside them."""
    with jax.enable_x64(True):
        stage = stage_of(())
        two, one = (EFFECTS[name] for name in ("second_mode", "resonance"))
        trial = two.trials(stage.preparation.setting)[0]
        block = two.insert(stage.solved.block, set_values(trial, {"damping": 2.0}))
        block = set_values(block, {"first.mu": 0.123, "second.frequency": 77.0})
        scores: Any = [
            SimpleNamespace(effect=e, trials=e.trials(stage.preparation.setting), best=0)
            for e in (two, one)
        ]
        other = Refit(scores[0], replace(stage.solved, block=block))
        (start,) = starts_from(other, scores[1])
        begun = named_parameters(start)
        around = starts_from(Refit(scores[1], replace(stage.solved, block=start)), scores[0])
    assert float(begun["second.frequency"].value) == 77.0
    assert float(begun["first.mu"].value) == 0.123
    # Within its own bounds.
    assert float(begun["second.damping"].value) == 1.0
    assert not any("ratio" in name for name in begun)
    # And where one was found, it is the lower of two or the upper.
    for block in around:
        two_modes = {name: float(p.value) for name, p in named_parameters(block.second).items()}
        modes = two_modes["frequency"] * np.array([1.0, two_modes["ratio"]])
        assert np.isclose(modes, 77.0).any()
        assert two_modes["damping"] == 1.0
    assert len(around) > 1
    # A mode at its lower bound is found on records that are too slow for any.
    slowest = set_values(trial, {"frequency": 0.1})
    assert all(block.frequency.value == 0.1 for block in two.beyond(slowest))
