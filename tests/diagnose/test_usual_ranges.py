"""Optima far out, and fits within usual ranges."""

from types import SimpleNamespace
from typing import Any

import jax
import pytest

from fracjax._diagnose import _detect, _refit
from fracjax._diagnose._refit import Refit, within_usual_ranges
from fracjax._parameters import named_parameters, set_values
from tests.diagnose.stages import judged, stage_of


@pytest.mark.parametrize(("loss", "inside"), [(5.0, True), (20.0, False)])
def test_an_optimum_in_a_flat_valley_does_not_speak_against_an_effect(loss, inside, monkeypatch):
    """The nearest fit within the usual ranges counts where it loses no more than 10 in χ²."""
    with jax.enable_x64(True):
        stage = stage_of(())
        attempt = judged(stage, "drive_lag").refit
        usual = named_parameters(attempt.solved.block)["first.time_constant"].plausible
        far = set_values(attempt.solved.block, {"first.time_constant": 3.0 * float(usual[1])})
        solved = SimpleNamespace(block=far, cost=100.0)

    def near(starts, preparation, hopeless):
        assert hopeless == 110.0
        for start in starts:
            assert named_parameters(start)["first.time_constant"].is_plausible
        return SimpleNamespace(block=starts[0], cost=100.0 + loss)

    monkeypatch.setattr(_refit, "solve_from", near)
    given: Any = solved
    found = within_usual_ranges(Refit(attempt.score, given), stage, 10.0)
    kept = named_parameters(found.solved.block)["first.time_constant"]
    assert kept.is_plausible == inside


@pytest.mark.parametrize(
    ("p_value", "displaced", "layers", "hidden"),
    [(0.5, ["delta"], (), 0.002), (0.5, [], (), 1.0), (0.001, ["delta"], (), 1.0),
     (0.5, ["delta"], ("creep",), 1.0)],
)  # fmt: skip
def test_a_fit_outside_its_usual_ranges_is_also_seen_from_within(
    p_value, displaced, layers, hidden, monkeypatch
):
    """Where it shows nothing, and before an effect is adopted; counted as a second look."""
    solved = SimpleNamespace(kurtosis=3.0, blocks=())
    stage: Any = SimpleNamespace(
        name="lfdh", solved=solved, undisplaced="within", displaced=displaced, layers=layers,
        preparation=SimpleNamespace(problems=tuple),
    )  # fmt: skip
    monkeypatch.setattr(_detect, "residual_of", lambda *_: None)
    monkeypatch.setattr(_detect, "locate", lambda *_: [])
    monkeypatch.setattr(_detect, "freedom_of", lambda *_: 100.0)
    monkeypatch.setattr(_detect, "scored", lambda stage, solved, residual: solved)
    monkeypatch.setattr(
        _detect, "family_wise_p", lambda scores, *_: 0.001 if scores == "within" else p_value
    )
    found = _detect.detect(stage, 0, lambda message: None)
    assert (found.p_value, found.hidden) == (p_value, hidden)
    assert found.least == min(p_value, hidden)
