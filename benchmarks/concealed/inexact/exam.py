"""The second tier's exam: recordings of inexact laws, their labels, and the hash that seals them.

Run: python -m benchmarks.concealed.inexact.exam --out DIR [--half development] [--cases 0:60]

Writes case_0001.csv (and .holdout.csv for some), labels.json and labels.sha256, as the first tier
does.  A part is of the half that is asked for.  `--hash` writes labels.sha256 alone, so that nobody
need see the labels of the half that is sealed.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

from ..exam import part_of, plain, write_labels, write_seal
from .case import build
from .design import HALVES, Spec, design

SEED = 45260911
DIGITS = 5  # of the labels' numbers, on which every machine agrees


def make(spec: Spec, folder: Path | None) -> dict:
    """Build a case, write its recordings into a folder, and give its label."""
    case = build(spec)
    if folder is not None:
        case.write(folder, case.label["case"])
    return plain(case.label, DIGITS)


def labels_of(specs: Iterable[Spec], folder: Path | None, jobs: int) -> list[dict]:
    """Labels of the cases, whose recordings are written where there is a folder for them."""
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        return list(pool.map(partial(make, folder=folder), specs))


def describe(labels: Sequence[dict]) -> str:
    """Counts: cases by number of effects, effects that are separable, noise floors."""
    many = Counter(len(x["effects"]) for x in labels)
    effects = [e for x in labels for e in x["effects"]]
    dynamic = [e for e in effects if e["kind"] == "dynamic"]
    apart = sum(e["separable"] for e in dynamic)
    floors = Counter(x["floor"] for x in labels)
    return (
        f"effects beside the law {dict(sorted(many.items()))}; dynamic {len(dynamic)}, "
        f"separable {apart}; held out {sum(x['holdout'] is not None for x in labels)}; "
        f"floors {dict(sorted(floors.items()))}"
    )


def main() -> None:
    """Command line: write the exam, a half or a part of it."""
    p = argparse.ArgumentParser(description=main.__doc__)
    p.add_argument("--out", type=Path, required=True)
    p.add_argument("--seed", type=int, default=SEED)
    p.add_argument("--half", choices=HALVES, help="only this half of the cases")
    p.add_argument("--cases", type=part_of, default=slice(None), help="a part, such as 0:60")
    p.add_argument("--hash", action="store_true", help="only labels.sha256")
    p.add_argument("--jobs", type=int, default=1)
    a = p.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # for the workers: their products are small
    specs = [s for s in design(a.seed) if a.half in (None, s.half)][a.cases]
    a.out.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    labels = labels_of(specs, None if a.hash else a.out, a.jobs)
    if a.hash:
        write_seal(a.out, labels)
    else:
        write_labels(a.out, labels)
        print(f"{len(labels)} cases in {time.perf_counter() - start:.0f} s; {describe(labels)}")


if __name__ == "__main__":
    main()
