"""What a recording that no fit has seen says of an effect."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from fracjax._diagnose import _round
from fracjax._diagnose._held_out import Gain, Predict, Prediction
from fracjax._diagnose._judgement import Judged
from fracjax._diagnose._refit import Refit
from tests.diagnose.stages import JUDGED, judged, stage_of


@pytest.mark.parametrize(("apart", "fall"), [(3.9, 400.0), (4.1, 4.1**2)])
def test_a_recording_that_does_not_show_the_effect_leaves_it_to_stretches(apart, fall, monkeypatch):
    """Predictions of another recording that lie so many noises apart, and of stretches 20."""
    fold, certain = np.arange(500) % 5, np.zeros((500, 0))
    noise = np.random.default_rng(1).standard_normal(500)

    def predicting(apart: float) -> Predict:
        wrong = np.roll(noise, 50)
        wrong -= noise * (wrong @ noise) / (noise @ noise)
        wrong *= apart / np.linalg.norm(wrong)

        def predict(solved):
            error = noise + wrong if solved is base.solved else noise
            return Prediction(1.0, (1.0,) * 5, error, fold, certain)

        return predict

    with jax.enable_x64(True):
        base = stage_of(())
        refit = judged(base, "drive_lag").refit
        stretches = predicting(20.0)
        monkeypatch.setattr(_round, "predict_stretches", stretches)

        def before(predict: Predict) -> Prediction:
            return predict(base.solved)

        question = _round._Question(base, base, refit, before, predicting(apart))
        found = question.answered(refit.solved, 0.0)
    assert found.gain.fall == pytest.approx(fall)
    assert (found.predict is stretches) == (apart < 4)


@pytest.mark.parametrize(
    ("explained", "left", "silent"),
    [
        ((1.0, 0.5), (9.0, 1.0), True),
        ((1.0, 0.95), (9.0, 1.9), False),
        ((0.8, 0.5), (9.0, 9.0), False),
    ],
)
def test_a_recording_that_no_fit_foretells_which_explains_the_training_says_nothing(
    explained, left, silent, monkeypatch
):
    """χ² per sample of 9 held out beside 1 in training: the base's own law is open there."""
    monkeypatch.setattr(_round, "predict_stretches", lambda *_: "stretches")
    monkeypatch.setattr(
        _round, "gain", lambda _, told: replace(answer(1.0).gain, fall=float(told == "stretches"))
    )
    monkeypatch.setattr(_round, "predicts_worse", lambda predict, *_: predict is recording)
    for name in ("explained_fraction", "spared", "delta_bic"):
        monkeypatch.setattr(_round, name, lambda *_: 1.0)
    monkeypatch.setattr(_round, "is_plausible", lambda *_: True)
    score: Any = SimpleNamespace(effect=None, trials=[None], best=0)
    solved: Any = SimpleNamespace(cost=100.0, samples=100, excess_ratio=1.0)
    attempt = Refit(score, solved)

    def recording(*_: Any) -> Any:
        return "recording"

    def answer(left: float, explained: float = 1.0) -> Judged:
        gain = Gain(
            -5.0,
            9.0,
            0.0,
            predicted_folds=(True,),
            base_rmse=1.0,
            extended_rmse=1.0,
            chi_square_per_sample=left,
        )
        return replace(JUDGED, refit=attempt, explained=explained, gain=gain, predicts_worse=True)

    stage: Any = SimpleNamespace(solved=None)
    question = _round._Question(stage, stage, attempt, lambda predict: recording(), recording)
    found = [(question, answer(at, of)) for at, of in zip(left, explained, strict=True)]
    told = _round._judged_by_stretches(found)
    assert [j.gain.fall for _, j in told] == [1.0 if silent else -5.0] * 2
    # That it is predicted worse still counts.
    assert all(j.predicts_worse for _, j in told)


def test_what_is_read_from_a_recording_foretells_nothing_of_it():
    """A drift begins anew with every recording, and follows whatever is slow in that."""
    with jax.enable_x64(True):
        stage = stage_of(())
        told = [
            judged(stage, n).predicts_a_recording for n in ("electrostriction", "thermal_drift")
        ]
    assert told == [True, False]
