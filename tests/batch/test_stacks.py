"""Recordings that are fitted together: as each alone, whatever stands next to it."""

import numpy as np
import pytest

import fracjax as fj
from fracjax._fit import _fit
from tests.batch.helpers import STEP, recording, told


def apart(row: dict, alone: fj.Fit) -> float:
    """The largest distance of a row's parameters from a fit's, in standard errors."""
    return max(abs(row[f"{e.name}.value"] - e.value) / e.standard_error for e in alone.estimates)


def test_rows_of_stacks_are_fits():
    """Of several lengths, one drive or own ones, coloured noise or white, and one in nm."""
    several = [recording(k, length, f"{k} {length}") for length in (250, 180) for k in range(3)]
    one_drive = [
        fj.Recording(
            several[0].drive, several[0].response + noise, STEP, "V", "um", source=f"shared {k}"
        )
        for k, noise in enumerate(0.01 * np.random.default_rng(0).standard_normal((4, 250)))
    ]
    slow = np.convolve(np.random.default_rng(1).standard_normal(260), np.ones(11) / 40, "valid")
    coloured = fj.Recording(
        several[1].drive, several[1].response + slow, STEP, "V", "um", source="coloured"
    )
    in_nm = fj.Recording(
        several[2].drive, 1000 * several[2].response, STEP, "V", response_unit="nm", source="nm"
    )
    recordings = [*several, *one_drive, coloured, in_nm]
    rows = told(recordings, starts=4)
    for one, row in zip(recordings, rows, strict=True):
        alone = fj.fit("creep", one, starts=4)
        assert (row["status"], row["stacked"]) == ("fitted", True)
        assert apart(row, alone) < 1e-3
        for e in alone.estimates:
            assert row[f"{e.name}.standard_error"] == pytest.approx(e.standard_error, rel=1e-3)
            flags = (row[f"{e.name}.identified"], row[f"{e.name}.at_bound"], row[f"{e.name}.unit"])
            assert flags == (e.identified, e.at_bound, e.unit)
        assert row["rmse"] == pytest.approx(alone.scores.rmse, rel=1e-6)
        assert row["oversampling"] == alone.preparation.oversampling
        assert row["history"] == alone.preparation.takes[0].history


def test_a_bad_recording_changes_nothing_for_the_others():
    good = [recording(k, source=f"good {k}") for k in range(3)]
    resting = fj.Recording(np.full(250, 5.0), good[0].response, STEP, "V", "um", source="resting")
    huge = fj.Recording(good[0].drive, 1e99 * good[0].response, STEP, "V", "um", source="huge")
    rows = {
        row["source"]: row for row in told([good[0], resting, good[1], huge, good[2]], starts=4)
    }
    assert rows["resting"]["status"] == "failed"
    assert "drive: expected a signal that varies" in rows["resting"]["reason"]
    for one in good:
        assert rows[one.source]["status"] == "fitted"
        assert apart(rows[one.source], fj.fit("creep", one, starts=4)) < 1e-3


def test_a_stack_that_fails_is_fitted_one_by_one(monkeypatch):
    together = _fit.settle_all_finely

    def settle(blocks, preparations, **options):
        if len(blocks) > 1 or preparations[0].takes[0].recording.source == "1":
            raise FloatingPointError("the ground gave way")
        return together(blocks, preparations, **options)

    monkeypatch.setattr(_fit, "settle_all_finely", settle)
    rows = told([recording(k, source=f"{k}") for k in range(4)], starts=4)
    assert [row["status"] for row in rows] == ["fitted", "failed", "fitted", "fitted"]
    assert rows[1]["reason"] == "FloatingPointError: the ground gave way"


def test_what_cannot_be_compressed_is_fitted_by_itself():
    (row,) = told([recording(0)], starts=4, loss="huber")
    assert row["stacked"]
    rows = fj.fit_batch("creep", [recording(0)], out="other", starts=4, priors={
        "mu": fj.Normal(0.01, 0.1)
    })  # fmt: skip
    assert rows["stacked"].tolist() == [False]
