"""Grade a folder of diagnoses of the second tier against the labels.

Run: python -m benchmarks.concealed.inexact.grade --exam DIR --answers OUT --to FOLDER
     [--half sealed] [--cases 0:60]

OUT holds case_0001/diagnosis.json and so on.  Writes grade.csv (measure, target, value, low, high,
n), by_group.csv (the shares again by base, drive, believed model, noise floor and effect),
failures.csv (every case that missed a measure) and labels.sha256.  A case without a diagnosis
names nothing.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ..answers import Answer
from ..exam import part_of
from ..grade import load, print_rows, table, write_rows
from ..measures import Measure, Pair
from .design import HALVES
from .measures import dynamics_named, measure_all, separable, shares

GROUPS: dict[str, Callable[[dict], str]] = {
    "base": lambda x: x["base"],
    "drive": lambda x: x["drive"],
    "believed": lambda x: x["believed"],
    "floor": lambda x: x["floor"],
}
SECONDS = "seconds.txt"


def by_group(pairs: Sequence[Pair]) -> list[dict]:
    """Each share of the table on one group's cases alone; what is named, on one effect's."""
    rows = []
    for grouping, of in GROUPS.items():
        for group in sorted({of(x) for x, _ in pairs}):
            mine = [p for p in pairs if of(p[0]) == group]
            some = [m for m in shares(mine) if m.n]
            rows += [{"by": grouping, "group": group} | row for row in table(some)]
    effects = separable(pairs)
    for name in sorted({x["one"]["name"] for x, _ in effects}):
        mine = [p for p in effects if p[0]["one"]["name"] == name]
        rows += [{"by": "effect", "group": name} | row for row in table([dynamics_named(mine)])]
    return rows


def failures(measures: Sequence[Measure], pairs: Sequence[Pair]) -> list[dict]:
    """One row per missed measure and case."""
    by_name = {x["case"]: (x, a) for x, a in pairs}
    return [
        {"measure": m.name, "case": case} | _describe(*by_name[case.split(":")[0]])
        for m in measures
        for case in m.failures
    ]


def _describe(x: dict, a: Answer) -> dict:
    return {
        "truth": "+".join(f"{e['name']}({e['level']:.2g})" for e in x["effects"]) or "none",
        "look_alikes": " ".join(sorted({k for e in x["effects"] for k in e["look_alikes"]})),
        "verdict": a.verdict,
        "said": "+".join(a.names),
        "confusable_with": " ".join(sorted(a.reported - set(a.names))),
        "base": x["base"],
        "believed": x["believed"],
        "drive": x["drive"],
        "noise": x["noise"]["colour"],
        "floor": x["floor"],
    }


def seconds(answers: Path, pairs: Sequence[Pair]) -> list[dict]:
    """Median, 95th percentile and longest of the times in seconds beside the answers."""
    files = [answers / x["case"] / SECONDS for x, _ in pairs]
    times = [float(f.read_text()) for f in files if f.exists()]
    if not times:
        return []
    parts = {"median": 50, "95th percentile": 95, "longest": 100}
    blank = {"target": "", "low": "", "high": "", "n": len(times)}
    return [
        {"measure": f"seconds, {k}", "value": f"{np.percentile(times, q):.1f}"} | blank
        for k, q in parts.items()
    ]


def main() -> None:
    """Command line: grade and write the tables."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--exam", type=Path, required=True, help="folder with labels.json")
    p.add_argument("--answers", type=Path, required=True, help="folder of case_0001/diagnosis.json")
    p.add_argument("--to", type=Path, required=True, help="folder for the tables")
    p.add_argument("--half", choices=HALVES, help="only this half of the cases")
    p.add_argument("--cases", type=part_of, default=slice(None), help="a part, such as 0:60")
    a = p.parse_args()
    pairs = [p for p in load(a.exam, a.answers) if a.half in (None, p[0]["half"])][a.cases]
    measures = measure_all(pairs)
    rows = [*table(measures), *seconds(a.answers, pairs)]
    groups = by_group(pairs)
    a.to.mkdir(parents=True, exist_ok=True)
    write_rows(a.to / "grade.csv", rows)
    write_rows(a.to / "by_group.csv", groups)
    write_rows(a.to / "failures.csv", failures(measures, pairs))
    (a.to / "labels.sha256").write_text((a.exam / "labels.sha256").read_text())
    print_rows(rows)
    for grouping in (*GROUPS, "effect"):
        print(f"\nby {grouping}:")
        for row in groups:
            if row["by"] == grouping and row["target"]:
                print(f"{row['group']:22}", end="")
                print_rows([row])


if __name__ == "__main__":
    main()
