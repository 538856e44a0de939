"""Would the tests notice?  Small faults are put into the core, one at a time.

    python -m benchmarks.mutation.run --out benchmarks/mutation/results.csv
    python -m benchmarks.mutation.run --folders _inside _blocks --out …/machines/results.csv

A sample of the places of the core (`FOLDERS` of the package) where something can go wrong
(`mutants.py`), each place as likely as another, in an order that the seed fixes: a longer sample
begins with the shorter one.  Each mutant stands in a copy of the repository, against the tests of
its file (`choice.py`), in one session (`session.py`), until one fails.  A session that does not end
in time counts as noticed.  A test that fails in the unharmed copy proves nothing and is left out;
the table says which.

Rows are added as they are found, and a run goes on where the last one ended; `--again` repeats the
survivors: of two rows of one mutant the later one counts.  So a quick run with `--nearest 2` leaves
few to one with all tests, and survivors are tried again after tests have been written for them.
A table belongs to one state of the package.  What is printed at the end stands in `summary.csv`
beside it.

FRACJAX_DATA is not needed.  FRACJAX_CACHE makes the tests several times as fast.
"""

from __future__ import annotations

import argparse
import csv
import random
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from benchmarks.fitting.tables import Table
from benchmarks.mutation.choice import sampled, tests_of
from benchmarks.mutation.mutants import Mutant, places
from benchmarks.mutation.session import session
from benchmarks.versions import versions

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (
    "_operators", "_prepare", "_solve", "_fit", "_frequency", "_crosscheck", "_diagnose",
)  # fmt: skip
MACHINES = ("_inside", "_blocks")
"""Of machines and the physics inside them, in a table of their own."""
COPIED = ("fracjax", "tests", "benchmarks", "pyproject.toml")
COLUMNS = ("number", "file", "line", "column", "mutation", "outcome", "by", "seconds")
KEY = ("number", "file", "line", "column", "mutation")
UNHARMED = "unharmed"  # instead of a mutant's number
PACKAGES = ("fracjax", "jax", "numpy", "scipy", "pytest")
# Of a session of tests [s], several times what it takes unharmed: of the time of the processor, for
# others may have the machine; and of the clock, for what waits for ever.
BUSY, WAITING = 600, 3600

# Sample -------------------------------------------------------------------------------------------


def sample(seed: int, folders: Sequence[str] = FOLDERS) -> list[Mutant]:
    """One mutant of every place, in an order of chance."""
    chance = random.Random(seed)
    every = [
        ways
        for folder in folders
        for path in sorted((ROOT / "fracjax" / folder).glob("*.py"))
        if path.name != "_programs.py" and sampled(path.as_posix())
        for ways in places(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    ]
    chance.shuffle(every)
    return [chance.choice(ways) for ways in every]


def key_of(number: int, mutant: Mutant) -> tuple[str, ...]:
    return str(number), mutant.file, str(mutant.line), str(mutant.column), mutant.mutation


# One mutant ---------------------------------------------------------------------------------------


class Trial:
    """A copy of the repository, in which mutants are tried."""

    def __init__(self, copy: Path, table: Table):
        self.copy, self.table = copy, table
        for name in COPIED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / name)

    def tried(self, mutant: Mutant, nearest: int | None) -> tuple[str, str]:
        """What became of a mutant, `killed`, `timeout` or `survived`, and by which test."""
        tests = tests_of(mutant.file)[:nearest]
        left_out = self.failing_unharmed(tests)
        with self.mutated(mutant):
            outcome, by = said_of(tests, self.copy, "-x", without=left_out)
        return outcome, by[0] if by else " ".join(tests)

    def failing_unharmed(self, tests: Sequence[str]) -> list[str]:
        """The tests of files that fail without any mutant, and prove nothing; each asked once."""
        asked = {row["file"]: row for row in self.table.rows() if row["number"] == UNHARMED}
        new = [test for test in tests if test not in asked]
        if new:
            began = time.perf_counter()
            failing = said_of(new, self.copy)[1]
            for test in new:
                by = "; ".join(name for name in failing if name.startswith(f"{test}::"))
                outcome = "failing" if by else "passed"
                add(self.table, (UNHARMED, test, "", "", ""), outcome, by, began)
            return self.failing_unharmed(tests)
        return [name for test in tests for name in asked[test]["by"].split("; ") if name]

    @contextmanager
    def mutated(self, mutant: Mutant) -> Iterator[None]:
        path = self.copy / mutant.file
        source = path.read_text(encoding="utf-8")
        path.write_text(mutant.apply(source), encoding="utf-8")
        try:
            yield
        finally:
            path.write_text(source, encoding="utf-8")


def said_of(
    tests: Sequence[str], copy: Path, *options: str, without: Sequence[str] = ()
) -> tuple[str, list[str]]:
    """What files of tests say, in one session, and which of their tests fail."""
    options = ("-n0", "--timeout=0", "-ofaulthandler_timeout=0", *options)
    left_out = (f"--deselect={name}" for name in without)
    path = copy / "failures.txt"
    status = session([*options, *left_out, *tests], copy, path, BUSY, WAITING)
    failing = path.read_text(encoding="utf-8").splitlines()
    if status == 0:
        return "survived", []
    if status is None or status == -signal.SIGXCPU:
        return "timeout", [tests[0]]
    if status < 0:
        return "killed", [f"signal {-status}"]
    # A fault that fails on import is noticed before any test: in a conftest.py there is no name.
    return "killed", failing or [f"status {status}"]


# All of them --------------------------------------------------------------------------------------


def without_torn_row(path: Path) -> None:
    """Cuts off a last row that a kill left unfinished."""
    if path.exists():
        text = path.read_bytes()
        path.write_bytes(text[: text.rfind(b"\n") + 1])


def outcomes(table: Table) -> dict[tuple[str, ...], dict[str, str]]:
    """The last row of each mutant."""
    rows = (row for row in table.rows() if row["number"] != UNHARMED)
    return {tuple(row[name] for name in KEY): row for row in rows}


def add(table: Table, key: tuple[str, ...], outcome: str, by: str, began: float) -> None:
    seconds = f"{time.perf_counter() - began:.0f}"
    table.add([dict(zip(COLUMNS, (*key, outcome, by, seconds), strict=True))])


def summary(table: Table, folders: Sequence[str]) -> Iterator[dict[str, str | int]]:
    """How many mutants of each folder were noticed."""
    last = outcomes(table).values()
    for folder in (*folders, "all"):
        count = Counter(
            row["outcome"] for row in last if folder in (*Path(row["file"]).parts, "all")
        )
        noticed = count["killed"] + count["timeout"]
        yield {
            "folder": folder, "mutants": count.total(), "noticed": noticed,
            "by_time": count["timeout"], "survived": count["survived"],
            "share": f"{noticed / max(count.total(), 1):.2f}",
        }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--mutants", type=int, default=100, help="How many, from the first.")
    parser.add_argument("--from", dest="part", help="A part of the sample instead, as 0:30.")
    parser.add_argument("--folders", nargs="+", default=FOLDERS, choices=FOLDERS + MACHINES)
    parser.add_argument(
        "--nearest", type=int, help="Files of tests for each mutant, from the first."
    )
    parser.add_argument("--again", action="store_true", help="Repeat those that survived.")
    options = parser.parse_args()
    first, last = map(int, (options.part or f"0:{options.mutants}").split(":"))
    mutants = enumerate(sample(options.seed, options.folders))
    keys = {key_of(number, mutant): mutant for number, mutant in mutants}
    without_torn_row(options.out)
    table = Table(options.out, COLUMNS, KEY, PACKAGES)
    known = outcomes(table)
    if not known.keys() <= keys.keys():
        parser.error(f"{options.out} was begun with another seed or another state of fracjax.")
    wanted = list(keys)[first:last]
    if options.again:
        wanted = [key for key in wanted if key in known and known[key]["outcome"] == "survived"]
    else:
        wanted = [key for key in wanted if key not in known]
    with tempfile.TemporaryDirectory() as folder:
        trial = Trial(Path(folder), table)
        for key in wanted:
            began = time.perf_counter()
            add(table, key, *trial.tried(keys[key], options.nearest), began)
    rows = list(summary(table, options.folders))
    with options.out.with_name("summary.csv").open("w", encoding="utf-8", newline="") as file:
        file.write(versions(PACKAGES))
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        print(*row.values(), sep="  ")


if __name__ == "__main__":
    main()
