"""Predictions of data that no fit has seen, beside what the noise allows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import jax
import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._diagnose import held_out_take
from fracjax._diagnose._held_out import (
    Prediction,
    foretells_worse,
    gain,
    predict_recording,
    predict_stretches,
)
from fracjax._prepare import Noise, Preparation, take_of
from fracjax._solve import Solved, solve_from
from fracjax._fit import prepare, settle
from fracjax._operators._grid import History
from fracjax._parameters import set_values

STEP, SAMPLES = 1e-3, 2000
TIMES = STEP * np.arange(SAMPLES)
SIGMA = 0.01
DRIVE = 50 + 30 * np.sin(2 * np.pi * 3.3 * TIMES) + 12 * np.sin(2 * np.pi * 17.1 * TIMES)
OTHER = 45 + 25 * np.sin(2 * np.pi * 7.7 * TIMES) + 15 * np.sin(2 * np.pi * 1.3 * TIMES)
CREEP = fj.parse_model("creep")


@pytest.fixture(autouse=True)
def _doubles():
    with jax.enable_x64(True):
        yield


def response(drive: np.ndarray) -> np.ndarray:
    values = {"k_c": 0.1, "mu": 0.01}
    return np.asarray(fj.simulate(CREEP.with_values(values), drive, STEP, "constant").response)


def white(sigma: float = SIGMA) -> Noise:
    return Noise(sigma, "um", "specification", np.ones(1), sigma)


def fitted(
    block: Any, drive: np.ndarray, clean: np.ndarray, noise: Noise, error: np.ndarray
) -> tuple[Solved, Preparation]:
    recording = fj.Recording(drive, clean + error, STEP, "V", "um")
    preparation = prepare([recording], history="constant", settling=0, noise=noise)
    return solve_from([block], preparation), preparation


def hum(phase: float, size: float) -> np.ndarray:
    return size * np.cos(2 * np.pi * 50 * TIMES + phase)


def test_lines_of_another_phase_and_size_are_read_from_the_recording_that_has_them():
    generator = np.random.default_rng(1)
    error = hum(0.3, 0.05) + SIGMA * generator.standard_normal(SAMPLES)
    layered = EFFECTS["mains_interference"]
    block = layered.insert(CREEP.block, layered.trials(prepare_alone(DRIVE).setting)[0])
    block = set_values(block, {"second.frequency": 50.0})
    base, preparation = fitted(CREEP.block, DRIVE, response(DRIVE), white(), error)
    extended, _ = fitted(block, DRIVE, response(DRIVE), white(), error)
    other = response(OTHER) + hum(2.9, 0.08) + SIGMA * generator.standard_normal(SAMPLES)
    take = take_of(fj.Recording(OTHER, other, STEP, "V", "um"), white(), "constant", 0)
    before, after = (predict_recording(s, preparation, take) for s in (base, extended))
    found = gain(before, after)
    assert found.convincing
    assert found.extended_rmse == pytest.approx(SIGMA, rel=0.1)
    assert found.base_rmse > 4 * SIGMA


def test_what_looks_like_the_offset_in_another_recording_is_read_with_it():
    generator = np.random.default_rng(7)
    layered = EFFECTS["mains_interference"]
    block = layered.insert(CREEP.block, layered.trials(prepare_alone(DRIVE).setting)[0])
    error = hum(0.3, 0.05) + SIGMA * generator.standard_normal(SAMPLES)
    solved, preparation = fitted(block, DRIVE, response(DRIVE), white(), error)
    # One of its two columns is constant to 1e-9 of itself.
    slow = replace(solved, block=set_values(solved.block, {"second.frequency": 1e-6}))
    other = response(OTHER) + 0.4 + SIGMA * generator.standard_normal(SAMPLES)
    take = take_of(fj.Recording(OTHER, other, STEP, "V", "um"), white(), "constant", 0)
    found = predict_recording(slow, preparation, take)
    assert found.rmse == pytest.approx(SIGMA, rel=0.1)
    assert np.isfinite(found.spread).all()


def prepare_alone(drive: np.ndarray) -> Preparation:
    return prepare([fj.Recording(drive, 0.1 * drive, STEP, "V", "um")], noise=white())


def test_the_errors_of_another_recording_are_whitened_and_their_offset_is_known_from_all_of_it():
    """Under the model that is right, beside AR noise whose first samples say little of its mean."""
    generator, pole = np.random.default_rng(2), 0.95
    sigma = SIGMA / np.sqrt(1 - pole**2)
    noise = Noise(sigma, "um", "specification", np.array([1, -pole]), SIGMA)
    solved, preparation = fitted(CREEP.block, DRIVE, response(DRIVE), noise, coloured(generator))
    z = []
    for _ in range(20):
        measured = response(OTHER) + 3.0 + coloured(generator)
        recording = fj.Recording(OTHER, measured, STEP, "V", "um")
        found = predict_recording(solved, preparation, take_of(recording, noise, "constant", 0))
        z.append(found.whitened)
    errors = np.stack(z)
    assert np.std(errors) == pytest.approx(1, abs=0.02)
    assert abs(np.mean(errors[:, 1:] * errors[:, :-1])) < 0.02


@pytest.mark.parametrize("pole", [0.0, 0.6])
def test_the_zero_of_another_recording_costs_little_of_its_rmse(pole):
    """Read from twenty samples it would cost 2.5 and 10 %."""
    generator = np.random.default_rng(3)
    sigma = SIGMA / np.sqrt(1 - pole**2)
    noise = Noise(sigma, "um", "specification", np.array([1, -pole]), SIGMA)
    solved, preparation = fitted(
        CREEP.block, DRIVE, response(DRIVE), noise, coloured(generator, pole)
    )
    takes = [
        take_of(
            fj.Recording(OTHER, response(OTHER) + 3.0 + coloured(generator, pole), STEP, "V", "um"),
            noise,
            "constant",
            0,
        )
        for _ in range(40)
    ]
    rmse = [predict_recording(solved, preparation, take).rmse for take in takes]
    assert np.mean(np.square(rmse)) < 1.05 * sigma**2
    assert takes[0].baseline == slice(0, 100 if pole == 0 else 200)


def coloured(generator: np.random.Generator, pole: float = 0.95) -> np.ndarray:
    """AR(1) noise (N,) of innovation sd SIGMA."""
    long = SIGMA * generator.standard_normal(2 * SAMPLES)
    return np.asarray(lfilter([1.0], [1.0, -pole], long))[SAMPLES:]


@pytest.mark.parametrize("seed", [1, 4])
def test_stretches_whose_refit_is_too_far_for_a_first_order_are_predicted_to_the_noise(seed):
    """A drift as good as straight: without the first samples nothing tells its time constant, and a
    first-order refit is off by 20 to 10^5 times the noise."""
    error = SIGMA * np.random.default_rng(seed).standard_normal(SAMPLES)
    layered = EFFECTS["thermal_drift"]
    block = layered.insert(CREEP.block, layered.trials(prepare_alone(DRIVE).setting)[0])
    clean = response(DRIVE) + 0.02 * TIMES
    base, preparation = fitted(CREEP.block, DRIVE, clean, white(), error)
    extended, _ = fitted(block, DRIVE, clean, white(), error)
    before, after = (predict_stretches(s, preparation) for s in (base, extended))
    assert after.folds == pytest.approx((SIGMA,) * 5, rel=0.15)
    assert gain(before, after).convincing


def test_held_out_stretches_agree_with_refits_of_a_linear_model():
    generator = np.random.default_rng(5)
    time = np.arange(2000) * 0.01
    drive = np.sin(2 * np.pi * 0.7 * time) * (1 + 0.3 * np.sin(2 * np.pi * 0.05 * time))
    recording = fj.Recording(drive, 3 * drive + 1 + 0.1 * generator.standard_normal(2000), 0.01)
    fixed = {"alpha": 0.3, "beta": 0.2, "k_h": 0.0, "k_p": 0.0}
    fit = fj.fit(fj.parse_model("foh"), recording, fixed=fixed)
    preparation = prepare([recording])
    solved, preparation = settle(fit.model.block, preparation, history="constant", starts=1, seed=0)
    prediction = predict_stretches(solved, preparation)
    design = np.stack([drive, np.ones(2000)], axis=1)
    fold = (np.arange(2000) / (2000 / 22)).astype(int) % 5
    counted = np.asarray(preparation.problems()[0].weights)[:2000] > 0
    errors = np.zeros(2000)
    for k in range(5):
        kept = counted & (fold != k)
        gains = np.linalg.lstsq(design[kept], recording.response[kept], rcond=None)[0]
        errors[fold == k] = (recording.response - design @ gains)[fold == k]
    # Only the noise's colour, found from the residual, makes the two differ.
    noise = preparation.takes[0].noise
    assert noise is not None
    gains = np.linalg.lstsq(design, recording.response, rcond=None)[0]
    seen, unseen = (
        np.asarray(lfilter(noise.whitening, 1.0, e))[counted]
        for e in (recording.response - design @ gains, errors)
    )
    assert np.std(prediction.whitened - unseen) < 0.3 * np.std(unseen - seen)


def test_stretches_are_whole_periods_as_many_as_make_a_twentysecond():
    times = np.arange(2000) * 0.01
    drive = np.sin(2 * np.pi * 5 * times)
    white = np.random.default_rng(9).standard_normal(2000)
    recording = fj.Recording(drive, 3 * drive + 0.1 * white, 0.01)
    preparation = prepare([recording], history="constant", settling=0)
    solved, preparation = settle(
        fj.parse_model("creep").block, preparation, history="constant", starts=1, seed=0
    )
    folds = predict_stretches(solved, preparation).fold_of_sample
    # 2000 / 22 samples are rather five periods of 20 than four.
    assert np.array_equal(folds, (np.arange(2000) // 100 % 5)[-folds.size :])


def test_folds_that_got_worse_are_counted_by_their_own_errors():
    fold = np.arange(1000) % 5
    noise = np.random.default_rng(10).standard_normal(1000)
    certain = np.zeros((1000, 0))
    base = Prediction(1.0, (1.0,) * 5, noise, fold, certain)
    mixed = Prediction(1.0, (1.0,) * 5, np.where(fold == 0, 1.5, 0.5) * noise, fold, certain)
    found = gain(base, mixed)
    assert found.improved == pytest.approx(0.8)
    assert found.fall == pytest.approx(np.sum(noise**2) - np.sum(mixed.whitened**2))
    assert found.standard_error == pytest.approx(np.linalg.norm(noise))


def test_a_fold_without_the_effect_is_no_objection():
    fold = np.arange(1000) % 5
    noise = np.random.default_rng(10).standard_normal(1000)
    certain = np.zeros((1000, 0))
    base = Prediction(1.0, (1.0,) * 5, 3 * noise, fold, certain)
    factors = np.array([3.0, 3.1, 1.0, 1.0, 1.0])  # fold 0 untouched, fold 1 a little worse
    one_worse = Prediction(1.0, (1.0,) * 5, factors[fold] * noise, fold, certain)
    assert gain(base, one_worse).improved == pytest.approx(0.8)
    assert gain(base, one_worse).convincing


def test_a_gain_within_the_noise_is_not_convincing():
    generator = np.random.default_rng(6)
    fold = np.arange(1000) % 5
    noise = generator.standard_normal(1000)
    certain = np.zeros((1000, 0))
    base = Prediction(1.0, (1.0,) * 5, noise, fold, certain)
    other = Prediction(
        1.0, (1.0,) * 5, noise + 0.1 * generator.standard_normal(1000), fold, certain
    )
    better = Prediction(0.5, (0.5,) * 5, 0.5 * noise, fold, certain)
    assert not gain(base, other).convincing
    assert gain(base, better).convincing


def test_each_model_answers_for_what_it_claims_to_know():
    generator = np.random.default_rng(12)
    fold = np.arange(200) % 5
    base, extended = (
        Prediction(1.0, (1.0,) * 5, size * generator.standard_normal(200), fold,
                   generator.standard_normal((200, 3)) * [1e-3, 1.0, 30.0])
        for size in (3.0, 1.0)
    )  # fmt: skip

    def squares(p: Prediction, inside: np.ndarray) -> float:
        covariance = np.eye(40) + p.spread[inside] @ p.spread[inside].T
        return float(p.whitened[inside] @ np.linalg.solve(covariance, p.whitened[inside]))

    found = gain(base, extended)
    falls = [squares(base, fold == k) - squares(extended, fold == k) for k in range(5)]
    assert found.fall == pytest.approx(np.sum(falls), rel=1e-9)
    # By how much the noise of each sample moves the fall.
    step, slopes = 1e-6, np.zeros(200)
    for k in range(200):
        moved = step * (np.arange(200) == k)
        noisier = [replace(p, whitened=p.whitened + moved) for p in (base, extended)]
        slopes[k] = (gain(*noisier).fall - found.fall) / step
    assert found.standard_error == pytest.approx(np.linalg.norm(slopes), rel=1e-3)


def test_a_fold_that_the_training_leaves_open_is_no_objection():
    fold = np.arange(1000) % 5
    noise = np.random.default_rng(7).standard_normal(1000)
    certain, open_ = np.zeros((1000, 0)), np.where(fold == 0, 3.0, 0.0)[:, None]
    off = np.where(fold == 0, 0.5, 0.0)
    base = Prediction(1.0, (1.0,) * 5, np.where(fold == 0, noise, 3 * noise), fold, certain)
    sure = Prediction(1.0, (1.0,) * 5, noise + off, fold, certain)
    unsure = Prediction(1.0, (1.0,) * 5, noise + off, fold, open_)
    assert gain(base, sure).improved == pytest.approx(0.8)
    assert gain(base, unsure).improved == 1.0


def test_what_training_leaves_open_excuses_no_worse_prediction_of_a_recording():
    """A cubic fitted within ±1 to what bends off beyond; its own numbers are open that far out."""
    generator, level = np.random.default_rng(9), np.linspace(-1.0, 1.0, 400)
    noise, fold = 0.02 * generator.standard_normal((2, 400)), np.arange(400) % 5
    train, further = np.tanh(level) + noise[0], np.tanh(4 * level) + noise[1]

    def predicted(powers: list[int]) -> Prediction:
        columns, beyond = (np.stack([u**p for p in powers], axis=1) for u in (level, 4 * level))
        error = further - beyond @ np.linalg.lstsq(columns, train)[0]
        spread = beyond @ np.linalg.inv(np.linalg.qr(columns)[1])
        folds = tuple(float(np.sqrt(np.mean(error[fold == k] ** 2))) for k in range(5))
        return Prediction(float(np.sqrt(np.mean(error**2))), folds, error / 0.02, fold, spread)

    line, cubic = predicted([1]), predicted([1, 3, 5, 7, 9])
    assert cubic.rmse > 10 * line.rmse
    assert gain(line, cubic).convincing  # for what it claims to know
    assert foretells_worse(predict_another, line, cubic)
    assert not foretells_worse(predict_another, cubic, line)
    assert not foretells_worse(predict_another, line, replace(line, rmse=1.9 * line.rmse))
    # Between stretches no model is worse for what its neighbours do not tell.
    assert not foretells_worse(predict_stretches, line, cubic)


def predict_another(*_: Any) -> Any:
    """Stands for the prediction of a recording."""


def test_a_fold_speaks_against_an_effect_beyond_its_own_standard_error():
    fold = np.arange(1000) % 5
    noise = np.random.default_rng(8).standard_normal(1000)
    certain = np.zeros((1000, 0))
    base = Prediction(1.0, (1.0,) * 5, noise, fold, certain)
    # An error that has nothing to do with the noise, of 1.9 and of 2.1 standard errors.
    for size, said in ((1.9, 1.0), (2.1, 0.8)):
        wrong = np.where(fold == 0, np.roll(noise, 100), 0.0)
        wrong -= np.where(fold == 0, noise * (wrong @ noise) / np.sum(noise[fold == 0] ** 2), 0.0)
        wrong *= size / np.linalg.norm(wrong)
        found = gain(base, Prediction(1.0, (1.0,) * 5, noise + wrong, fold, certain))
        assert found.standard_error == pytest.approx(2 * size)
        assert found.fall == pytest.approx(-(size**2))
        assert found.improved == pytest.approx(said)


def test_a_stretch_that_the_others_do_not_foretell_does_not_count_in_the_rmse():
    fold = np.arange(1000) % 5
    noise = np.random.default_rng(11).standard_normal(1000)
    spread = np.where(fold == 2, 1e3, 0.0)[:, None]
    wild = Prediction(9.0, (1.0, 1.0, 1e3, 1.0, 1.0), noise + spread[:, 0], fold, spread)
    base = Prediction(2.0, (2.0,) * 5, 3 * noise, fold, np.zeros((1000, 0)))
    found = gain(base, wild)
    assert found.foretold == (True, True, False, True, True)
    assert found.convincing
    assert found.extended_rmse == pytest.approx(1.0)
    assert found.share_of_rmse == pytest.approx(0.5)


def test_a_drift_that_two_recordings_have_each_for_itself_is_named():
    generator, few = np.random.default_rng(3), 700
    recordings = [
        fj.Recording(u, response(u) + rise * TIMES[:few] + SIGMA * generator.standard_normal(few),
                     STEP, "V", "um")
        for u, rise in ((DRIVE[:few], 0.2), (OTHER[:few], -0.1))
    ]  # fmt: skip
    found = fj.diagnose(CREEP, recordings, noise=SIGMA)
    (effect,) = found.effects
    assert (effect.name, effect.confusable_with) == ("thermal_drift", ())
    slopes = {e.name: e for e in effect.parameters if e.name.startswith("slope")}
    for name, true in (("slope@1", 0.2), ("slope@2", -0.1)):
        assert abs(slopes[name].value - true) < 4 * slopes[name].standard_error
    assert found.held_out.extended_rmse == pytest.approx(SIGMA, rel=0.1)


def test_a_drive_of_few_periods_is_set_aside_in_as_many_stretches_as_any():
    drive = 50 + 30 * np.sin(2 * np.pi * 2.5 * TIMES)
    solved, preparation = fitted(CREEP.block, drive, response(drive), white(), np.zeros(SAMPLES))
    assert preparation.takes[0].recording.drive_period() is not None
    folds = predict_stretches(solved, preparation).fold_of_sample
    # Its period is exactly a fifth of the record.
    assert np.count_nonzero(np.diff(folds)) == 21


def test_what_is_held_out_of_steady_motion_is_itself_steady_where_it_ends_as_it_began():
    def one_period(tones: list[int], history: History) -> fj.Recording:
        drive = 40 + 9 * np.sum([np.cos(np.pi * k * (TIMES + 0.1 * k)) for k in tones], axis=0)
        answer = fj.simulate(CREEP.with_values({"k_c": 0.1, "mu": 0.3}), drive, STEP, history)
        return fj.Recording(drive, answer.response, STEP)

    preparation = prepare([one_period([1, 2, 5], "periodic")], history="periodic", noise=white())
    steady = held_out_take(preparation.takes[0], one_period([1, 3, 4], "periodic"))
    begun = held_out_take(preparation.takes[0], one_period([1, 3, 4], "constant"))
    assert (steady.history, begun.history) == ("periodic", "constant")
