"""Which effects are refitted."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import pytest

from fracjax._blocks import EFFECTS
from fracjax._diagnose import _round
from tests.diagnose.stages import fine_judged, judged, stage_of


def test_look_alikes_that_the_catalogue_knows_are_refitted_too():
    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(effect=EFFECTS[name], promised=z**2)

    with jax.enable_x64(True):
        best = judged(stage_of(()), "drive_lag")
    scores = [scored("delay", 9.0), scored("creep", 2.0), scored("saturation", 9.0)]
    scores.append(scored("drive_lag", 9.0))
    missed = _round._look_alikes_missed([best], scores)
    assert [score.effect.name for score in missed] == ["delay"]
    assert _round._look_alikes_missed([], scores) == []


@pytest.mark.parametrize(
    ("explained", "plausible", "asked"),
    [(0.6, True, []), (0.4, True, ["delay", "creep"]), (0.6, False, ["delay", "creep"])],
)
def test_where_nothing_that_may_be_named_explains_half_every_other_promising_effect_is_refitted(
    explained, plausible, asked
):
    """A drift that the base had absorbed scored less than ten others, and none explained it."""

    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(effect=EFFECTS[name], promised=z**2, log_evidence=z)

    best = replace(fine_judged("saturation", 1000, plausible), explained=explained)
    scores = [scored("saturation", 9.0), scored("creep", 3.5), scored("delay", 4.0)]
    scores.append(scored("backlash", 2.0))
    passed_over = _round._passed_over([best], scores, 20.0)
    assert [score.effect.name for score in passed_over] == asked
