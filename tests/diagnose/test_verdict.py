"""Verdicts: what stands in for another, and places alone."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fracjax._diagnose._conclusion import Conclusion
from fracjax._diagnose._held_out import Prediction
from fracjax._diagnose._procedure import Course
from tests.diagnose.helpers import ended_at, judged_of


@pytest.mark.parametrize(
    ("layers", "left", "off", "is_unseen", "stands_in"),
    [
        (2, 4.0, 3.0, True, True),
        # One law may differ from the effect's own, and reach less far.
        (1, 4.0, 3.0, True, False),
        # What comes down to the noise is left with the names it has.
        (2, 1.4, 3.0, True, False),
        (2, 4.0, 1.3, True, False),
        # Stretches are no other recording.
        (2, 4.0, 3.0, False, False),
    ],
)
def test_several_effects_that_neither_fit_nor_foretell_stand_in_for_another(
    layers, left, off, is_unseen, stands_in
):
    stage = ended_at(1000 * left)
    stage.layers = (None,) * layers
    white = np.random.default_rng(0).standard_normal(1000)
    before, after = (
        Prediction(1.0, (1.0,), size * white, np.zeros(1000, int), np.zeros((1000, 0)))
        for size in (20.0, off * np.sqrt(left))
    )
    unseen = "another" if is_unseen else None
    conclusion: Any = SimpleNamespace(stage=stage, unseen=unseen, _predicted=(before, after))
    assert Conclusion._stands_in.fget(conclusion) is stands_in  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("gained", "p_value", "verdict"),
    [
        (20, 0.005, "unexplained"),
        (20, 0.02, "none"),
        (5, 0.005, "none"),
        (5, 5e-5, "unexplained"),
    ],
)
def test_places_alone_must_be_surer(gained, p_value, verdict):
    unseen: Any = None
    first: Any = SimpleNamespace(p_value=p_value)
    refitted = {"a": judged_of("a", gained)}
    course = Course(first, True, [], first, [], refitted, unseen, None)
    conclusion: Any = SimpleNamespace(course=course, empirical=None)
    assert Conclusion._verdict(conclusion, ()) == verdict
