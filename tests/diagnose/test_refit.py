"""Which effects are refitted, from where, on which grids."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose import _detect, _refit, _round
from fracjax._diagnose._score import EffectScore
from fracjax._prepare import Preparation
from fracjax._solve import silent


def test_an_effect_is_refitted_once_however_it_came_to_be_listed():
    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(
            effect=EFFECTS[name], promised=z**2, height=z, log_evidence=z, best=0,
            directions=np.array([[1.0, 0.0]]),
        )  # fmt: skip

    names = ("creep", "delay", "drive_lag", "sensor_lag", "resonance", "saturation")
    listed = [scored(name, 20.0 - k) for k, name in enumerate(names)]
    solved = SimpleNamespace(block=fj.parse_model("foh").block)
    stage: Any = SimpleNamespace(
        displaced=True, name="foh", preparation=None, solved=solved, undisplaced=solved
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_detect, "residual_of", lambda *_: None)
        patch.setattr(_detect, "scored", lambda *_: listed[::-1])
        found = _round._candidates(stage, listed, 0.0, silent)[0]
    assert sorted(score.effect.name for score in found) == sorted(names)
    assert [score.effect.name for score in found[:4]] == list(names[:4])


def test_an_effect_that_scores_nearly_as_much_as_any_is_refitted_too():
    names = ("creep", "delay", "backlash", "saturation", "resonance", "second_mode", "drive_lag")
    heights = (20.0, 19.0, 18.5, 18.4, 18.3, 17.0, 3.0)
    directions = np.eye(len(names))

    def scored(k: int) -> EffectScore:
        effect: Any = SimpleNamespace(name=names[k], one_sided=False)
        return EffectScore(
            effect=effect, trials=[], z=heights[k] * np.ones(1), norms=np.ones(1),
            concealments=np.zeros(1), sizes=np.ones(1), directions=directions[k : k + 1],
            families=((0,),),
        )  # fmt: skip

    listed = _round._shortlist([scored(k) for k in range(len(names))], 10.0)
    assert [score.effect.name for score in listed] == list(names[:5])


def test_starts_of_a_refit_are_unlike():
    generator = np.random.default_rng(8)
    first, other = np.linalg.qr(generator.standard_normal((50, 2)))[0].T
    neighbour = first + 1e-4 * other
    directions = np.stack([first, neighbour / np.linalg.norm(neighbour), other, -first])
    unseen: Any = None
    score = EffectScore(
        effect=unseen, trials=[], z=np.array([9.0, 8.9, 5.0, 1.0]), norms=np.ones(4),
        concealments=np.zeros(4), sizes=np.ones(4), directions=directions,
        families=((0,), (1,), (2,), (3,)),
    )  # fmt: skip
    assert _refit.unlike(score, 3) == [0, 2]
    assert _refit.unlike(score, 1) == [0]


@pytest.mark.parametrize(
    ("oversampling", "samples", "grids"),
    [(4, 4000, [1, 4]), (8, 2000, [2, 8]), (4, 3999, [4]), (2, 100_000, [2])],
)
def test_a_refit_on_a_fine_and_long_grid_begins_on_a_coarse_one(
    oversampling, samples, grids, monkeypatch
):
    found = []

    def solved(starts, preparation, hopeless):
        found.append(preparation.oversampling)
        return SimpleNamespace(block="found")

    monkeypatch.setattr(_refit, "solve_from", solved)
    # As long as a recording is, and no more than that is looked at.
    takes: Any = (SimpleNamespace(recording=range(samples)),)
    _refit._solved([], Preparation(takes, oversampling), 0.0)
    assert found == grids
