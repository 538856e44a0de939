"""The pages' figures from the benchmarks' tables, so that none is typed by hand.

Run: python docs/tables.py

It rewrites what stands between `<!-- NAME -->` and `<!-- end -->` in README.md and
docs/benchmarks.md.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
PAGES = (README, ROOT / "docs" / "benchmarks.md", ROOT / "docs" / "benchmarks-archive.md")
MARKS = "concealed/marks"

_LENGTHS = ("1000", "10000", "100000", "1000000")
_OPERATORS = {
    "fracjax": "**fracjax**, fourth order",
    "fracjax, its gradient too": "**fracjax**, value and derivative in the order",
    "scipy": "Grünwald–Letnikov by SciPy's FFT",
    "torch": "Grünwald–Letnikov by torch's FFT",
    "differint GL": "differint, `GL` (convolves circularly)",
    "differint RL": "differint, `RL`",
    "pycaputo L1": "pycaputo, L1",
}
_DRIVES = {
    "line": "none: a straight line",
    "lfdh": "`lfdh`",
    "foh": "`foh`",
    "foh, extended": "`foh`, extended by `diagnose`",
    "bound: learned": "bound: drive corrected on the stage itself",
    "bound: no error": "bound: the sensor's noise",
}

_PACKAGES = "jax-sysid", "SysIdentPy", "PySINDy", "IDIM-LS"
_PUBLISHED = {
    ("silverbox", "arrow head"): ("silverbox arrow head mV", 1e-3),
    ("silverbox", "multisine"): ("silverbox multisine mV", 1e-3),
    ("tanks", "validation"): ("cascaded tanks V", 1.0),
    ("wiener_hammerstein", "test"): ("Wiener-Hammerstein mV", 1e-3),
}
"""The columns of published figures, and what they are in the test's unit."""

# The sealed runs: the largest, the seven that came after it, and the two before it.
_EXAM = (
    "from_971",
    *("from_1121", "from_1121_long", "from_521", "other_70", "third_76", "fourth_76", "fifth_76"),
    *("from_881", "from_791"),
)
_AFTER = 7

_ANEW = "concealed/marks/anew", "concealed/marks/anew_second"
_TODAY = "concealed/marks/anew_second", "concealed/marks/sixth_76"
_TODAY_INEXACT = "concealed/inexact/marks/sealed_second", "concealed/inexact/marks/sealed_third"
_INEXACT = "concealed/inexact/marks/sealed_first", "concealed/inexact/marks/sealed_second"

_SEALED = "concealed/anylaw/marks/sealed"

_TRUST = {
    "names what is not there": "names physics that is not there",
    "right, detectable whatever the law (first or in a set of 3)": (
        "names what is there, or it and two others, where the recording shows it"
    ),
    "both of a pair, each detectable beside the other": "names both of two effects",
    "not detectable: said that the drive cannot show it": "says that a drive cannot show an effect",
}

_ALONE = {"third_nulls": "false alarms on nulls", "outside": "out of catalogue, not named"}

_MARKS = {
    "first name right, separable, visible >= .3": "first name right",
    "truth in the reported set, all levels": "truth in the set",
    "mean size of the reported set, visible >= .3": "size of the set",
    "confident and wrong": "confident and wrong",
    "false alarms on nulls": "false alarms",
    "out of catalogue, not named": "outside, not named",
    "two effects, both named": "two, both named",
}


def rows_of(path: str) -> list[dict[str, str]]:
    """The rows of a benchmark's table, below the versions it was made with."""
    lines = (ROOT / "benchmarks" / path).read_text(encoding="utf-8").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def operators() -> str:
    """Time and error of D^0.4 t² beside the peers'."""
    found = {(row["method"], row["N"]): row for row in rows_of("operators/results.csv")}
    heads = [f"{int(count):,} samples" for count in _LENGTHS]
    lines = [_line("D^0.4 t²: time over SciPy's, largest error", *heads)]
    for method, told in _OPERATORS.items():
        at = [found.get((method, count)) for count in _LENGTHS]
        cells = [
            "–" if row is None else ", ".join(v for v in (row["over_scipy"], row["max_error"]) if v)
            for row in at
        ]
        lines.append(_line(told, *cells))
    return "\n".join([lines[0], "|---" * (1 + len(heads)) + "|", *lines[1:]])


def fits() -> str:
    """One fit of FOH by each method: error, how often it arrives, time."""
    rows = [row for row in rows_of("fitting/results.csv") if not row["note"].startswith("cold")]
    times = {(row["peer"], row["case"]): row["over_fracjax"] for row in rows_of("peers.csv")}
    cases = list(dict.fromkeys(row["case"] for row in rows))
    found = {(row["method"], row["case"]): row for row in rows}
    lines = [_line("median error over the noise's; runs at the floor; time", *cases)]
    lines.append("|---" * (1 + len(cases)) + "|")
    for method in dict.fromkeys(row["method"] for row in rows):
        cells = []
        for case in cases:
            row = found[method, case]
            error, arrived = float(row["rmse_over_noise"]), f"{row['at_floor']} of {row['of']}"
            cells.append(f"{error:.3g}; {arrived}; {times.get((method, case), '1')}")
        lines.append(_line(method, *cells))
    return "\n".join(lines)


def peers() -> str:
    """What takes how many times as long without fracjax."""
    lines = [_line("what", "on", "by", "time over fracjax's"), "|---" * 4 + "|"]
    for row in rows_of("peers.csv"):
        if row["study"] not in ("operators", "fits"):
            lines.append(_line(row["measure"], row["case"], row["peer"], row["over_fracjax"]))
    return "\n".join(lines)


def batches() -> str:
    """CPU time of a recording of a batch, beside SciPy's fit from one start, without and with
    steps as fine as needed."""
    lines = [_line("model", "drives", "samples", "SciPy, one start [ms]", "fracjax, files [ms]",
                   "times", "fracjax, from memory [ms]", "times", "SciPy, fine steps [ms]",
                   "times files")]  # fmt: skip
    lines.append("|---" * 10 + "|")
    for row in rows_of("fitting/batch_cpu.csv"):
        drives = {"own": "each its own", "one": "one for all"}[row["drive"]]
        cells = row["model"], drives, f"{int(row['samples']):,}", row["scipy_ms"], row["files_ms"]
        memory, fine = (row["memory_ms"], row["over_memory"]), row["scipy_finely_ms"]
        lines.append(_line(*cells, row["over_files"], *memory, fine, row["finely_over_files"]))
    return "\n".join(lines)


def compensation() -> str:
    """Largest steady tracking errors of an open-loop drive by each model, the zero set."""
    rows = rows_of("compensation/results.csv")
    motions = list(dict.fromkeys(row["trajectory"] for row in rows))
    found = {(row["drive"], row["trajectory"]): row["zeroed_max_percent"] for row in rows}
    lines = [_line("compensated by; largest steady error [± % of stroke]", *motions)]
    lines.append("|---" * (1 + len(motions)) + "|")
    for drive, told in _DRIVES.items():
        lines.append(_line(told, *(found[drive, motion] for motion in motions)))
    return "\n".join(lines)


def loop() -> str:
    """Tracking errors of the real-time inverse on three stages, what of them is the model's own,
    and the other controllers."""
    rows = rows_of("compensation/real_time.csv")
    values = {(row["stage"], row["motion"], row["drive"]): row for row in rows}
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    heads = [f"{stage}: real time (model; offline)" for stage in stages]
    lines = [_line("motion; rms error [% of stroke]", *heads), "|---" * (1 + len(heads)) + "|"]
    for motion in dict.fromkeys(row["motion"] for row in rows):
        cells = []
        for stage in stages:
            row = values[stage, motion, "real time"]
            offline = values.get((stage, motion, "offline"), {"rms_percent": "–"})["rms_percent"]
            cells.append(f"{row['rms_percent']} ({row['model_percent']}; {offline})")
        lines.append(_line(motion, *cells))
    for drive in ("linear part", "plays", "integral", "real time + integral"):
        cells = []
        for stage in stages:
            errors = [
                float(row["rms_percent"])
                for (name, motion, other), row in values.items()
                if (name, other) == (stage, drive) and not motion.endswith(("50 Hz", "100 Hz"))
            ]
            cells.append(f"{min(errors):.3g} to {max(errors):.3g}")
        lines.append(_line(f"{drive}, motions up to a tenth of the mode", *cells))
    return "\n".join(lines)


def pairs(path: str, *columns: str) -> str:
    """A table of figures as it stands, the value beside its unit."""
    lines = [_line(*columns, "value"), "|---" * (1 + len(columns)) + "|"]
    for row in rows_of(path):
        lines.append(_line(*(row[name] for name in columns), f"{row['value']} {row['unit']}"))
    return "\n".join(lines)


def trust() -> str:
    """The figures of the sealed run that matter most to a user, missed targets among them."""
    lines = [_line("measured", "target", "value", "cases", ""), "|---" * 5 + "|"]
    grades = {row["measure"]: row for row in rows_of(f"{_SEALED}/grade.csv")}
    for measure, told in _TRUST.items():
        row = grades[measure]
        end = float(row["target"].lstrip("<>= "))
        met = float(row["value"]) <= end if "<" in row["target"] else float(row["value"]) >= end
        verdict = "met" if met else "**missed**"
        lines.append(_line(told, row["target"], row["value"], row["n"], verdict))
    return "\n".join(lines)


def any_law() -> str:
    """All marks of that run."""
    heads = "measure", "target", "value", "95 % interval", "cases"
    lines = [_line(*heads), "|---" * len(heads) + "|"]
    rows = rows_of(f"{_SEALED}/grade.csv")
    lines += [_line(row["measure"], *_told(row)) for row in rows]
    return "\n".join(lines)


def exam() -> str:
    """Marks of the diagnosis on cases from a simulator that it shares nothing with: the largest of
    the last runs, those that came after it, and all with the two before; the concealed ones among
    these; and two runs, of nulls alone and of what is in no catalogue."""
    own = "target", "value", "95 % interval", "cases"
    heads = "measure", *own, "after", "in ten runs", "concealed ones in ten"
    lines = [_line(*heads), "|---" * len(heads) + "|"]
    largest, *others = _EXAM
    after, newest = others[:_AFTER], others[_AFTER - 1]
    seen = {row["measure"]: row for row in _marks([largest], "grade")}
    for run, name in _ALONE.items():
        alone = next(row for row in _marks([run], "grade") if row["measure"] == name)
        lines.append(_line(f"{name}, a run of these alone", *_told(alone), "", "", ""))
    sets = _marks(after, "grade"), _marks(_EXAM, "grade"), _marks(_EXAM, "concealed")
    for row in _marks([newest], "grade"):
        name = row["measure"]
        marks = _told(seen.get(name, row | {"n": "0"}))
        lines.append(_line(name, *marks, *(_together(name, rows) for rows in sets)))
    return "\n".join(lines)


def _marks(runs: Iterable[str], table: str) -> list[dict[str, str]]:
    return [row for run in runs for row in rows_of(f"{MARKS}/{run}/{table}.csv")]


def _told(row: dict[str, str]) -> tuple[str, ...]:
    """Target, value, interval and number of cases."""
    value, interval = row["value"], f"{row['low']} to {row['high']}"
    measured = (value, interval) if row["n"] != "0" else ("not measured", "")
    return row["target"], *measured, row["n"]


def _together(name: str, rows: list[dict[str, str]]) -> str:
    """A share or a mean over runs; of several medians or calibration errors there is none."""
    runs = [row for row in rows if row["measure"] == name and row["n"] != "0"]
    summary = "median" in name or "calibration" in name
    if not runs or (len(runs) > 1 and summary):
        return ""
    counts = [int(run["n"]) for run in runs]
    values = [float(run["value"]) for run in runs]
    mean = sum(n * value for n, value in zip(counts, values, strict=True)) / sum(counts)
    return f"{mean:.4f} of {sum(counts)}"


def baselines() -> str:
    """The marks of simpler ways on the same cases, a row each."""
    rows = rows_of(f"{MARKS}/first_400/baselines.csv")
    lines = [_line("way", *_MARKS.values()), "|---" * (1 + len(_MARKS)) + "|"]
    found = {(row["way"], row["measure"]): row for row in rows}
    for way in dict.fromkeys(row["way"] for row in rows):
        marks = [found[way, measure] for measure in _MARKS]
        lines.append(_line(way, *(f"{float(m['value']):.2f} of {m['n']}" for m in marks)))
    return "\n".join(lines)


def posteriors() -> str:
    """How evenly truths are ranked among their posteriors' draws, by model and noise."""
    rows = rows_of("posterior/calibration.csv")
    heads = "truths", "numbers", "least p", "95 % intervals hold", "not converged"
    lines = [_line("model, noise", *heads), "|---" * (1 + len(heads)) + "|"]
    for model, noise in dict.fromkeys((row["model"], row["noise"]) for row in rows):
        those = [row for row in rows if (row["model"], row["noise"]) == (model, noise)]
        held = sum(float(row["coverage_95"]) for row in those) / len(those)
        cells = (
            those[0]["draws"],
            str(len(those)),
            f"{min(float(row['chi_squared_p']) for row in those):.2f}",
            f"{100 * held:.1f} %",
            those[0]["unconverged"],
        )
        lines.append(_line(f"`{model}`, {noise}", *cells))
    return "\n".join(lines)


def real() -> str:
    """What is said of known effects on a real drive in real noise."""
    lines = [_line("put in", "verdict", "named", "look-alikes told"), "|---" * 4 + "|"]
    for row in rows_of("real/semi_synthetic_model.csv"):
        cells = (row[key].replace("_", " ") for key in ("sealed", "verdict", "effects"))
        alike = row["confusable_with"].replace(" ", ", ").replace("_", " ")
        lines.append(_line(*cells, alike or "–"))
    return "\n".join(lines)


def inside() -> str:
    """Marks of what is named inside simulated machines."""
    rows, count = rows_of("inside/answers_summary.csv"), len(rows_of("inside/answers.csv"))
    head = _line(f"{count} of 80 machines", "")
    return "\n".join([head, "|---|---|", *(_line(*row.values()) for row in rows)])


def nulls() -> str:
    """How many recordings of real noise with nothing missing are said to be such."""
    rows = rows_of("real/nulls.csv")
    lines = [_line("real noise on", "`none`"), "|---" * 2 + "|"]
    for kind in dict.fromkeys(row["kind"] for row in rows):
        verdicts = [row["verdict"] for row in rows if row["kind"] == kind]
        lines.append(_line(f"`{kind}`", f"{verdicts.count('none')} of {len(verdicts)}"))
    return "\n".join(lines)


def stage() -> str:
    """Errors of models fitted to one amplitude on nested loops that they have not seen."""
    heads = "how", "model", "history", "error, fitted [µm]", "error, unseen [µm]"
    lines = [_line(*heads), "|---" * len(heads) + "|"]
    for row in rows_of("real/piezo_dbo.csv"):
        if row["second_file"] == "unseen":
            model = row["model"] + (f" → {row['adopted']}" if row["adopted"] else "")
            cells = row["history"], row["train_um"], row["unseen_um"]
            lines.append(_line(row["how"], f"`{model}`", *cells))
    return "\n".join(lines)


def machines() -> str:
    """What is named inside public benchmarks' machines, and the errors on their own test data
    beside those of others."""
    others = [*_PACKAGES, "published baselines", "published best"]
    heads = "test", "documented", "named", "linear", "with it", *others
    lines = [_line(*heads), "|---" * len(heads) + "|"]
    peers = {
        (row["benchmark"], row["test"], row["package"].split()[0]): row["rms_error"]
        for row in rows_of("real/peers.csv")
    }
    published = rows_of("real/published.csv")
    for row in rows_of("real/machines.csv"):
        at = row["benchmark"], row["test"]
        column, over = _PUBLISHED.get(at, ("", 1.0))
        errors = {
            kind: [
                float(other[column]) * over
                for other in published
                if column and other["kind"] == kind and other[column]
            ]
            for kind in ("baseline", "published")
        }
        span = sorted(errors["baseline"])
        names = " and ".join(
            names.replace("|", " or ").replace("_", " ") for names in row["sets"].split(" + ")
        )
        lines.append(
            _line(
                f"{row['benchmark'].replace('_', ' ')}, {row['test']} [{row['unit']}]",
                row["documented"].replace(" + ", ", ").replace("_", " "),
                names or "–",
                row["linear"],
                row["extended"],
                *(peers.get((*at, package), "–") for package in _PACKAGES),
                f"{span[0]:.3g} to {span[-1]:.3g}" if span else "–",
                f"{min(errors['published']):.3g}" if errors["published"] else "–",
            )
        )
    return "\n".join(lines)


def proof() -> str:
    """The stage's figures for two models, in a sentence."""
    rows = [row for row in rows_of("real/piezo_dbo.csv") if row["how"] == "by hand"]
    constant = {row["model"]: row for row in rows if row["history"] == "constant"}
    plays, foh = constant["prandtl_ishlinskii"], constant["foh"]
    fitted, unseen, floors = "train_um", "unseen_um", "over_floor"
    return (
        f"Fitted to the first file with an error of {plays[fitted]} µm rms, `prandtl_ishlinskii` "
        f"predicts the second to {plays[unseen]} µm\nrms, {plays[floors]} times the noise floor. "
        f"`foh`, with {foh[fitted]} µm on the first, predicts it to {foh[unseen]} µm, "
        f"{foh[floors]} times."
    )


def anew() -> str:
    """Marks of the diagnosis built anew, on cases of the exam."""
    return _runs(*_ANEW)


def inexact() -> str:
    """Its marks where no model has the actuator's loop."""
    return _runs(*_INEXACT)


def own_laws() -> str:
    """Marks of today's diagnosis on the first tier, beside those of the one before, and its false
    alarms on recordings without effects."""
    alone = next(r for r in rows_of("concealed/marks/fourth_nulls/grade.csv") if r["n"] != "0")
    named = {r["case"] for r in rows_of("concealed/marks/fourth_nulls/failures.csv") if r["said"]}
    told = f"nulls alone: not `none` (with a name: {len(named)})", alone["target"], "", ""
    interval = f"{alone['low']} to {alone['high']}"
    own = alone["value"], interval, alone["n"]
    return "\n".join([_runs(*_TODAY, "before", "today"), _line(*told, *own)])


def inexact_laws() -> str:
    """The same on the second tier."""
    return _runs(*_TODAY_INEXACT, "before", "today")


def _runs(first: str, second: str, *names: str) -> str:
    """The marks of two runs that are of any case, with the interval of the second."""
    one, other = names or ("first run", "second run")
    heads = "measure", "target", one, "cases", other, "95 % interval", "cases"
    lines = [_line(*heads), "|---" * len(heads) + "|"]
    before = {row["measure"]: row for row in rows_of(f"{first}/grade.csv")}
    for row in rows_of(f"{second}/grade.csv"):
        if row["n"] not in ("", "0") and row["value"]:
            interval = f"{row['low']} to {row['high']}" if row["low"] else ""
            earlier = before.get(row["measure"], {"value": "", "n": ""})
            own = row["value"], interval, row["n"]
            told = row["measure"], row["target"], earlier["value"], earlier["n"]
            lines.append(_line(*told, *own))
    return "\n".join(lines)


def _line(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


TABLES = {
    "trust": trust,
    "any_law": any_law,
    "real": real,
    "nulls": nulls,
    "stage": stage,
    "machines": machines,
    "inside": inside,
    "proof": proof,
    "exam": exam,
    "anew": anew,
    "inexact": inexact,
    "own_laws": own_laws,
    "inexact_laws": inexact_laws,
    "baselines": baselines,
    "posteriors": posteriors,
    "operators": operators,
    "fits": fits,
    "peers": peers,
    "batches": batches,
    "compensation": compensation,
    "loop": loop,
    "cost": lambda: pairs("compensation/clock.csv", "figure"),
    "authors": lambda: pairs("compensation/piezo_dbo.csv", "model", "figure"),
}


def updated(text: str) -> str:
    """A text with each table between its marks as the benchmarks have it now."""
    for name, table in TABLES.items():
        marked = re.compile(rf"(<!-- {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        text = marked.sub(lambda found, t=table: f"{found[1]}{t()}\n{found[2]}", text)
    return text


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(updated(page.read_text(encoding="utf-8")), encoding="utf-8")
