"""Predictions of data that no fit has seen."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._diagnose import held_out_take
from fracjax._diagnose._findings import Findings
from fracjax._diagnose._fitted import Fitted, fitted
from fracjax._diagnose._held_out import (
    FOLDS,
    Prediction,
    fold_of_sample,
    predict_recording,
    predict_stretches,
)
from fracjax._operators._grid import History
from fracjax._parameters import set_values
from fracjax._prepare import Noise, Preparation, prepare, take_of
from tests.diagnose.helpers import relaxing_after_a_step, white

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


def fit_of(
    block: Any, drive: np.ndarray, clean: np.ndarray, noise: Noise, error: np.ndarray
) -> Fitted:
    recording = fj.Recording(drive, clean + error, STEP, "V", "um")
    return fitted([block], prepare([recording], history="constant", settling=0, noise=noise))


def prepare_alone(drive: np.ndarray) -> Preparation:
    return prepare([fj.Recording(drive, 0.1 * drive, STEP, "V", "um")], noise=white(SIGMA))


def with_effect(name: str) -> Any:
    effect = EFFECTS[name]
    return effect.insert(CREEP.block, effect.trials(prepare_alone(DRIVE).setting)[0])


def hum(phase: float, size: float) -> np.ndarray:
    return size * np.cos(2 * np.pi * 50 * TIMES + phase)


def test_lines_of_another_phase_and_size_are_read_from_the_recording_that_has_them():
    generator = np.random.default_rng(1)
    error = hum(0.3, 0.05) + SIGMA * generator.standard_normal(SAMPLES)
    block = set_values(with_effect("mains_interference"), {"second.frequency": 50.0})
    base, extended = (
        fit_of(b, DRIVE, response(DRIVE), white(SIGMA), error) for b in (CREEP.block, block)
    )
    other = response(OTHER) + hum(2.9, 0.08) + SIGMA * generator.standard_normal(SAMPLES)
    take = take_of(fj.Recording(OTHER, other, STEP, "V", "um"), white(SIGMA), "constant", 0)
    assert predict_recording(extended, take).rmse == pytest.approx(SIGMA, rel=0.1)
    assert predict_recording(base, take).rmse > 4 * SIGMA


@pytest.mark.parametrize("pole", [0.0, 0.6])
def test_the_zero_of_another_recording_costs_little_of_its_rmse(pole):
    """Read from twenty samples it would cost 2.5 and 10 %."""
    generator = np.random.default_rng(3)
    sigma = SIGMA / np.sqrt(1 - pole**2)
    noise = Noise(sigma, "um", "specification", np.array([1, -pole]), SIGMA)
    base = fit_of(CREEP.block, DRIVE, response(DRIVE), noise, coloured(generator, pole))
    rmse = []
    for _ in range(40):
        measured = response(OTHER) + 3.0 + coloured(generator, pole)
        recording = fj.Recording(OTHER, measured, STEP, "V", "um")
        rmse.append(predict_recording(base, take_of(recording, noise, "constant", 0)).rmse)
    assert np.mean(np.square(rmse)) < 1.05 * sigma**2


def coloured(generator: np.random.Generator, pole: float) -> np.ndarray:
    """AR(1) noise (N,) of innovation sd SIGMA."""
    long = SIGMA * generator.standard_normal(2 * SAMPLES)
    return np.asarray(lfilter([1.0], [1.0, -pole], long))[SAMPLES:]


@pytest.mark.parametrize("seed", [1, 4])
def test_what_the_other_stretches_say_nothing_of_stays_in_its_usual_range(seed):
    """A drift as good as straight: without the first samples nothing tells its time constant."""
    error = SIGMA * np.random.default_rng(seed).standard_normal(SAMPLES)
    clean = response(DRIVE) + 0.02 * TIMES
    extended = fit_of(with_effect("thermal_drift"), DRIVE, clean, white(SIGMA), error)
    assert predict_stretches(extended).folds == pytest.approx((SIGMA,) * FOLDS, rel=0.15)


def refitted_errors(design: np.ndarray, measured: np.ndarray, fold: np.ndarray) -> np.ndarray:
    """Errors (N,) of each fold by least squares on the others."""
    errors = np.zeros(measured.size)
    for k in range(FOLDS):
        gains = np.linalg.lstsq(design[fold != k], measured[fold != k], rcond=None)[0]
        errors[fold == k] = (measured - design @ gains)[fold == k]
    return errors


def test_stretches_are_predicted_as_by_refits_of_a_linear_model():
    error = 0.5 * np.random.default_rng(5).standard_normal(SAMPLES)
    base = fit_of(CREEP.block, DRIVE, response(DRIVE), white(0.5), error)
    fold = fold_of_sample(base.preparation.takes[0].recording, SAMPLES)
    # Beside its order, which changes little, creep has a gain and an offset.
    tangent = base.tangent[:SAMPLES]
    unseen = refitted_errors(tangent, base.error[:SAMPLES], fold)
    seen = float(np.std(base.error[:SAMPLES]))
    rmse = float(np.sqrt(np.mean(unseen**2)))
    assert predict_stretches(base).rmse == pytest.approx(rmse, abs=0.05 * (rmse - seen))


def test_stretches_are_whole_periods_as_many_as_make_a_twentysecond():
    times = np.arange(2000) * 0.01
    recording = fj.Recording(np.sin(2 * np.pi * 5 * times), times, 0.01)
    # 2000 / 22 samples are rather five periods of 20 than four.
    assert np.array_equal(fold_of_sample(recording, 2000), np.arange(2000) // 100 % FOLDS)


def test_a_drive_of_few_periods_is_set_aside_in_as_many_stretches_as_any():
    drive = 50 + 30 * np.sin(2 * np.pi * 2.5 * TIMES)
    recording = fj.Recording(drive, 0.1 * drive, STEP)
    assert recording.drive_period() is not None
    # Its period is exactly a fifth of the record.
    assert np.count_nonzero(np.diff(fold_of_sample(recording, SAMPLES))) == 21


def test_a_drift_that_two_recordings_have_each_for_itself_is_named():
    generator, few = np.random.default_rng(3), 700
    recordings = [
        fj.Recording(u, response(u) + rise * TIMES[:few] + SIGMA * generator.standard_normal(few),
                     STEP, "V", "um")
        for u, rise in ((DRIVE[:few], 0.2), (OTHER[:few], -0.1))
    ]  # fmt: skip
    diagnosis = fj.diagnose(CREEP, recordings, noise=SIGMA)
    (effect,) = diagnosis.effects
    assert (effect.name, effect.confusable_with) == ("thermal_drift", ())
    slopes = {e.name: e for e in effect.parameters if e.name.startswith("slope")}
    for name, true in (("slope@1", 0.2), ("slope@2", -0.1)):
        assert abs(slopes[name].value - true) < 4 * slopes[name].standard_error
    assert diagnosis.held_out.extended_rmse == pytest.approx(SIGMA, rel=0.1)


def test_what_is_held_out_of_steady_motion_is_itself_steady_where_it_ends_as_it_began():
    def one_period(tones: list[int], history: History) -> fj.Recording:
        drive = 40 + 9 * np.sum([np.cos(np.pi * k * (TIMES + 0.1 * k)) for k in tones], axis=0)
        answer = fj.simulate(CREEP.with_values({"k_c": 0.1, "mu": 0.3}), drive, STEP, history)
        return fj.Recording(drive, answer.response, STEP)

    preparation = prepare(
        [one_period([1, 2, 5], "periodic")], history="periodic", noise=white(SIGMA)
    )
    steady = held_out_take(preparation.takes[0], one_period([1, 3, 4], "periodic"))
    begun = held_out_take(preparation.takes[0], one_period([1, 3, 4], "constant"))
    assert (steady.history, begun.history) == ("periodic", "constant")


@pytest.mark.slow
def test_what_rests_on_one_step_is_named_and_said_to():
    """Without the stretch with the step the others determine neither the gain nor a relaxation."""
    diagnosis = fj.diagnose("gain", relaxing_after_a_step(0.002), noise=0.002)
    assert {"viscoelastic_layer", "creep"} & {e.name for e in diagnosis.effects}
    # Three relaxations are none of the catalogue's laws: of a step of 5 N little more than the
    # noise is left.
    extended = diagnosis.held_out.extended_rmse
    assert extended is not None
    assert extended < 1.5 * 0.002
    assert len(diagnosis.held_out.extended_folds) < FOLDS
    assert any("such as a single step" in warning for warning in diagnosis.warnings)


@pytest.mark.parametrize(("ratio", "refuted"), [(0.5, False), (1.5, False), (2.5, True)])
def test_names_that_held_out_data_contradict_are_refuted(ratio, refuted):
    """On a recording of an elastomer's step a saturation, a cube and a skew of clocks explained the
    step alone."""
    before, after = (Prediction((e, e), (10, 10), (True, True)) for e in (1.0, ratio))
    findings: Any = SimpleNamespace(predicted=(before, after), follows_nothing=False)
    assert Findings.is_refuted.__get__(findings) == refuted
    findings.predicted = (before, None)
    assert not Findings.is_refuted.__get__(findings)
