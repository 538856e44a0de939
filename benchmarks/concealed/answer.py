"""Diagnose an exam's cases by the package's public functions, as its users would.

Run: python -m benchmarks.concealed.answer --exam DIR --answers OUT [--cases 0:100] [--jobs 2]

Of a case it reads the recordings and the name of the model that is to be questioned; of the labels
nothing else.  It writes OUT/case_0001/diagnosis.json, with next_experiment.csv (s, V) where one is
proposed, and skips what is there already.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .exam import part_of

if TYPE_CHECKING:
    from fracjax import Diagnosis

NEXT = "next_experiment.csv"


def ask(case: dict, exam: Path, *new: Path) -> Diagnosis:
    """The diagnosis of a case's recording, and of new ones beside it."""
    import fracjax as fj

    recordings = [fj.read(file) for file in (exam / f"{case['case']}.csv", *new)]
    holdout = fj.read(exam / case["holdout"]) if case["holdout"] else None
    return fj.diagnose(fj.parse_model(case["base"]), recordings, holdout=holdout)


def keep(name: str, folder: Path, diagnose: Callable[[], Diagnosis]) -> str:
    """Write a diagnosis into a folder, unless there is one; what happened, in a line."""
    if (folder / "diagnosis.json").exists():
        return f"{name}: there already"
    began = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        diagnosis = diagnose()
    except Exception as error:  # one failure is a failed case, not the end of the exam
        return f"{name}: failed, {type(error).__name__}: {error}"
    diagnosis.save(folder / "diagnosis.json")
    if diagnosis.next_experiment is not None:
        drive = diagnosis.next_experiment.drive
        np.savetxt(folder / NEXT, np.column_stack([drive.times, drive.values]), "%.12g", ",")
    seconds = time.perf_counter() - began
    (folder / "seconds.txt").write_text(f"{seconds:.2f}\n")
    named = " ".join(e.name for e in diagnosis.effects)
    return f"{name}: {diagnosis.verdict} {named} ({seconds:.1f} s)"


def answer(case: dict, exam: Path, answers: Path) -> str:
    """Diagnose one case; what happened, in a line."""
    return keep(case["case"], answers / case["case"], partial(ask, case, exam))


def tell_each(work: Callable[[dict], str], cases: Iterable[dict], answers: Path, jobs: int) -> None:
    """Print what the work says of each case."""
    # Workers inherit it: what one has compiled the other need not.
    os.environ.setdefault("FRACJAX_CACHE", str(answers / ".programs"))
    # Recordings of like length share compiled programs.
    listed = sorted(cases, key=lambda case: (case["samples"] or 0, case["base"]))
    with ProcessPoolExecutor(jobs, get_context("spawn")) as pool:
        for line in pool.map(work, listed):
            print(line, flush=True)


def cases_of(exam: Path, part: slice) -> list[dict]:
    """What a diagnosis is given of the cases in a part of the list; `base` is the model that is
    questioned, which in the second tier is believed and not the truth's."""
    labels = json.loads((exam / "labels.json").read_text())
    told = ("case", "holdout", "samples")
    return [
        {key: label.get(key) for key in told} | {"base": label.get("believed", label["base"])}
        for label in labels[part]
    ]


def main() -> None:
    """Answer all cases, a line each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--exam", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True)
    parser.add_argument("--cases", type=part_of, default=":")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    work = partial(answer, exam=options.exam, answers=options.answers)
    tell_each(work, cases_of(options.exam, options.cases), options.answers, options.jobs)


if __name__ == "__main__":
    main()
