"""The exam: cases with neutral names, their labels, and the hash that seals the labels.

Run: python -m benchmarks.concealed.exam --out DIR [--cases 0:100 … | --subset ci] [--jobs 2]

Writes case_0001.csv (and .holdout.csv for some), labels.json and labels.sha256: SHA-256 of the
labels as canonical JSON (keys sorted, no spaces), which `grade.py` checks.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path as File
from typing import Any

from .build import Spec, build
from .design import CI, design, subset

SEED = 1619517


def canonical(labels: Sequence[dict]) -> str:
    """The labels as one line of JSON: keys sorted, no spaces."""
    return json.dumps(labels, sort_keys=True, separators=(",", ":"), allow_nan=False)


def seal(labels: Sequence[dict]) -> str:
    """SHA-256 of the canonical labels."""
    return hashlib.sha256(canonical(labels).encode()).hexdigest()


def part_of(text: str) -> slice:
    """A part of the list of cases, such as "0:100"."""
    first, last = (int(end) if end else None for end in text.split(":"))
    return slice(first, last)


def write_case(numbered: tuple[int, Spec], folder: File) -> dict:
    """Build and write one case; its label, with the case's name."""
    index, spec = numbered
    name = f"case_{index + 1:04d}"
    made = build(spec)
    made.write(folder, name)
    holdout = f"{name}.holdout.csv" if made.holdout is not None else None
    return plain({"case": name, "holdout": holdout} | made.label)


def plain(x: Any, digits: int = 8) -> Any:
    """As JSON would give it back, numbers to some digits."""
    if isinstance(x, dict):
        return {k: plain(v, digits) for k, v in x.items()}
    if isinstance(x, (list, tuple)):
        return [plain(v, digits) for v in x]
    return float(f"{x:.{digits}g}") if isinstance(x, float) else x


def write_exam(folder: File, numbered: Sequence[tuple[int, Spec]], jobs: int = 1) -> list[dict]:
    """Write the cases, labels.json and labels.sha256."""
    folder.mkdir(parents=True, exist_ok=True)
    work = partial(write_case, folder=folder)
    if jobs == 1:
        labels = [work(x) for x in numbered]
    else:
        with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
            labels = list(pool.map(work, numbered, chunksize=4))
    write_labels(folder, labels)
    return labels


def write_labels(folder: File, labels: Sequence[dict]) -> None:
    """Write labels.json and the hash that seals it."""
    (folder / "labels.json").write_text(json.dumps(labels, indent=1, sort_keys=True) + "\n")
    write_seal(folder, labels)


def write_seal(folder: File, labels: Sequence[dict]) -> None:
    """Write labels.sha256."""
    (folder / "labels.sha256").write_text(f"{seal(labels)}  labels\n")


def is_concealed(label: dict) -> bool:
    """Whether the refit hides nine tenths of its one effect's power behind R2 > .999."""
    return len(label["effects"]) == 1 and label["concealment"] >= 0.9 and label["R2"] > 0.999


def describe(labels: Sequence[dict]) -> str:
    """Counts: cases by kind, separable, capped, concealed."""
    kinds = {k: sum(x["kind"] == k for x in labels) for k in sorted({x["kind"] for x in labels})}
    truths = [e for x in labels for e in x["effects"] if e["catalogued"]]
    hidden = sum(is_concealed(x) for x in labels)
    apart, capped = sum(e["separable"] for e in truths), sum(e["capped"] for e in truths)
    return (
        f"{kinds}; effects: {len(truths)}, separable {apart}, capped {capped}; "
        f"concealed (C >= .9, R2 > .999): {hidden}"
    )


def main() -> None:
    """Command line: write an exam, or a part of it."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--out", type=File, required=True)
    p.add_argument("--seed", type=int, default=SEED)
    p.add_argument("--cases", type=part_of, nargs="+", default=[slice(None)],
                   help="parts of the list, such as 0:100")  # fmt: skip
    p.add_argument("--subset", choices=["ci"])
    p.add_argument("--kind", choices=list(CI), help="only cases of this kind")
    p.add_argument("--jobs", type=int, default=1)
    a = p.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # for the workers: their products are small
    specs = design(a.seed)
    which = subset(specs) if a.subset else range(len(specs))
    which = [k for k in which if a.kind in (None, specs[k].kind)]
    which = [k for part in a.cases for k in which[part]]
    start = time.perf_counter()
    labels = write_exam(a.out, [(k, specs[k]) for k in which], a.jobs)
    seconds = time.perf_counter() - start
    print(f"{len(labels)} cases in {seconds:.0f} s; {describe(labels)}")


if __name__ == "__main__":
    main()
