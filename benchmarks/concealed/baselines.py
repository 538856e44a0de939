"""Simpler ways to name what is missing, on the exam's own cases: what a diagnosis is worth.

    python -m benchmarks.concealed.baselines --exam DIR --answers OUT [--ways sindy forward]
    python -m benchmarks.concealed.baselines --exam DIR --answers OUT --table FILE --fracjax FOLDER

The first writes OUT/sindy/case_0001/diagnosis.json and so on, which `grade.py` grades like any
other, and skips what is there already; the second sets what is there beside the diagnoses in
FOLDER, on the same cases.  Each way is given what a diagnosis is given, and the same fit of the
base.  A column is what a trial of an effect in the catalogue changes in the whitened response; but
for a constant, nothing that the base could absorb is projected out of it.

| way | an effect is named because |
|---|---|
| `correlation` | its column goes with the residual, beside the tests of MATLAB's `resid` |
| `sindy` | a sparse regression of the residual keeps a term that speaks for it |
| `forward` | its column lowers BIC the most, beside those named before; the base is not refitted |
| `refit_all` | the base and it, fitted together, have the lowest BIC: all that evidence can tell |

The first of a set is the likeliest, but all are given the same probability.
Sources: Ljung, System Identification (1999) section 16.6; Brunton, Proctor & Kutz, PNAS 113 (2016)
3932; Kaheman et al., arXiv:1909.08574 (2019); Schwarz, Ann. Stat. 6 (1978) 461.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import numpy as np
from scipy.stats import norm

import fracjax as fj
from fracjax._computing import computing
from fracjax._diagnose._fitted import fitted
from fracjax._diagnose._refits import explained_by
from fracjax._diagnose._thresholds import SIGNIFICANCE
from fracjax._diagnose._views import ModelView, model_view
from fracjax._fit import fit_of, settle
from fracjax._prepare import prepare
from fracjax._solve import Solved

from .answer import cases_of, tell_each
from .exam import part_of
from .grade import load, table, write_rows
from .measures import Pair, measure_all

STARTS, SEED = 8, 0
ALIKE = 0.9  # of the largest correlation
APART = 14.0  # of chi squared, odds of a thousand to one: less does not exclude
DELTA_BIC = 10.0  # what an effect has to gain: strong evidence by Kass & Raftery (1995)
MOST = 3  # effects
SPARSE, RIDGE = 0.3, 0.25
BESIDE = 1e-3  # the least length that a unit column must have beside others
UNSTATED = ("right axis", "right bin", "held-out", "parameter", "calibration")

# What each term of the library speaks for: the first, and its look-alikes.  Drive u and the base's
# response y go from -1 to 1, time t to 1.
MEANING: dict[str, tuple[str, ...]] = {
    "u": (), "y": (),
    "u^2": ("electrostriction", "sensor_nonlinearity", "saturation"),
    "u^3": ("cubic_nonlinearity", "sensor_nonlinearity", "saturation"),
    "y^2": ("sensor_nonlinearity", "electrostriction"),
    "y^3": ("sensor_nonlinearity", "cubic_nonlinearity"),
    "top": ("saturation", "electrostriction"),
    "bottom": ("lost_contact", "electrostriction"),
    "u'": ("delay", "drive_lag", "sensor_lag"),
    "u'^3": ("slew_rate_limit", "cubic_nonlinearity"),
    "|u'|": ("minor_loop_memory", "electrostriction"),
    "y'": ("sensor_lag", "drive_lag", "delay", "viscoelastic_layer"),
    "y''": ("resonance", "second_mode"),
    "sign y'": ("backlash", "coulomb_friction"),
    "(1 - y^2) sign y'": ("amplitude_dependence", "minor_loop_memory"),
    "t": ("thermal_drift", "creep"), "t^2": ("thermal_drift", "creep"),
    "exp -10t": ("thermal_drift", "creep"), "exp -3t": ("thermal_drift", "creep"),
    "t y": ("gain_drift",), "t u'": ("clock_skew",), "line": ("mains_interference",),
}  # fmt: skip


@dataclass(frozen=True)
class Seen:
    """The fitted base of a model, seen from its nominal block, what it leaves, and what that is
    compared with; `seconds` it took.

    All signals (L,) are whitened.  Every effect's columns (K, L) and the rows of `library` (M, L),
    named by `terms`, are without a constant and of unit length.  `unlike_noise`: the residual is
    not white, or goes with the drive.
    """

    nominal: fj.AbstractBlock
    view: ModelView
    residual: np.ndarray
    columns: dict[str, np.ndarray]
    terms: list[str]
    library: np.ndarray
    unlike_noise: bool
    seconds: float

    @property
    def solved(self) -> Solved:
        """The base's optimum."""
        return self.view.fitted.solved


@computing()
def seen_of(recording: fj.Recording, base: str) -> Seen:
    """What all ways have in common."""
    began, model = time.perf_counter(), fj.parse_model(base)
    settled = settle(model.block, prepare([recording]), history=None, starts=STARTS, seed=SEED)
    found = fitted([settled.block], settled.preparation)
    (take,), (problem,) = found.preparation.takes, found.problems
    constant = problem.whiten(np.ones(problem.response.shape[0]))
    constant /= np.linalg.norm(constant)

    def projected(signals: np.ndarray) -> np.ndarray:
        """Signals (L, …) whitened, without a constant."""
        white = found.whitened(signals)
        return white - np.multiply.outer(constant, constant @ white)

    view = model_view(found)
    columns: dict[str, list[np.ndarray]] = {}
    for group in view.groups:
        columns.setdefault(group.effect.name, []).append(unit(projected(group.columns).T))
    terms, drawn = library_of(take.recording, found.simulations[0])
    padded = np.zeros((constant.size, len(terms)))
    padded[: len(take.recording)] = drawn.T
    (tests,) = fj.analyse_residuals(fit_of(model, found.solved.on(found.preparation)))
    return Seen(
        nominal=model.block,
        view=view,
        residual=projected(found.error),
        columns={name: np.concatenate(parts) for name, parts in columns.items()},
        terms=terms,
        library=unit(projected(padded).T),
        unlike_noise=2 * min(tests.p_white, tests.p_drive) < SIGNIFICANCE,
        seconds=time.perf_counter() - began,
    )


def unit(columns: np.ndarray) -> np.ndarray:
    """Columns (K, L) of unit length."""
    return columns / (np.linalg.norm(columns, axis=1, keepdims=True) + 1e-300)


def library_of(recording: fj.Recording, response: np.ndarray) -> tuple[list[str], np.ndarray]:
    """The library's terms by name, and their columns (M, N)."""
    u, y = (2 * (x - x.min()) / np.ptp(x) - 1 for x in (recording.drive, response))
    du, dy = (np.gradient(x) / np.abs(np.gradient(x)).max() for x in (u, y))
    seconds = np.arange(len(recording)) * recording.dt
    t = seconds / seconds[-1]
    columns = {
        "u": u, "y": y, "u^2": u**2, "u^3": u**3, "y^2": y**2, "y^3": y**3,
        "top": np.maximum(u - 0.6, 0), "bottom": np.maximum(-0.6 - u, 0),
        "u'": du, "u'^3": du**3, "|u'|": np.abs(du), "y'": dy, "y''": np.gradient(dy),
        "sign y'": np.sign(dy), "(1 - y^2) sign y'": (1 - y**2) * np.sign(dy),
        "t": t, "t^2": t**2, "exp -10t": np.exp(-10 * t), "exp -3t": np.exp(-3 * t),
        "t y": t * y, "t u'": t * du,
    }  # fmt: skip
    below = 0.5 / recording.dt
    lines = [mains * k for mains in (50, 60) for k in range(1, 6) if mains * k < below]
    waves = [wave(2 * np.pi * line * seconds) for line in lines for wave in (np.cos, np.sin)]
    return [*columns, *["line"] * len(waves)], np.stack([*columns.values(), *waves])


def correlation(seen: Seen) -> dict:
    """The effects whose columns go with the residual."""
    size = float(np.linalg.norm(seen.residual))

    def largest(columns: np.ndarray) -> float:
        return float(np.abs(columns @ seen.residual).max()) / size

    rho = {name: largest(columns) for name, columns in seen.columns.items()}
    tests = len(seen.library) + sum(map(len, seen.columns.values()))
    limit = norm.isf(SIGNIFICANCE / 2 / tests) / np.sqrt(seen.solved.samples)
    best, alarm = max(rho.values()), seen.unlike_noise or largest(seen.library) > limit
    return said([within((1 - ALIKE) * best, rho)] if best > limit else [], alarm)


def sindy(seen: Seen) -> dict:
    """The effects that the terms of a sparse regression speak for, the largest term's first."""
    least = float(norm.isf(SIGNIFICANCE / 2 / len(seen.terms)))
    sizes = np.abs(sparse_regression(seen.library, seen.residual, least))
    named: list[list[str]] = []
    for k in np.argsort(-sizes)[: np.count_nonzero(sizes)]:
        meant = MEANING[seen.terms[k]]
        if meant and not any(set(meant) & set(one) for one in named):
            named.append(list(meant))
    return said(named[:MOST], bool(sizes.any()) and seen.unlike_noise)


def sparse_regression(columns: np.ndarray, residual: np.ndarray, least: float) -> np.ndarray:
    """Coefficients (M,) by sequentially thresholded least squares on unit columns (M, L).

    Those below a share of the largest, or below `least`, are set to zero, and the others fitted
    again.  However alike the columns are, a ridge of 1/4 keeps the sd of each at one or less, for
    g/(g + 1/4)² ≤ 1 of any eigenvalue g of their Gram matrix; so `least` is in units of the noise.
    """
    kept = np.ones(len(columns), bool)
    while True:
        some, found = columns[kept], np.zeros(len(columns))
        found[kept] = np.linalg.solve(some @ some.T + RIDGE * np.eye(len(some)), some @ residual)
        small = kept & (np.abs(found) < max(least, SPARSE * np.abs(found).max()))
        if not small.any():
            return found
        kept &= ~small


def forward(seen: Seen) -> dict:
    """The effects whose columns, taken one after another, lower BIC the most."""
    names = [name for name, columns in seen.columns.items() for _ in columns]
    columns = np.concatenate(list(seen.columns.values()))
    left, price = seen.residual, np.log(seen.solved.samples)
    named: list[list[str]] = []
    while True:
        lengths = np.linalg.norm(columns, axis=1)
        z = np.where(lengths > BESIDE, columns @ left / np.maximum(lengths, BESIDE), 0.0)
        gains = z**2 - price
        best = int(np.argmax(gains))
        taken = [one[0] for one in named]
        is_new = names[best] not in taken
        if gains[best] < DELTA_BIC or (is_new and len(named) == MOST):
            return said(named)
        if is_new:
            most = {name: gains[[n == name for n in names]].max() for name in names}
            named.append(within(DELTA_BIC, {n: g for n, g in most.items() if n not in taken}))
        direction = columns[best] / lengths[best]
        left = left - direction * (direction @ left)
        columns = columns - np.outer(columns @ direction, direction)


@computing()
def refit_all(seen: Seen) -> dict:
    """The effects that lower BIC the most, each fitted together with the base."""
    gains = {}
    for name in seen.columns:
        found = explained_by([name], seen.view, seen.nominal, seen.view.fitted.preparation)
        gains[name] = gain_in_bic(seen.solved, found.fitted.solved)
    return said([within(APART, gains)] if max(gains.values()) >= DELTA_BIC else [])


def gain_in_bic(before: Solved, after: Solved) -> float:
    """The gain in BIC of the later fit, with χ² divided by that fit's own excess over the noise, so
    that an unexplained residual does not make parameters cheaper."""
    price = (after.free - before.free) * float(np.log(after.samples))
    return (before.cost - after.cost) / after.excess_ratio - price


WAYS = {"correlation": correlation, "sindy": sindy, "forward": forward, "refit_all": refit_all}


def within(margin: float, worth: dict[str, float]) -> list[str]:
    """Names of those within a margin of the best, the best first."""
    least = max(worth.values()) - margin
    return sorted((n for n in worth if worth[n] >= least), key=lambda n: -worth[n])


def said(named: Sequence[Sequence[str]], alarm: bool = False) -> dict:
    """Verdict and effects as in a diagnosis, each set's first and its look-alikes; `alarm`: there
    is something, with a name or without."""
    verdict = "unexplained" if alarm else "none"
    if named:
        verdict = "confusable" if any(len(one) > 1 for one in named) else "missing"
    effects = [
        {"name": first, "probability": 1 / (1 + len(others)), "confusable_with": others,
         "parameters": {}}
        for first, *others in named
    ]  # fmt: skip
    return {"verdict": verdict, "effects": effects}


def answered(seen: Seen, way: str) -> tuple[dict[str, str], str]:
    """The files of one answer, and what it says in a line."""
    began = time.perf_counter()
    found = WAYS[way](seen)
    seconds = seen.seconds + time.perf_counter() - began
    unit = seen.view.fitted.preparation.takes[0].recording.response_unit
    fit = {"unit": unit, "base": {"bic": seen.solved.bic}, "extended": None}
    text = json.dumps(found | {"where": {"axes": []}, "fit": fit}, indent=1)
    names = " ".join(effect["name"] for effect in found["effects"])
    files = {"seconds.txt": f"{seconds:.2f}\n", "diagnosis.json": f"{text}\n"}
    return files, f"{found['verdict']} {names} ({seconds:.1f} s)"


def answer(case: dict, exam: Path, answers: Path, ways: Sequence[str]) -> str:
    """Diagnose one case in the ways that have not yet answered it; what happened, a line each."""
    seen = cache(lambda: seen_of(fj.read(exam / f"{case['case']}.csv"), case["base"]))
    lines = []
    for way in ways:
        folder = answers / way / case["case"]
        files, line = {}, "there already"
        if not (folder / "diagnosis.json").exists():
            try:
                files, line = answered(seen(), way)
            except Exception as error:  # one failure is a failed case, not the end of the exam
                line = f"failed, {type(error).__name__}: {error}"
            folder.mkdir(parents=True, exist_ok=True)  # left empty by a failure, which counts
        for name, text in files.items():
            (folder / name).write_text(text)
        lines.append(f"{case['case']}, {way}: {line}")
    return "\n".join(lines)


def compared(exam: Path, fracjax: Path, answers: Path, part: slice = slice(None)) -> list[dict]:
    """The measures of every way on the cases of a part that it and fracjax have tried; where a way
    has not tried all of fracjax's, fracjax's on the same ones too."""

    def tried(folder: Path) -> dict[str, Pair]:
        pairs = {label["case"]: (label, found) for label, found in load(exam, folder, part)}
        return {case: pair for case, pair in pairs.items() if (folder / case).exists()}

    def rows_of(way: str, pairs: Iterable[Pair]) -> list[dict]:
        stated = [m for m in measure_all(list(pairs)) if not m.name.startswith(UNSTATED)]
        return [{"way": way} | row for row in table(stated)]

    ours = tried(fracjax)
    rows = rows_of("fracjax", ours.values())
    for way in WAYS:
        theirs = {case: pair for case, pair in tried(answers / way).items() if case in ours}
        if theirs:
            rows += rows_of(way, theirs.values())
        if 0 < len(theirs) < len(ours):
            same = f"fracjax, same cases as {way}"
            rows += rows_of(same, (ours[case] for case in theirs))
    return rows


def main() -> None:
    """Answer all cases, a line each, or write the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--exam", type=Path, required=True)
    parser.add_argument("--answers", type=Path, required=True, help="a folder of each way's")
    parser.add_argument("--ways", nargs="+", choices=list(WAYS), default=list(WAYS))
    parser.add_argument("--cases", type=part_of, default=":")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--table", type=Path, help="write this table and answer nothing")
    parser.add_argument("--fracjax", type=Path, help="fracjax's own answers, for the table")
    options = parser.parse_args()
    if options.table:
        if options.fracjax is None:
            parser.error("--table needs --fracjax")
        told = compared(options.exam, options.fracjax, options.answers, options.cases)
        write_rows(options.table, told)
        return
    work = partial(answer, exam=options.exam, answers=options.answers, ways=options.ways)
    tell_each(work, cases_of(options.exam, options.cases), options.answers, options.jobs)


if __name__ == "__main__":
    main()
