"""Yield and overshoot at the reversals of a magnetorheological damper.

    FRACJAX_DATA=DIR python -m benchmarks.real.mr_damper

Displacement is the drive, force the response; strokes of two sizes at one coil voltage.  Each
recording begins a second before the crank turns, so that the noise can be read from the rest.  The
question is whether the mismatch is placed at the reversals, and what name it is given, if any.
"""

from __future__ import annotations

import numpy as np

import fracjax as fj
from benchmarks.real.recordings import attempt, mr_damper, rounded, table

CASES = (
    ("ensaio4.2", "bouc_wen"),
    ("ensaio4.2", "foh"),
    ("ensaio1.2", "bouc_wen"),
)
BEFORE, LENGTH = 100, 900  # samples


def moving(recording: fj.Recording) -> fj.Recording:
    """From a second before the crank turns."""
    away = np.abs(recording.drive - recording.drive[0]) > 0.3  # mm
    start = max(int(np.argmax(away)) - BEFORE, 0)
    return recording.window(start, min(start + LENGTH, len(recording)))


def case(name: str, model: str) -> dict:
    recording = moving(mr_damper(name))
    told = {"recording": name, "stroke_mm": rounded(np.ptp(recording.drive)), "model": model}
    diagnosis, stopped = attempt(fj.parse_model(model), recording)
    if diagnosis is None:
        return told | {"verdict": stopped}
    print(f"{name}, {model}: {diagnosis.sentence}", flush=True)
    axes = {axis.axis: axis for axis in diagnosis.axes}
    reversal = axes["reversal"]
    peak = int(np.argmax(reversal.strength))
    return told | {
        "verdict": diagnosis.verdict,
        "effects": " and ".join(e.name for e in diagnosis.effects),
        "adopted": diagnosis.extended_model.name,
        "floor_N": rounded(diagnosis.noise.sigma),
        "floor_from": diagnosis.noise.method,
        "base_N": rounded(diagnosis.held_out.base_rmse),
        "extended_N": rounded(diagnosis.held_out.extended_rmse or np.nan),
        "where": diagnosis.axes[0].axis,
        "reversal_strength": rounded(reversal.strength[peak]),
        "strongest_after_s": f"{reversal.edges[peak]:.2g}-{reversal.edges[peak + 1]:.2g}",
        "other_strengths": " ".join(
            f"{a.axis}:{a.strength.max():.0f}" for a in diagnosis.axes if a.axis != "reversal"
        ),
    }


def main() -> None:
    rows = []
    for chosen in CASES:
        rows.append(case(*chosen))
        table("mr_damper", rows)


if __name__ == "__main__":
    main()
