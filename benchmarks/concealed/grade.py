"""Grade a folder of diagnoses against the sealed labels.

Run: python -m benchmarks.concealed.grade --exam DIR --answers OUT --to FOLDER [--cases 0:100]

OUT holds case_0001/diagnosis.json and so on. Writes grade.csv (measure, target, value, low, high,
n), concealed.csv (the same of the concealed cases alone), failures.csv (every case that missed a
measure) and by_effect.csv. A case without a diagnosis counts as failed in every measure that it
belongs to.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Iterable, Sequence
from pathlib import Path as File

from .answers import Answer, read_answer
from .exam import is_concealed, part_of, seal
from .measures import FAINT, Measure, Pair, followed, measure_all, single, truth_of, wilson


def load(exam: File, answers: File, part: slice = slice(None)) -> list[Pair]:
    """A part of the labels, whose hash must be the sealed one, with the answers to them."""
    labels = json.loads((exam / "labels.json").read_text())
    sealed = (exam / "labels.sha256").read_text().split()[0]
    if seal(labels) != sealed:
        raise SystemExit(f"labels.json has not the sealed hash {sealed}")
    return [(x, read_answer(answers / x["case"] / "diagnosis.json")) for x in labels[part]]


def failures(measures: Sequence[Measure], pairs: Sequence[Pair]) -> list[dict]:
    """One row per missed measure and case."""
    known = {x["case"]: (x, a) for x, a in (*pairs, *followed(pairs))}
    rows = []
    for m in measures:
        for case in m.failures:
            x, a = known[case.split(":")[0]]
            rows.append({"measure": m.name, "case": case} | _describe(x, a))
    return rows


def _describe(x: dict, a: Answer) -> dict:
    return {
        "kind": x["kind"],
        "truth": "+".join(e["name"] for e in x["effects"]) or "none",
        "verdict": a.verdict,
        "said": "+".join(a.names),
        "confusable_with": " ".join(sorted(a.reported - set(a.names))),
        "level": f"{x['level']:.3g}",
        "concealment": f"{x['concealment']:.4f}",
        "base": x["base"],
        "drive": x["spec"]["drive"],
        "noise": x["noise"],
    }


def by_effect(pairs: Sequence[Pair]) -> list[dict]:
    """Per effect: separable first names that are right, and sets that hold the truth."""
    rows = []
    every = single(pairs, FAINT)
    for name in sorted({truth_of(x)["name"] for x, _ in every}):
        mine = [(truth_of(x), a) for x, a in every if truth_of(x)["name"] == name]
        apart = [a.first == name for e, a in mine if e["separable"]]
        held = [name in a.reported for _, a in mine]
        low, high = wilson(sum(apart), len(apart))
        rows.append({
            "effect": name, "separable": len(apart), "first_right": sum(apart),
            "low": f"{low:.3f}", "high": f"{high:.3f}", "cases": len(held), "in_set": sum(held),
        })  # fmt: skip
    return rows


def table(measures: Iterable[Measure]) -> list[dict]:
    """The measures as rows."""
    return [
        {
            "measure": m.name, "target": m.target, "value": f"{m.value:.4f}",
            "low": f"{m.low:.4f}", "high": f"{m.high:.4f}", "n": m.n,
        }
        for m in measures
    ]  # fmt: skip


def concealed(pairs: Sequence[Pair]) -> list[Measure]:
    """The measures on the cases whose effect the base conceals, as far as it has such cases."""
    return [m for m in measure_all([p for p in pairs if is_concealed(p[0])]) if m.n]


def write_rows(file: File, rows: Sequence[dict]) -> None:
    """A CSV with the first row's keys as header; an empty file for no rows."""
    with file.open("w", newline="") as f:
        if rows:
            w = csv.DictWriter(f, list(rows[0]), lineterminator="\n")
            w.writeheader()
            w.writerows(rows)


def print_rows(rows: Iterable[dict]) -> None:
    """A table's rows, a line each."""
    for row in rows:
        print(f"{row['measure']:48} {row['target']:>11} {row['value']:>8}  "
              f"[{row['low']}, {row['high']}]  n = {row['n']}")  # fmt: skip


def main() -> None:
    """Command line: grade and write the tables."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--exam", type=File, required=True, help="folder with labels.json")
    p.add_argument("--answers", type=File, required=True, help="folder of case_0001/diagnosis.json")
    p.add_argument("--to", type=File, required=True, help="folder for the tables")
    p.add_argument("--cases", type=part_of, default=":", help="part of the labels, such as 0:100")
    a = p.parse_args()
    pairs = load(a.exam, a.answers, a.cases)
    measures = measure_all(pairs)
    whole, hidden = table(measures), table(concealed(pairs))
    a.to.mkdir(parents=True, exist_ok=True)
    write_rows(a.to / "grade.csv", whole)
    write_rows(a.to / "concealed.csv", hidden)
    write_rows(a.to / "failures.csv", failures(measures, pairs))
    write_rows(a.to / "by_effect.csv", by_effect(pairs))
    print_rows(whole)
    print("\nconcealed (C >= .9, R2 > .999):")
    print_rows(hidden)


if __name__ == "__main__":
    main()
