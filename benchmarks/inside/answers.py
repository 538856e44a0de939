"""What the inquiry names inside eighty machines.

    python -m benchmarks.inside.answers [--cases 0:80] [--missing] [--to benchmarks/inside]

Right is the effect as the first name alone, or within the sets that hold .95 of the probability;
wrong is a name that is not there.  A machine's noise is given, as by a sensor's specification.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Sequence
from math import pi
from pathlib import Path
from typing import Any

import fracjax as fj
from fracjax import blocks
from fracjax._inside import Inside, inquire_inside
from fracjax._prepare import prepare

from .machines import RATES, Case, case

HEADER = ("case", "machine", "effect", "level", "share_percent", "named", "sets", "probability",
          "right", "wrong", "outside", "base_over_noise", "best_over_noise", "cpu_s")  # fmt: skip
MOST = 3
"""Effects of a set that still is an answer."""
ROOT = Path(__file__).parent


def machine_of(one: Case) -> Any:
    """The linear machine that the user believes in, with starting values of its size and speed."""
    rate = RATES[one.machine] / one.step
    gain = float(one.response.std() / one.drive.std())
    if one.machine == "oscillator":
        return blocks.Oscillator(gain, rate / (2 * pi), 0.1)
    if one.machine == "mass":
        return blocks.Mass(gain * rate, rate, of_velocity=True)
    return blocks.Lag(gain, (1 / rate,))


def answered(one: Case) -> tuple[Inside, float]:
    """The inquiry of a case, and the seconds of CPU time that it took."""
    recording = fj.Recording(one.drive, one.response, one.step, "V", "um", f"case {one.number}")
    began = time.process_time()
    preparation = prepare([recording], history="rest", settling=0, specification=one.noise)
    return inquire_inside(machine_of(one), preparation), time.process_time() - began


def row_of(one: Case) -> tuple:
    """The row of a case."""
    inside, seconds = answered(one)
    sets = [set(names) for names in inside.sets]
    truth = {one.effect} - {""}
    hit = inside.names == tuple(truth) or any(truth and truth <= s and len(s) <= MOST for s in sets)
    right = not inside.names if not truth else hit
    wrong = [n for n, s in zip(inside.names, sets, strict=True) if not s & truth]
    floors = [(fit.cost / one.response.size) ** 0.5 for fit in (inside.base, inside.extended)]
    return (
        one.number, one.machine, one.effect, one.level, f"{100 * one.share:.3g}",
        " + ".join(inside.names), " + ".join("|".join(s) for s in inside.sets),
        f"{inside.candidates[0].probability:.3f}", int(right), " ".join(wrong), inside.outside,
        *(f"{floor:.3f}" for floor in floors), f"{seconds:.1f}",
    )  # fmt: skip


def summary(rows: Sequence[dict[str, str]]) -> list[tuple[str, str]]:
    """The marks: what, and of how many."""

    def of(chosen: Sequence[dict[str, str]], good) -> str:
        return f"{sum(map(good, chosen))} of {len(chosen)}"

    def is_right(row: dict[str, str]) -> bool:
        return row["right"] == "1"

    with_effect = [r for r in rows if r["effect"]]
    levels = sorted({float(r["level"]) for r in with_effect})
    return [
        *(
            (f"right at {level:g} noise floors",
             of([r for r in with_effect if float(r["level"]) == level], is_right))
            for level in levels
        ),
        ("a name that is not there", of(rows, lambda r: bool(r["wrong"]))),
        ("nulls unnamed", of([r for r in rows if not r["effect"]], lambda r: not r["named"])),
    ]  # fmt: skip


def written(file: Path) -> dict[int, dict[str, str]]:
    """The rows that a table has, by case."""
    if not file.is_file():
        return {}
    with file.open(newline="") as read:
        return {int(row["case"]): row for row in csv.DictReader(read)}


def main() -> None:
    """Answer the cases and write the tables, in which rows of other cases stay."""
    p = argparse.ArgumentParser(description="Physics inside machines.")
    p.add_argument("--cases", default="0:80", help="first:last:step")
    p.add_argument("--missing", action="store_true", help="those that the table has not yet")
    p.add_argument("--to", type=Path, default=ROOT)
    a = p.parse_args()
    a.to.mkdir(parents=True, exist_ok=True)
    rows = written(a.to / "answers.csv")
    for number in range(80)[slice(*map(int, a.cases.split(":")))]:
        if a.missing and number in rows:
            continue
        answer = map(str, row_of(case(number)))
        rows[number] = dict(zip(HEADER, answer, strict=True))
        with (a.to / "answers.csv").open("w", newline="") as out:
            table = csv.DictWriter(out, HEADER, lineterminator="\n")
            table.writeheader()
            table.writerows(rows[k] for k in sorted(rows))
    marks = summary(list(rows.values()))
    with (a.to / "answers_summary.csv").open("w", newline="") as out:
        csv.writer(out, lineterminator="\n").writerows([("mark", "count"), *marks])
    for mark in marks:
        print(*mark)


if __name__ == "__main__":
    main()
