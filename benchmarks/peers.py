"""All comparisons with peers, one after the other, and what they say in one table.

    python -m benchmarks.peers
    python -m benchmarks.peers --gather

Each study runs in a process of its own and writes its own table, with linear algebra on one thread
for all alike: two threads of OpenBLAS wait for each other by spinning.  Twenty-five minutes to
three quarters of an hour on an idle machine of two cores.  Then peers.csv beside this program
gathers them: the time of each peer over fracjax's in the same run, above 1 where fracjax is faster.
`--gather` reads the tables as they stand, and runs nothing.  Peers that are not installed are left
out.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from docs.tables import rows_of

HERE = Path(__file__).parent
COLUMNS = ("study", "case", "measure", "peer", "over_fracjax")

Rows = list[dict[str, str]]
Ratio = tuple[str, str, str, float]


class Study(NamedTuple):
    """A program, the table that it writes, and the ratios in it: case, measure, peer, ratio."""

    module: str
    table: str
    ratios: Callable[[Rows], Iterator[Ratio]]


def of_operators(rows: Rows) -> Iterator[Ratio]:
    own = {row["N"]: float(row["seconds"]) for row in rows if row["method"] == "fracjax"}
    for row in rows:
        if not row["method"].startswith("fracjax"):
            ratio = float(row["seconds"]) / own[row["N"]]
            yield f"{int(row['N']):,} samples", "D^0.4 of a signal", row["method"], ratio


def of_fits(rows: Rows) -> Iterator[Ratio]:
    """Of one run: a swarm, or the best of all starts, be they timed together or run after run."""
    warm = [row for row in rows if not row["note"].startswith("cold")]
    runs = min(int(row["of"]) for row in warm)

    def seconds(row: dict[str, str]) -> float:
        return float(row["seconds"]) / (runs if int(row["of"]) == runs else 1)

    ours = "fracjax, gradient fit"
    own = {row["case"]: seconds(row) for row in warm if row["method"] == ours}
    for row in warm:
        if row["method"] != ours:
            yield row["case"], "a fit of FOH", row["method"], seconds(row) / own[row["case"]]


def of_batches(rows: Rows) -> Iterator[Ratio]:
    """Of the largest batches of each kind."""
    most: dict[tuple[str, str], int] = {}
    for row in rows:
        kind = row["drive"], row["samples"]
        most[kind] = max(most.get(kind, 0), int(row["recordings"]))
    paces = {(r["drive"], r["samples"], r["method"]): float(r["per_second"]) for r in rows
             if int(r["recordings"]) == most[r["drive"], r["samples"]]}  # fmt: skip
    # The peer reads files: fracjax's run from memory does not compare.
    own = {
        (drive, samples): pace
        for (drive, samples, method), pace in paces.items()
        if method.startswith("fracjax") and not method.endswith("from memory")
    }
    for (drive, samples, method), pace in paces.items():
        if not method.startswith("fracjax"):
            case = f"{drive} drive, {int(samples):,} samples"
            yield case, f"{most[drive, samples]:,} fits", method, own[drive, samples] / pace


def of_posteriors(rows: Rows) -> Iterator[Ratio]:
    """Densities as walkers ask for them, and draws of the chain that users get."""
    own = {(row["samples"], row["density"]): row for row in rows}
    for row in rows:
        case = f"{int(row['samples']):,} samples"
        for measure, column, density in (
            ("a log-density", "per_second", "compressed"),
            ("emcee's step of 32 walkers", "emcee_steps_per_second", "compressed"),
            ("an effective draw", "ess_per_second", "marginal"),
        ):
            if row["density"] in ("NumPy", "NUTS") and row[column]:
                best = float(own[row["samples"], density][column])
                yield case, measure, row["density"], best / float(row[column])


def of_diagnoses(rows: Rows) -> Iterator[Ratio]:
    for row in rows:
        if row["way"].startswith("refit all"):
            peer = f"SciPy, {row['way']}"
            yield f"{row['effect']} concealed", "a diagnosis", peer, float(row["times_warm"])


STUDIES = {
    "operators": Study("operators.run", "operators/results.csv", of_operators),
    "fits": Study("fitting.run", "fitting/results.csv", of_fits),
    "batches": Study("fitting.batch", "fitting/batch.csv", of_batches),
    "posteriors": Study("posterior.speed", "posterior/speed.csv", of_posteriors),
    "diagnoses": Study("concealed.speed", "concealed/speed.csv", of_diagnoses),
}


def run(study: Study) -> None:
    """The study anew, from an empty table."""
    table = HERE / study.table
    table.unlink(missing_ok=True)
    single = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, "-m", f"benchmarks.{study.module}", "--out", str(table)]
    subprocess.run(command, check=True, cwd=HERE.parent, env=os.environ | single)


def gathered() -> Iterator[dict[str, str]]:
    """The ratios of all tables that stand."""
    for name, study in STUDIES.items():
        for case, measure, peer, ratio in study.ratios(rows_of(study.table)):
            yield dict(zip(COLUMNS, (name, case, measure, peer, f"{ratio:.3g}"), strict=True))


def origins() -> Iterator[str]:
    """What each table was made with, and on: the line that it begins with."""
    for name, study in STUDIES.items():
        with (HERE / study.table).open(encoding="utf-8") as file:
            yield f"# {name}: {file.readline().removeprefix('# ')}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gather", action="store_true", help="read the tables as they stand")
    if not parser.parse_args().gather:
        for name, study in STUDIES.items():
            print(f"--- {name}", flush=True)
            run(study)
    with (HERE / "peers.csv").open("w", encoding="utf-8", newline="") as file:
        file.writelines(origins())
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(gathered())
    print((HERE / "peers.csv").read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
