"""Recordings of other people's machines, chosen before they were diagnosed.

    FRACJAX_OTHERS=DIR python -m benchmarks.real.others

DIR holds the files of public repositories under the names below; none is part of this package.

- `vhb_*`: VHB4910 elastomer, displacement to force (Chongran-Zhao/VHB4910_data @ a23efd8).
- `silverbox`: a Duffing-like circuit, `robot`: a flexible robot arm, `tanks`: two cascaded tanks
  that overflow (Rafa7046/Non_Linear_Identification @ e5c9b00, src/data).
- `emps`: a positioning stage with dry friction in closed loop, force to position
  (forgi86/sysid-neural-continuous @ 956aa7e, examples/EMPS/data/DATA_EMPS.mat).

Each row states what is documented of the machine beyond the believed model, and what the diagnosis
says.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any

import fracjax as fj
from benchmarks.real.recordings import rounded, table

TIMED = {"input": 1, "output": 2, "input_unit": "mm", "output_unit": "N"}
BARE = {"input": 0, "output": 1}
STAMPED = TIMED | {"resample": "50 Hz"}
RELAXES = "viscoelastic relaxation"
ROWS: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
    ("vhb_relax_1d5.csv", "foh", RELAXES, STAMPED),
    ("vhb_relax_2d0.csv", "bouc_wen", RELAXES, STAMPED),
    ("vhb_relax_3d0.csv", "foh", RELAXES, TIMED),
    ("vhb_cyc_0d01_2d0.csv", "bouc_wen", RELAXES, STAMPED),
    ("vhb_cyc_0d03_2d0_1.csv", "foh", RELAXES, STAMPED),
    ("vhb_cyc_0d05_2d0.csv", "prandtl_ishlinskii", RELAXES, STAMPED),
    ("silverbox.csv", "gain >> resonance", "a cubic spring", BARE | {"rate": "610.35 Hz"}),
    ("robot.csv", "gain >> resonance", "several flexible modes", BARE | {"rate": "100 Hz"}),
    ("tanks.csv", "gain >> sensor_lag", "overflow, outflow as a root",
     {"input": 0, "output": 2, "rate": "0.25 Hz"}),
    ("emps.mat", "gain >> sensor_lag", "an integrator, dry friction, a loop closed around it",
     {"input": "vir", "output": "qm", "rate": "1000 Hz", "input_unit": "V", "output_unit": "m"}),
)  # fmt: skip


def main() -> None:
    """Diagnose every recording, and write the table."""
    folder, rows = Path(os.environ["FRACJAX_OTHERS"]), []
    for name, model, documented, options in ROWS:
        row = {"recording": Path(name).stem, "model": model, "documented": documented}
        began = time.perf_counter()
        try:
            recording = fj.read(folder / name, **options)
            row |= {"samples": len(recording)} | _row(fj.diagnose(model, recording))
        except fj.InputError as error:
            row |= {"verdict": "refused", "sentence": str(error)}
        row["sentence"] = row["sentence"].replace(f"{folder}/", "")
        row["seconds"] = rounded(time.perf_counter() - began)
        rows.append(row)
        print(row, flush=True)
    table("others", rows)


def _row(diagnosis: fj.Diagnosis) -> dict[str, Any]:
    """What a diagnosis says, in one row."""
    held_out = diagnosis.held_out
    ratio = "" if held_out.extended_rmse is None else held_out.extended_rmse / held_out.base_rmse
    return {
        "verdict": diagnosis.verdict,
        "effects": " + ".join(effect.name for effect in diagnosis.effects),
        "confusable_with": " ".join(n for e in diagnosis.effects for n in e.confusable_with),
        "floor_from": diagnosis.noise.method,
        "residual_over_floor": rounded(diagnosis.base.scores.rmse / diagnosis.noise.sigma),
        "held_out_ratio": ratio and rounded(ratio),
        "complete": diagnosis.complete,
        "sentence": diagnosis.sentence,
    }


if __name__ == "__main__":
    main()
