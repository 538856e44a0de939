"""When a further effect is worth a name."""

from types import SimpleNamespace
from typing import Any

import pytest

import fracjax as fj
from fracjax._diagnose import _procedure
from fracjax._solve import silent
from tests.diagnose.stages import cost_of, known, stage_of


def worth_naming(
    base: Any, stage: Any, winner: Any, gained: float = 0.0, name: str = "creep"
) -> bool:
    """Whether an effect is worth naming that gains so much of 1000 in χ² on data held out."""
    winner.layer = SimpleNamespace(effect=fj.EFFECTS[name])
    winner.gain, winner.prediction = SimpleNamespace(fall=gained), 1000.0
    winner.predict = lambda *_: None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_procedure, "gain", lambda _, fall: SimpleNamespace(fall=fall))
        return _procedure._is_worth_naming(base, stage, winner)


def stages(cost: float, *adopted: str) -> tuple[Any, Any]:
    """A base with 1000 in χ² beyond the noise of 1000 samples, and a stage with effects."""
    layers = [SimpleNamespace(effect=fj.EFFECTS[name]) for name in adopted]
    base = SimpleNamespace(solved=cost_of(2000.0), excess=1000.0, layers=(), preparation=known())
    stage = SimpleNamespace(
        solved=cost_of(cost), excess=cost - 1000, layers=layers, preparation=known()
    )
    return base, stage


@pytest.mark.parametrize(
    ("before", "after", "worth"),
    [
        (1800.0, 1790.0, True),  # what is left is more than the noise: another is looked for
        (1350.0, 1325.0, True),  # what is left is under the noise: a fiftieth is asked
        (1350.0, 1335.0, False),
    ],
)
def test_a_further_effect_takes_a_share_that_counts(before, after, worth):
    winner: Any = SimpleNamespace(solved=cost_of(after), preparation=known())
    assert worth_naming(*stages(before, "creep"), winner) == worth


@pytest.mark.parametrize(
    ("adopted", "name", "worth"),
    [("creep", "mains_interference", True), ("creep", "thermal_drift", False),
     ("mains_interference", "thermal_drift", True)],
)  # fmt: skip
def test_lines_of_the_mains_and_other_laws_do_not_imitate_each_other(adopted, name, worth):
    winner: Any = SimpleNamespace(solved=cost_of(1335.0), preparation=known())
    assert worth_naming(*stages(1350.0, adopted), winner, name=name) == worth


@pytest.mark.parametrize(("gained", "worth"), [(25.0, True), (15.0, False)])
def test_a_further_effect_may_take_its_share_of_data_held_out(gained, worth):
    """Of 1000 in χ² that both effects together gain there."""
    winner: Any = SimpleNamespace(solved=cost_of(1295.0), preparation=known())
    assert worth_naming(*stages(1300.0, "creep"), winner, gained) == worth


def test_what_a_later_effect_makes_superfluous_is_found():
    stage = stage_of(("delay", "electrostriction", "drive_lag"))
    found = _procedure._superfluous(stage, silent)
    assert found is not None
    dropped, less = found
    assert dropped == 0
    assert less.adopted == ("electrostriction", "drive_lag")
    assert less.solved.bic < stage.solved.bic
    assert _procedure._superfluous(less, silent) is None
