"""What the page says of results."""

import numpy as np
import pytest

import fracjax as fj
from fracjax._app._plots import Plots
from fracjax._fit import compare_fits


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
