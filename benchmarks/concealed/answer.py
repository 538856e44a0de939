"""Diagnose an exam's cases by the package's public functions, as its users would.

Run: python -m benchmarks.concealed.answer --exam DIR --answers OUT [--cases 0:100] [--jobs 2]

Of a case it reads the recordings and the name of the model that is to be questioned; of the labels
nothing else.  It writes OUT/case_0001/diagnosis.json, and skips what is there already.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path


def answer(case: dict, exam: Path, answers: Path) -> str:
    """Diagnose one case; what happened, in a line."""
    import fracjax as fj

    folder = answers / case["case"]
    if (folder / "diagnosis.json").exists():
        return f"{case['case']}: there already"
    began = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    recording = fj.read(exam / f"{case['case']}.csv")
    holdout = fj.read(exam / case["holdout"]) if case["holdout"] else None
    try:
        diagnosis = fj.diagnose(fj.parse_model(case["base"]), recording, holdout=holdout)
    except Exception as error:  # one failure is a failed case, not the end of the exam
        return f"{case['case']}: failed, {type(error).__name__}: {error}"
    diagnosis.save(folder / "diagnosis.json")
    seconds = time.perf_counter() - began
    (folder / "seconds.txt").write_text(f"{seconds:.2f}\n")
    named = " ".join(e.name for e in diagnosis.effects)
    return f"{case['case']}: {diagnosis.verdict} {named} ({seconds:.1f} s)"


def main() -> None:
    """Answer all cases, a line each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--exam", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True)
    parser.add_argument("--cases", default=":")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    # Workers inherit it: what one has compiled the other need not.
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(options.answers / ".programs"))
    labels = json.loads((options.exam / "labels.json").read_text())
    first, last = (int(end) if end else None for end in options.cases.split(":"))
    told = ("case", "holdout", "base", "samples")
    cases = [{key: label.get(key) for key in told} for label in labels[first:last]]
    # Recordings of like length share compiled programs.
    cases.sort(key=lambda case: (case["samples"] or 0, case["base"]))
    work = partial(answer, exam=options.exam, answers=options.answers)
    with ProcessPoolExecutor(options.jobs, get_context("spawn")) as pool:
        for line in pool.map(work, cases):
            print(line, flush=True)


if __name__ == "__main__":
    main()
