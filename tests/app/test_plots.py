"""What the page says of results."""

from pathlib import Path

import numpy as np
import pytest

import fracjax as fj
from fracjax._app._plots import Plots
from fracjax._app._texts import on_the_page
from fracjax._fit import compare_fits
from tests.results import diagnosis_of, small_fit


def recording(seed: int) -> fj.Recording:
    drive = 50 - 50 * np.cos(2 * np.pi * np.arange(400) / 100)
    noise = 0.01 * np.random.default_rng(seed).normal(size=400)
    return fj.Recording(drive, 0.1 * drive + noise, 0.01, "V", "um", source=f"run{seed}.csv")


@pytest.mark.parametrize("held_out", [False, True])
def test_a_fit_is_told_with_its_scores_and_parameters(held_out):
    fitted = fj.fit("gain", recording(0), starts=1)
    result = compare_fits([fitted], holdout=recording(1)) if held_out else fitted
    plots = Plots()
    plots.show(recording(0), [])
    text = plots.take(result)
    sentence, scores, parameters = text.split("\n\n")
    assert sentence.startswith("gain describes run0.csv")
    assert ("RMSE, held-out data" in scores) == held_out
    assert "| k | 0.100" in parameters
    assert list(plots.choices().values()) == [0]


def test_a_diagnosis_lists_its_candidates():
    diagnosis = diagnosis_of(small_fit())
    candidates = Plots().take(diagnosis).split("\n\n")[-1]
    assert candidates.startswith("| effect | score |")
    assert "| drive_lag | 11.5 | reason 1 |" in candidates


@pytest.mark.parametrize(
    ("refusal", "shown"),
    [
        (
            "/home/me/run.csv: expected columns for input and output, found 2; give --input a and "
            "--output 'b c', or --input 'b c' and --output a.",
            "run.csv: expected columns for input and output, found 2; choose the drive column a "
            "and the response column 'b c', or the drive column 'b c' and the response column a.",
        ),
        (
            "/home/me/run.csv: expected one unit; give --unit drive=V or --unit drive=kV.",
            "run.csv: expected one unit; choose the drive unit V or the drive unit kV.",
        ),
        ("/home/me/a.csv: too short; give --rate 200Hz or --clock ms.",
         "a.csv: too short; choose the sampling rate 200Hz or the time unit ms."),
    ],
)  # fmt: skip
def test_a_refusal_names_the_fields_of_the_page(refusal, shown):
    assert on_the_page(refusal, Path("/home/me")) == shown
