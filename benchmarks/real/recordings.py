"""The real recordings, as the benchmarks here read them, and the tables they write.

FRACJAX_DATA names the folder that holds them, else they are fetched; where each comes from, and
under which licence, is in fracjax/_registry/recordings.txt.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.signal import firwin

import fracjax as fj
from benchmarks.versions import versions

HERE = Path(__file__).parent
PACKAGES = ("fracjax", "jax", "numpy", "scipy", "optimistix")


def path_of(name: str) -> Path:
    """Where a recording lies; ends the program with one sentence where it cannot be had."""
    try:
        return fj.fetch_recording(name)
    except fj.InputError as error:
        raise SystemExit(f"Skipped: {error}") from None


def piezo_dbo() -> tuple[fj.Recording, fj.Recording]:
    """Steady cycles of one amplitude, and nested loops of many: drive in V, response in um."""
    steady, nested = (
        fj.read(path_of(name), input=0, output=4, rate="200Hz", input_unit="V", output_unit="um")
        for name in ("piezo_dbo/Model_Vi_Do.dat", "piezo_dbo/Test_Vi_Do_Di.dat")
    )
    return steady, nested


FSM_RATE = 6400.0  # Hz
FSM_PERIOD = 8192  # samples


def fsm_cubespec(level: str = "300mV_train") -> tuple[np.ndarray, np.ndarray]:
    """Drives [V] and responses [um] (8192 samples, 3 axes, realisations, 2 periods)."""
    drives, responses = (np.load(path_of(f"fsm_cubespec/{s}_{level}.npy")) for s in "uy")
    return drives, 1e6 * responses


def low_passed(periods: np.ndarray, cutoff: float, decimation: int) -> np.ndarray:
    """Two periods (8192, …, 2) at a lower rate, without what repeats above `cutoff` [Hz].

    A zero-phase FIR filter takes it off.  What differs between the periods is noise and stays, up
    to the new Nyquist frequency: a recording without noise in half of its band would be none.
    """
    repeating = periods.mean(axis=-1, keepdims=True)
    kept = _filtered(repeating, cutoff)
    noise = _filtered(periods - repeating, 0.45 * FSM_RATE / decimation)
    return (kept + noise)[::decimation]


def _filtered(periods: np.ndarray, cutoff: float) -> np.ndarray:
    """Periodic signals (8192, …) through a zero-phase FIR low-pass."""
    kernel = np.zeros(FSM_PERIOD)
    kernel[:1025] = firwin(1025, cutoff, fs=FSM_RATE, window=("kaiser", 8.0))
    gain = np.abs(np.fft.rfft(kernel)).reshape(-1, *([1] * (periods.ndim - 1)))
    return np.fft.irfft(gain * np.fft.rfft(periods, axis=0), FSM_PERIOD, axis=0)


def mr_damper(name: str) -> fj.Recording:
    """Displacement [mm] as drive, force [N] as response."""
    return fj.read(
        path_of(f"mr_damper/{name}.mat"),
        input="dist",
        output="forc",
        input_unit="mm",
        output_unit="N",
    )


def attempt(model: fj.Model, recording: fj.Recording) -> tuple[fj.Diagnosis | None, str]:
    """A diagnosis, or None and where it stopped: a failure is a row of its table like any other."""
    stages = ["begin"]
    try:
        return fj.diagnose(model, recording, progress=stages.append), ""
    except ValueError as error:
        print(f"stopped at {stages[-1]}: {error}", flush=True)
        return None, f"stopped at {stages[-1]}"


def table(name: str, rows: Sequence[dict], packages: Sequence[str] = PACKAGES) -> None:
    """Write rows to benchmarks/real/NAME.csv, with the versions they were made with; print them."""
    path = HERE / f"{name}.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(versions(packages))
        columns = list(max(rows, key=len))
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(path.read_text(encoding="utf-8"))


def renew(name: str, rows: Sequence[dict], keys: Sequence[str], order: Sequence[tuple]) -> None:
    """Write rows to benchmarks/real/NAME.csv in place of those with the same values of some
    columns; all others stay as they are, in an order of these values."""

    def key(row: dict) -> tuple:
        return tuple(row[k] for k in keys)

    again, path = {key(row) for row in rows}, HERE / f"{name}.csv"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    kept = [r for r in csv.DictReader(x for x in lines if x[0] != "#") if key(r) not in again]
    columns = max([*rows, *kept], key=len)
    whole = [{column: row.get(column, "") for column in columns} for row in [*kept, *rows]]
    table(name, sorted(whole, key=lambda row: order.index(key(row))))


def rounded(value: float | np.floating) -> str:
    """Three digits."""
    return f"{value:.3g}"
