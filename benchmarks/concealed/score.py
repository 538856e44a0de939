"""Score fracjax on nulls and on the nine effects; each case by the package's public entry point.

Run: python -m benchmarks.concealed.score --out benchmarks/concealed/results.csv
Creep, lag and delay are simulated at 0.01 % noise: at 0.1 % their physical range does not reach
three times the noise after the fit on these drives.
"""

from __future__ import annotations

import argparse
import csv
import tempfile
import time
from pathlib import Path

import fracjax as fj

from .cases import SEPARATING_DRIVE, Case, make_case

NULL_DRIVES = (
    "bursts",
    "steps",
    "ladder",
    "multisine",
    "rich",
    "reversal_curves",
    "sine",
    "triangle",
    "decaying",
)
SMALL_NOISE = {"creep": 1e-4, "drive_lag": 1e-4, "delay": 1e-4}
COLUMNS = (
    "effect",
    "drive",
    "noise",
    "seed",
    "level",
    "concealment",
    "R2",
    "verdict",
    "named",
    "confusable_with",
    "first_axis",
    "noise_over_truth",
    "numerics",
    "base_holdout",
    "extended_holdout",
    "seconds",
)


def score(case: Case, folder: Path) -> dict:
    """Diagnose one case as a user would: from its file, by the base model's name."""
    case.write(folder)
    recording = fj.read(folder / "case.csv")
    began = time.perf_counter()
    diagnosis = fj.diagnose(fj.parse_model(case.label["base"]), recording)
    label = case.label
    values = (
        label["effect"],
        label["drive"],
        label["noise"],
        label["seed"],
        round(label["level"], 3),
        round(label["concealment"] or 0.0, 4),
        round(label["R2"], 6),
        diagnosis.verdict,
        " ".join(e.name for e in diagnosis.effects),
        " ".join(other for e in diagnosis.effects for other in e.confusable_with),
        diagnosis.axes[0].axis,
        round(diagnosis.noise.sigma / label["noise_sd_um"], 3),
        round(diagnosis.numerics, 3),
        round(diagnosis.held_out.base_rmse / label["noise_sd_um"], 3),
        diagnosis.held_out.extended_rmse
        and round(diagnosis.held_out.extended_rmse / label["noise_sd_um"], 3),
        round(time.perf_counter() - began, 1),
    )
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    """Write the table, one row per case."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--nulls", type=int, default=20)
    parser.add_argument("--effects", nargs="*", default=list(SEPARATING_DRIVE))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    with options.out.open("w", newline="") as file, tempfile.TemporaryDirectory() as folder:
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for effect in options.effects:
            noise = SMALL_NOISE.get(effect, 1e-3)
            drive = SEPARATING_DRIVE[effect]
            case = make_case("foh", effect, drive, 3.0, "white", options.seed, noise)
            table.writerow(score(case, Path(folder)))
            file.flush()
        for k in range(options.nulls):
            drive, colour = NULL_DRIVES[k % len(NULL_DRIVES)], ("white", "ar")[k % 2]
            case = make_case("foh", "none", drive, 0.0, colour, 100 + options.seed + k)
            table.writerow(score(case, Path(folder)))
            file.flush()


if __name__ == "__main__":
    main()
