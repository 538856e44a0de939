"""What a batch's table says as a whole, and its page."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from fracjax._batch import over_noise, overview, spreads
from fracjax._fit import FAR_ABOVE_NOISE
from fracjax._report import write_batch_report
from fracjax._report._batch_figures import distributions


@pytest.fixture
def rows() -> pd.DataFrame:
    """Twenty recordings: one in nm, one far above its noise, one at a bound, one that failed."""
    generator = np.random.default_rng(0)
    count = 20
    table = pd.DataFrame(
        {
            "source": [f"data/{k}.csv" for k in range(count)],
            "status": "fitted",
            "reason": "",
            "response_unit": "um",
            "k.value": 0.1 + 1e-3 * generator.standard_normal(count),
            "k.standard_error": 1e-3,
            "k.unit": "um/V*s^alpha",
            "k.at_bound": False,
            "rmse": 0.02,
            "noise_sigma": 0.02,
            "noise_method": "repeats",
            "stacked": True,
        }
    )
    in_nm = {"k.value": 1000, "k.standard_error": 1000, "rmse": 1000, "noise_sigma": 1000}
    for name, factor in in_nm.items():
        table.loc[3, name] *= factor
    table.loc[3, ["k.unit", "response_unit"]] = ["nm/V*s^alpha", "nm"]
    table.loc[5, "rmse"] = 2 * FAR_ABOVE_NOISE * 0.02
    table.loc[7, ["k.value", "k.at_bound"]] = [0.2, True]
    table.loc[9, ["status", "reason", "k.unit", "response_unit"]] = [
        "failed",
        "no <reason>",
        "",
        "",
    ]
    table.loc[9, ["k.value", "k.standard_error", "rmse", "noise_sigma"]] = np.nan
    table.loc[11, "noise_method"] = "residual"
    return table


def test_parameters_are_compared_in_one_unit(rows):
    rmse, k = spreads(rows)
    assert (rmse.unit, k.unit) == ("um", "um/V*s^alpha")
    assert k.values[3] == pytest.approx(rows.loc[3, "k.value"] / 1000)
    assert k.errors[3] == pytest.approx(1e-3)
    assert np.flatnonzero(k.outlying).tolist() == [7]
    assert np.isnan(k.values[9])
    assert k.quantile(0.5) == pytest.approx(0.1, abs=2e-3)


def test_parameters_of_units_of_another_kind_have_a_row_of_their_own(rows):
    rows.loc[:4, ["k.unit", "response_unit"]] = ["mrad/V*s^alpha", "mrad"]
    spread = {(each.name, each.unit): each for each in spreads(rows)}
    assert {unit for name, unit in spread if name == "k"} == {"um/V*s^alpha", "mrad/V*s^alpha"}
    counted = [np.isfinite(each.values).sum() for (name, _), each in spread.items() if name == "k"]
    assert sum(counted) == (rows["status"] == "fitted").sum()


def test_what_is_within_its_error_is_no_outlier_however_alike_the_others_are(rows):
    rows["k.value"] = 0.1 + 1e-9 * np.exp(np.arange(len(rows)) / 2)
    rows.loc[3, ["k.unit", "response_unit"]] = ["um/V*s^alpha", "um"]
    assert not spreads(rows)[1].outlying.any()
    rows["k.standard_error"] = 1e-12
    assert spreads(rows)[1].outlying.any()


def test_values_that_are_alike_but_for_rounding_are_drawn(rows):
    rows.loc[3, ["k.unit", "response_unit"]] = ["um/V*s^alpha", "um"]
    rows["k.value"] = 0.1 * (1 + 1e-16 * np.arange(len(rows)))
    assert "<svg" in distributions(spreads(rows), np.arange(len(rows)))


def test_a_parameter_per_drive_is_compared_in_one_unit_too(rows):
    rows["k.unit"] = "1/V"
    rows.loc[3, "k.unit"] = "1/mV"
    rows.loc[3, "k.value"] = 1e-4
    k = spreads(rows)[1]
    assert k.unit == "1/V"
    assert k.values[3] == pytest.approx(0.1)


def test_a_fit_is_compared_with_noise_that_was_measured(rows):
    ratio = over_noise(rows)
    assert ratio[5] == pytest.approx(2 * FAR_ABOVE_NOISE)
    assert np.isnan(ratio[[9, 11]]).all()
    assert overview(rows) == {
        "at a bound": 1,
        "far above the noise": 1,
        "of unknown noise": 1,
        "fitted in a stack": 19,
    }


def test_every_point_of_the_page_leads_to_a_row(rows):
    write_batch_report(rows, "creep", "page.html")
    page = Path("page.html").read_text()
    targets = set(re.findall(r'href="#(row-\d+)"', page))
    assert targets == {f"row-{k}" for k in range(20) if k != 9}
    assert targets < set(re.findall(r'id="(row-\d+)"', page))
    assert "k at a bound; k is an outlier" in page
    assert "no &lt;reason&gt;" in page
    assert "of 20 recordings 19 fitted, 1 failed; of the fitted, 1 with a parameter at" in page
    assert not re.findall(r'(?:src|href)="(?!#)', page), "the page is self-contained"


def test_the_page_of_a_batch_in_which_nothing_was_fitted(rows):
    write_batch_report(rows.loc[[9]], "creep", "page.html")
    assert "of 1 recordings 1 failed" in Path("page.html").read_text()
