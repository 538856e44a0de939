"""Where the time of a command goes, from the shell.

Run: python -m benchmarks.startup.run [--repeats 5] [--only TEXT]

Each command runs as a process of its own: cold (no program was kept), a second time, and on a
recording of another length; the median of the repeats is written to `results.csv`, in seconds.
Bytecode is kept, as it is where a package was installed.  `stages.py` tells the stages apart, and
`run` is what remains of the total.  Beside the models that have one, a SciPy script fits the same.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.fitting.laws import LAWS, Signals
from benchmarks.versions import versions

TABLE = Path(__file__).with_name("results.csv")
STAGES = ("import", "read", "trace", "lower", "compile", "store", "load", "write")
MODELS = ("foh", "lfdh", "bouc_wen", "prandtl_ishlinskii", "foh >> creep", "foh >> resonance")
PEERS = ("foh", "lfdh")
SAMPLES, OTHER, STEP, NOISE, GAINS = 8000, 6100, 1e-3, 5e-3, (0.07, 0.03, 2e-4)


def write_recording(path: Path, samples: int) -> None:
    """A recording of loops of growing size, of an actuator with a fractional hysteresis in NumPy,
    which begins at rest."""
    rng, t = np.random.default_rng(0), STEP * np.arange(samples)
    u = 40 * np.sin(2 * np.pi * t) ** 2 * (0.5 + 0.5 * t / t[-1])
    columns = LAWS["foh"].columns(Signals(u, STEP), (0.2, -0.2))
    y = np.column_stack(columns) @ GAINS + rng.normal(0, NOISE, samples)
    table = np.column_stack([t, u, y])
    np.savetxt(path, table, delimiter=",", header="time_s,voltage_V,displacement_um", comments="")


def commands(folder: Path) -> list[tuple[str, list[str]]]:
    """The commands by name; FILE stands for the recording."""
    out = str(folder / "out")
    fits = [(f"fit {m}", ["fit", "FILE", "--model", m, "--out", out]) for m in MODELS]
    compensated = ["compensate", str(folder / "motion.csv"), "--fit", str(folder / "fit.json")]
    return [
        ("info", ["info", "FILE"]),
        ("models", ["models"]),
        *fits,
        ("diagnose foh", ["diagnose", "FILE", "--model", "foh", "--out", out]),
        ("compensate foh", [*compensated, "--out", out]),
        ("posterior foh", ["posterior", "FILE", "--model", "foh", "--steps", "1500", "--out", out]),
    ]


def environment(folder: Path) -> dict[str, str]:
    """That of a user, with caches in this folder."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("JAX_", "XLA_", "PYTHON"))}
    return kept | {
        "PYTHONPATH": os.getcwd(),
        "PYTHONPYCACHEPREFIX": str(folder / "bytecode"),
        "FRACJAX_CACHE": str(folder / "programs"),
    }


def measured(arguments: list[str], folder: Path) -> dict[str, float]:
    """The seconds of one command by stage, and of the whole process."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.startup.stages", *arguments],
        env=environment(folder),
        capture_output=True,
        text=True,
        check=True,
    )
    total = time.perf_counter() - start
    facts = json.loads(done.stderr.splitlines()[-1])
    if facts["status"] not in (0, 3):  # done, or not converged
        raise RuntimeError(done.stderr)
    stages = {stage: facts["stages"].get(stage, 0.0) for stage in STAGES}
    rest = total - sum(stages.values())
    return {"total": total, "cpu": facts["cpu"], **stages, "run": rest}


def peer(model: str, file: Path, folder: Path) -> float:
    """The seconds of the SciPy script."""
    start = time.perf_counter()
    script = [sys.executable, "-m", "benchmarks.startup.scipy_fit", str(file), model]
    subprocess.run([*script, str(folder / "scipy.json")], env=environment(folder), check=True)
    return time.perf_counter() - start


def main() -> None:
    """Measure all commands and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="fracjax-startup-"))
    try:
        files = {"loop": folder / "loop.csv", "other": folder / "other.csv"}
        write_recording(files["loop"], SAMPLES)
        write_recording(files["other"], OTHER)
        t = STEP * np.arange(2000)
        motion = np.column_stack([t, 1.5 - 0.8 * np.cos(2 * np.pi * t)])
        header = "time_s,displacement_um"
        np.savetxt(folder / "motion.csv", motion, delimiter=",", header=header, comments="")
        measured(
            ["fit", str(files["loop"]), "--model", "foh", "--out", str(folder / "out")], folder
        )
        shutil.copy(folder / "out" / "fit.json", folder / "fit.json")
        rows = []
        for name, arguments in commands(folder):
            if chosen.only not in name:
                continue
            rows += rows_of(name, arguments, files, folder, chosen.repeats)
            write(rows)
    finally:
        shutil.rmtree(folder)


def write(rows: list[dict[str, object]]) -> None:
    """Write the table, as far as it has come; other commands keep their rows."""
    measured_now = {row["command"] for row in rows}
    with TABLE.open(encoding="utf-8") as file:
        earlier = list(csv.DictReader(line for line in file if not line.startswith("#")))
    order = list(dict.fromkeys(row["command"] for row in [*earlier, *rows]))
    kept: list[dict[str, object]] = [{**r} for r in earlier if r["command"] not in measured_now]
    rows = [*kept, *rows]
    rows.sort(key=lambda row: order.index(row["command"]))
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        file.write(versions(["fracjax", "jax", "numpy", "scipy"]))
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def rows_of(
    name: str, arguments: list[str], files: dict[str, Path], folder: Path, repeats: int
) -> list[dict[str, object]]:
    """The rows of one command: cold, second and on another length, the peer paired with each."""
    times: dict[str, list[dict[str, float]]] = {"cold": [], "second": [], "other length": []}
    model, peers = name.removeprefix("fit "), []
    for _ in range(repeats):
        shutil.rmtree(folder / "programs", ignore_errors=True)
        for state, file in (("cold", "loop"), ("second", "loop"), ("other length", "other")):
            filled = [str(files[file]) if each == "FILE" else each for each in arguments]
            shutil.rmtree(folder / "out", ignore_errors=True)
            times[state].append(measured(filled, folder))
        if name.startswith("fit") and model in PEERS:
            peers.append(peer(model, files["loop"], folder))
    rows = []
    for state, all_times in times.items():
        row: dict[str, object] = {"command": name, "state": state}
        for key in all_times[0]:
            row[key] = f"{median(each[key] for each in all_times):.3f}"
        row["scipy"] = f"{median(peers):.3f}" if peers else ""
        ratios = [one["total"] / other for one, other in zip(all_times, peers, strict=False)]
        row["over_scipy"] = f"{median(ratios):.2f}" if ratios else ""
        print("  ".join(f"{key} {value}" for key, value in row.items()), flush=True)
        rows.append(row)
    return rows


if __name__ == "__main__":
    main()
