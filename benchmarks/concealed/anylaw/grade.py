"""Mark the third tier's answers.

Of a folder with labels.json and labels.sha256, and one with 001/diagnosis.json and so on, it writes
grade.csv (measure, target, value, low, high, n), by_group.csv (two of them again by kind of memory,
law, drive, model, colour of the noise and effect), failures.csv (every case that missed a measure)
and labels.sha256.  A case without a diagnosis names nothing, and says nothing of what can be shown.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from ..answers import Answer
from ..grade import load, print_rows, table, write_rows
from ..inexact.grade import seconds
from ..measures import Measure, Pair
from .measures import floors, invented, measure_all, right, shown

GROUPS: dict[str, Callable[[dict], str]] = {
    "memory": lambda x: x["memory"],
    "base": lambda x: x["base"],
    "drive": lambda x: x["drive"],
    "recordings": lambda x: str(len(x["files"])),
    "model": lambda x: x["believed"] or "none",
    "noise": lambda x: x["noise"]["colour"] + (", given" if x["noise"]["given"] else ""),
}


def by_group(pairs: Sequence[Pair]) -> list[dict]:
    """What is invented and what is right, on one group's cases alone."""
    rows = []
    for grouping, of in GROUPS.items():
        for group in sorted({of(x) for x, _ in pairs}):
            mine = [p for p in pairs if of(p[0]) == group]
            some = [m for m in (invented(mine), right(shown(mine))) if m.n]
            rows += [{"by": grouping, "group": group} | row for row in table(some)]
    effects = shown(pairs)
    for key in sorted({x["one"]["key"] for x, _ in effects}):
        mine = [p for p in effects if p[0]["one"]["key"] == key]
        rows += [{"by": "effect", "group": key} | row for row in table([right(mine)])]
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
    truth = [f"{e['key']}({e['detectability_any']:.3g})" for e in x["effects"]]
    alike = {k for e in x["effects"] for k in e["accepted_any"][1:]}
    return {
        "truth": "+".join(truth) or "none",
        "accepted": " ".join(sorted(alike)),
        "verdict": a.verdict,
        "said": "+".join(f"{e['name']}({e['probability']:.2f})" for e in a.effects),
        "confusable_with": " ".join(sorted(a.reported - set(a.names))),
        "floors": f"{floors(x, a):.3g}",
        "law": x["base"],
        "model": x["believed"] or "none",
        "drive": "+".join(k for k in (x["drive"], x["second_drive"]) if k),
        "noise": x["noise"]["colour"],
    }


def grade_all(labels: Path, answers: Path, to: Path, part: slice) -> None:
    """Mark the answers of a part and write the tables."""
    pairs = load(labels, answers, part)
    measures = measure_all(pairs)
    rows = [*table(measures), *seconds(answers, pairs)]
    groups = by_group(pairs)
    to.mkdir(parents=True, exist_ok=True)
    write_rows(to / "grade.csv", rows)
    write_rows(to / "by_group.csv", groups)
    write_rows(to / "failures.csv", failures(measures, pairs))
    (to / "labels.sha256").write_text((labels / "labels.sha256").read_text())
    print_rows(rows)
    for grouping in (*GROUPS, "effect"):
        print(f"\nby {grouping}:")
        for row in groups:
            if row["by"] == grouping:
                print(f"{row['group']:26}", end="")
                print_rows([row])
