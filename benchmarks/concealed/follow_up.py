"""Make the recordings that diagnoses recommend, and ask again with them.

Run: python -m benchmarks.concealed.follow_up --exam DIR --answers OUT [--jobs 2]

Of the cases whose effect has look-alikes it takes those that were answered so, `confusable`, with a
drive to record next: the same truth on that drive is OUT/case_0001/after/recording.csv, and
OUT/case_0001/after/diagnosis.json the diagnosis of both recordings, as grade.py reads it.  What is
there already is skipped.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import BSpline

from .actuator import Actuator
from .answer import NEXT, ask, keep, tell_each
from .build import Made
from .drives import Array, Drive
from .grade import load
from .measures import inseparable
from .truth import EFFECTS, noise

if TYPE_CHECKING:
    from fracjax import Diagnosis

DEGREE = 11


def amplified(values: Array, step: float) -> Drive:
    """The voltage that an amplifier makes of samples `step` s apart, held before and after them.

    It is the B-spline with the samples as its control points: as if smoothed by a Gaussian of one
    sample, sqrt((DEGREE + 1)/12), and never outside their range.  Its own samples determine it,
    which those of a drive with corners and jumps would not.
    """
    beyond = (DEGREE + 1) // 2
    controls = np.pad(values, beyond, mode="edge")
    knots = np.arange(len(controls) + DEGREE + 1) - 2 * beyond
    spline = BSpline(knots, controls, DEGREE)
    last = len(values) - 1
    return Drive(
        "recommended", lambda t: spline(np.minimum(t / step, last)), len(values) * step, 1 / step
    )


def record(label: dict, values: Array, step: float) -> Array:
    """The label's truth on a list of voltages; columns s, V, um."""
    drive = amplified(values, step)
    actuator = Actuator(label["base"], label["base_parameters"], drive)
    clean = actuator.with_all([(EFFECTS[e["key"]], e["parameters"]) for e in label["effects"]])
    rng = np.random.default_rng([label["spec"]["seed"], 29])
    y = clean + noise(label["noise"], len(clean), label["noise_sd_um"], rng)
    return np.column_stack([drive.times, drive(drive.times), y])


def ask_again(label: dict, exam: Path, folder: Path) -> Diagnosis:
    """The diagnosis of a case with the recording that its first diagnosis recommends."""
    new = folder / "recording.csv"
    if not new.exists():
        times, values = np.loadtxt(folder.parent / NEXT, delimiter=",").T
        Made(record(label, values, times[1]), None, label).write(folder, new.stem)
    return ask(label, exam, new)


def follow_up(label: dict, exam: Path, answers: Path) -> str:
    """Follow one answer up; what happened, in a line."""
    name = f"{label['case']}/after"
    return keep(name, answers / name, partial(ask_again, label, exam, answers / name))


def main() -> None:
    """Follow up all answers that recommend a drive for look-alikes, a line each."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--exam", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args()
    pairs = inseparable(load(options.exam, options.answers))
    labels = [x for x, a in pairs if a.verdict == "confusable" and a.chance is not None]
    work = partial(follow_up, exam=options.exam, answers=options.answers)
    tell_each(work, labels, options.answers, options.jobs)


if __name__ == "__main__":
    main()
