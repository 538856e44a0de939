"""Are the rows of a batch what `fit` finds, at the noise, and do their intervals hold the truth?

    python -m benchmarks.fitting.batch_rows --recordings 200

Recordings as in `batch.py`, each with a drive of its own.  Per model and parameter: the largest
distance of the batch's rows from `fit` alone in standard errors, the largest relative difference of
standard errors, the share of rows whose RMSE is within 1 % of the noise that was put in, and in how
many of them the 95 % interval holds the truth, with what chance allows in 99 %.  Gains have no
truth here: the laws' own units differ.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from scipy import stats

from benchmarks.fitting.batch import PACKAGES, STARTS, STEP, made
from benchmarks.fitting.laws import LAWS
from benchmarks.fitting.tables import HERE, Table
from fracjax import Recording, fit, fit_batch

SAMPLES = 5000
COLUMNS = ("model", "parameter", "rows", "stacked", "fit_apart", "errors_apart", "at_noise",
           "covered", "chance_low", "chance_high")  # fmt: skip


def compare(model: str, count: int, folder: Path) -> list[dict[str, object]]:
    """A row per parameter of a model."""
    law = LAWS[model]
    all_made = [made(k, SAMPLES, False, law) for k in range(count)]
    recordings = [
        Recording(each.columns[:, 1], each.columns[:, 2], STEP, source=f"{k}")
        for k, each in enumerate(all_made)
    ]
    table = fit_batch(model, recordings, out=folder / model, starts=STARTS)
    alone = [fit(model, recording, starts=STARTS) for recording in recordings]
    at_noise = np.mean(np.abs(table["rmse"] / [each.noise for each in all_made] - 1) < 0.01)
    low, high = stats.binom.interval(0.99, count, 0.95)
    shapes = np.transpose([each.shapes for each in all_made])
    truths = {
        name.removeprefix("lg "): 10**truth if name.startswith("lg ") else truth
        for name, truth in zip(law.names, shapes, strict=True)
    }
    rows: list[dict[str, object]] = []
    for at, name in enumerate(estimate.name for estimate in alone[0].estimates):
        values, errors = table[f"{name}.value"], table[f"{name}.standard_error"]
        own = np.array([(f.estimates[at].value, f.estimates[at].standard_error) for f in alone]).T
        row = {
            "model": model,
            "parameter": name,
            "rows": count,
            "stacked": int(table["stacked"].sum()),
            "fit_apart": f"{np.max(np.abs(values - own[0]) / own[1]):.1g}",
            "errors_apart": f"{np.max(np.abs(errors / own[1] - 1)):.1g}",
            "at_noise": f"{at_noise:.3f}",
        }
        if name in truths:
            held = table[f"{name}.low"].le(truths[name]) & table[f"{name}.high"].ge(truths[name])
            row |= {"covered": int(held.sum()), "chance_low": int(low), "chance_high": int(high)}
        rows.append(dict.fromkeys(COLUMNS, "") | row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--models", nargs="+", choices=LAWS, default=[*LAWS])
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--out", type=Path, default=HERE / "batch_rows.csv")
    options = parser.parse_args()
    table = Table(options.out, COLUMNS, ("model", "rows"), PACKAGES)
    with tempfile.TemporaryDirectory() as folder:
        for model in options.models:
            if (model, str(options.recordings)) not in table.done():
                table.add(compare(model, options.recordings, Path(folder)))


if __name__ == "__main__":
    main()
