"""Fit steady cycles of one amplitude, and predict nested loops of many that no fit has seen.

    FRACJAX_DATA=DIR python -m benchmarks.real.piezo_dbo

The first file repeats one sine, on which minor loops are concealed; the second holds nested loops,
growing and decaying, and two rests.  Every model is fitted to the first file's cycles after its
first, and predicts the second from its drive alone.  The zero of the second file is read from its
first period, less the first 0.1 s of start-up, for every model alike; the rest is scored.

`diagnosed` rows are what `fracjax.diagnose` ends on.  Where `second_file` is "chooses", it was
given as the held-out recording: no parameter is fitted to it, but it had a say in which effect was
adopted.  `by hand` rows are compositions named beforehand, the ceiling within the catalogue;
`reference` is the same in NumPy alone: a lag, 18 plays of equal steps, a logarithmic drift.
"""

from __future__ import annotations

from itertools import product
from typing import Literal, get_args

import numpy as np
from scipy.signal import lfilter

import fracjax as fj
from benchmarks.real.recordings import piezo_dbo, rounded, table

START_UP, PERIOD = 20, 200  # samples
History = Literal["rest", "constant"]
BY_HAND: tuple[tuple[str, History], ...] = (
    ("foh", "constant"),
    ("foh", "rest"),
    ("lfdh", "rest"),
    ("prandtl_ishlinskii", "constant"),
    ("prandtl_ishlinskii", "rest"),
    ("drive_lag >> prandtl_ishlinskii", "constant"),
    ("drive_lag >> prandtl_ishlinskii", "rest"),
    ("drive_lag >> (foh + minor_loop_memory)", "constant"),
    ("drive_lag >> (foh + minor_loop_memory)", "rest"),
    ("drive_lag >> (lfdh + minor_loop_memory)", "constant"),
    ("drive_lag >> (lfdh + minor_loop_memory)", "rest"),
)


def unseen_rmse(response: np.ndarray, predicted: np.ndarray) -> float:
    """The error (N,) on the second file, its zero from the first period."""
    error = response - predicted
    error = error - error[START_UP:PERIOD].mean()
    return float(np.sqrt(np.mean(error[PERIOD:] ** 2)))


def row(
    how: str,
    model: str,
    history: str,
    second_file: str,
    found: tuple[str, str],
    train: float,
    unseen: float,
) -> dict:
    verdict, adopted = found
    print(f"{how}: {model} ({history}): {train:.3f} um, unseen {unseen:.3f} um", flush=True)
    return {
        "how": how, "model": model, "history": history, "second_file": second_file,
        "verdict": verdict, "adopted": adopted, "train_um": train, "unseen_um": unseen,
    }  # fmt: skip


def diagnosed(
    model: str, history: History, choosing: bool, steady: fj.Recording, nested: fj.Recording
) -> dict:
    """What a diagnosis of the first file ends on."""
    diagnosis = fj.diagnose(
        fj.parse_model(model), steady, history=history, holdout=nested if choosing else None
    )
    extended = diagnosis.extended_model
    predicted = fj.simulate(extended, nested.drive, nested.dt, history).response
    return row(
        "diagnosed",
        model,
        history,
        "chooses" if choosing else "unseen",
        (diagnosis.verdict, extended.name),
        (diagnosis.extended or diagnosis.base).scores.rmse,
        unseen_rmse(nested.response, predicted),
    )


def by_hand(model: str, history: History, steady: fj.Recording, nested: fj.Recording) -> dict:
    """A composition named beforehand, whitened as a diagnosis would."""
    from fracjax._prepare._setting import setting_of

    composed = fj.parse_model(model, setting_of([steady]))
    fit = fj.fit(composed, steady, history=history, settling=PERIOD)
    predicted = fj.simulate(fit.model, nested.drive, nested.dt, history).response
    unseen = unseen_rmse(nested.response, predicted)
    return row("by hand", model, history, "unseen", ("", ""), fit.scores.rmse, unseen)


def play(drive: np.ndarray, radius: float, before: float) -> np.ndarray:
    """The play operator (N,), sample by sample."""
    states = np.empty_like(drive)
    for k, level in enumerate(drive):
        states[k] = before = min(max(before, level - radius), level + radius)
    return states


def reference(steady: fj.Recording, nested: fj.Recording, history: History) -> dict:
    """NumPy alone; the lag's time constant is the one that fits the first file best."""
    radii = np.linspace(0.0, 1.7, 18)  # V

    def columns(recording: fj.Recording, lag: float) -> np.ndarray:
        first = recording.drive[0] if history == "constant" else 0.0
        decay = np.exp(-recording.dt / lag)
        lagged = first + lfilter([1 - decay], [1, -decay], recording.drive - first)
        plays = [play(lagged, r, first) for r in radii]
        return np.stack([*plays, np.log1p(recording.times)], axis=1)

    def fitted(lag: float) -> tuple[float, float, np.ndarray]:
        known = np.column_stack([columns(steady, lag), np.ones(len(steady))])[PERIOD:]
        weights = np.linalg.lstsq(known, steady.response[PERIOD:], rcond=1e-10)[0]
        error = steady.response[PERIOD:] - known @ weights
        return float(np.sqrt(np.mean(error**2))), lag, weights[:-1]

    train, lag, weights = min(
        (fitted(lag) for lag in (0.005, 0.01, 0.015, 0.02, 0.03)), key=lambda f: f[0]
    )
    unseen = unseen_rmse(nested.response, columns(nested, lag) @ weights)
    name = f"lag {1e3 * lag:g} ms + 18 plays + log drift"
    return row("reference", name, history, "unseen", ("", ""), train, unseen)


def main() -> None:
    steady, nested = piezo_dbo()
    rows = [reference(steady, nested, history) for history in ("constant", "rest")]
    rows += [by_hand(*case, steady, nested) for case in BY_HAND]
    diagnoses = product(("foh", "lfdh"), get_args(History), (False, True))
    rows += [diagnosed(*case, steady, nested) for case in diagnoses]
    base = next(r["unseen_um"] for r in rows if (r["model"], r["history"]) == ("foh", "constant"))
    floor = fj.fit(fj.parse_model("lfdh"), steady, starts=1).preparation.takes[0].noise
    assert floor is not None  # the cycles repeat
    for r in rows:
        r["over_foh"] = rounded(r["unseen_um"] / base)
        r["over_floor"] = rounded(r["unseen_um"] / floor.sigma)
        r["train_um"], r["unseen_um"] = rounded(r["train_um"]), rounded(r["unseen_um"])
    table("piezo_dbo", rows)


if __name__ == "__main__":
    main()
