"""What is gathered from the studies' tables: ratios above 1 where fracjax is faster."""

from pathlib import Path

import pytest

from benchmarks.peers import HERE, STUDIES, gathered, of_batches, of_fits, of_posteriors
from docs.tables import rows_of


def test_the_table_is_what_the_studies_say():
    told = rows_of("peers.csv")
    assert told == list(gathered())
    assert {row["study"] for row in told} == set(STUDIES)


@pytest.mark.parametrize("study", STUDIES.values(), ids=STUDIES)
def test_a_study_is_a_program_with_a_table(study):
    path = Path(*study.module.split(".")).with_suffix(".py")
    assert '"--out"' in (HERE / path).read_text(encoding="utf-8")
    assert (HERE / study.table).exists()


def test_a_run_is_the_best_of_all_starts_however_it_was_timed():
    def row(method: str, of: int, seconds: float, note: str = "") -> dict[str, str]:
        return {"case": "a", "method": method, "of": str(of), "seconds": str(seconds), "note": note}

    rows = [
        row("fracjax, gradient fit", 16, 9.0, "cold: with compilation"),
        row("fracjax, gradient fit", 5, 1.0),
        row("swarm", 5, 50.0),
        row("SciPy", 16, 2.0),
    ]
    assert list(of_fits(rows)) == [
        ("a", "a fit of FOH", "swarm", pytest.approx(50.0)),
        ("a", "a fit of FOH", "SciPy", pytest.approx(10.0)),
    ]


def test_paces_become_times():
    batch = [
        {
            "drive": "own",
            "samples": "10",
            "method": method,
            "recordings": count,
            "per_second": pace,
        }
        for method, count, pace in (
            ("fracjax", "10", "9"),
            ("fracjax", "20", "8"),
            ("SciPy", "20", "2"),
        )
    ]
    assert [ratio for *_, ratio in of_batches(batch)] == [4.0]
    blank = {"samples": "10", "per_second": "", "emcee_steps_per_second": ""}
    draws = [
        blank | {"density": "marginal", "ess_per_second": "30"},
        blank | {"density": "compressed", "ess_per_second": "20"},
        blank | {"density": "NUTS", "ess_per_second": "10"},
    ]
    assert [ratio for *_, ratio in of_posteriors(draws)] == [3.0]
