"""Recordings of other people's machines, chosen and answered for before they were diagnosed.

    python -m benchmarks.real.others [NAME …]

Each row states what is documented of the machine beyond the model that is believed, in the
catalogue's names: `documented` are the effects of which one at least must be named, `plausible`
those that may be named beside.  A name that is neither is invented.  Where nothing is documented,
nothing must be named.  The files are listed in machines.txt and never part of this package.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import fracjax as fj
from benchmarks.real import machines
from benchmarks.real.recordings import (
    fsm_cubespec,
    low_passed,
    mr_damper,
    piezo_dbo,
    renew,
    rounded,
)

LAG = ("sensor_lag", "drive_lag")
MODE = ("resonance", "second_mode")
SLOW = ("creep", "viscoelastic_layer")
DRIFT = ("thermal_drift", "gain_drift", "degradation")


class Row(NamedTuple):
    """A recording, the model that is believed of it if any, and what is documented."""

    recording: str
    machine: str
    model: str | None
    documented: tuple[str, ...]
    plausible: tuple[str, ...]
    why: str
    read: Callable[[], fj.Recording]


def _file(name: str, **options: Any) -> Callable[[], fj.Recording]:
    """A file as a user of the shell would read it."""
    return lambda: fj.read(machines.path_of(f"others/{name}"), **options)


def _damper(name: str) -> Callable[[], fj.Recording]:
    """Displacement [in] and friction force [kip] at 1024 Hz."""

    def read() -> fj.Recording:
        with open(machines.path_of(f"others/{name}"), encoding="utf-8") as file:
            columns = np.array(json.load(file)["data"])
        return fj.Recording(
            25.4 * columns[:, 1], 4448.22 * columns[:, 2], 1 / 1024,
            drive_unit="mm", response_unit="N", source=name,
        )  # fmt: skip

    return read


def _magnet(name: str) -> Callable[[], fj.Recording]:
    """Current [A] and integrated gradient [T], one a minute, from the table of a report."""

    def read() -> fj.Recording:
        text = Path(machines.path_of(f"others/{name}")).read_text(encoding="latin-1")
        lines = text.splitlines()
        start = next(k for k, line in enumerate(lines) if line.lstrip().startswith("----")) + 1
        rows = []
        for line in lines[start:]:
            fields = line.split()
            if len(fields) != 8:
                break
            rows.append([float(fields[0]), float(fields[2])])
        current, field = np.array(rows).T
        return fj.Recording(
            current, field, 60.0, drive_unit="A", response_unit="T", source=name
        )  # fmt: skip

    return read


def _circuit() -> fj.Recording:
    """Input and capacitor voltage of a circuit."""
    columns = np.genfromtxt(machines.path_of("others/rlc.csv"), delimiter=",", skip_header=1)
    return fj.Recording(
        columns[:, 3], columns[:, 1], 5e-7, drive_unit="V", response_unit="V", source="rlc.csv"
    )


def _mirror() -> fj.Recording:
    """One axis and realisation, two periods at a quarter of the rate."""
    drives, responses = fsm_cubespec()
    drive, response = (
        low_passed(signal[:, 0, 0], 700.0, 4).T.ravel() for signal in (drives, responses)
    )
    return fj.Recording(
        drive, response, 4 / 6400, drive_unit="V", response_unit="um", source="fsm_cubespec"
    )


def _training(name: str) -> Callable[[], fj.Recording]:
    """The estimation data of a benchmark."""
    return lambda: machines.CASES[name]().training[0]


STRETCHED = {"input": 1, "output": 2, "input_unit": "mm", "output_unit": "N"}
STAMPED = STRETCHED | {"resample": "50 Hz"}
BARE = {"input": 0, "output": 1}
RING = {
    "time": 0,
    "input": 5,
    "output": 6,
    "time_unit": "ms",
    "input_unit": "mm",
    "output_unit": "N",
}
SLOW_SERVO = {"resample": "10 Hz", "mask": "bad"}
ELASTOMER = "a VHB4910 elastomer relaxes viscoelastically; stretch to force"
FRICTION = "a band brake: dry friction with backlash, which path curves hold"
O_RING = "the friction of an O-ring, which path curves hold; air leaks"
MAGNET = "a magnet's hysteresis alone, measured at rest"
SERVO = "a servo's backlash and limited speed, one of ten readings a second"
MOTOR = "a motor (an integrator with a lag) turns a flexible ruler (two modes)"

ROWS = (
    Row("vhb_relax_1d5", "elastomer", None, SLOW, (), ELASTOMER,
        _file("vhb_relax_1d5.csv", **STAMPED)),
    Row("vhb_relax_2d0", "elastomer", None, SLOW, (), ELASTOMER,
        _file("vhb_relax_2d0.csv", **STAMPED)),
    Row("vhb_relax_3d0", "elastomer", None, SLOW, (), ELASTOMER,
        _file("vhb_relax_3d0.csv", **STRETCHED)),
    Row("vhb_cyc_0d03_2d0_1", "elastomer", None, SLOW, DRIFT, ELASTOMER,
        _file("vhb_cyc_0d03_2d0_1.csv", **STAMPED)),
    Row("vhb_cyc_0d05_2d0", "elastomer", None, SLOW, DRIFT, ELASTOMER,
        _file("vhb_cyc_0d05_2d0.csv", **STAMPED)),
    Row("silverbox", "circuit with a cubic spring", None, MODE, (), "one mode",
        _training("silverbox")),
    Row("silverbox", "circuit with a cubic spring", "oscillator", ("cubic_stiffness",), (),
        "a cubic spring", _training("silverbox")),
    Row("bouc_wen", "oscillator with hysteresis", "oscillator", ("hysteretic_spring",), (),
        "a hysteretic spring", _training("bouc_wen")),
    Row("emps", "positioning stage", "impedance", ("dry_friction",), (), "dry friction",
        _training("emps")),
    Row("tanks", "cascaded tanks", None, LAG, (), "two tanks in series, each a lag",
        _training("tanks")),
    Row("tanks", "cascaded tanks", "lag", ("root_outflow", "internal_saturation"), (),
        "outflow by a root, overflow", _training("tanks")),
    Row("robot", "robot arm", None, MODE, LAG, "several flexible modes",
        _file("robot.csv", **BARE, rate="100 Hz")),
    Row("exchanger", "heat exchanger", None, (*LAG, "delay"), (), "a lag and a dead time",
        _file("exchanger.csv", time=0, input=1, output=2, time_unit="s")),
    Row("ball_and_beam", "ball on a beam", "mass", (), ("dry_friction",), "two integrators",
        _file("ball_and_beam.csv", **BARE, rate="10 Hz")),
    Row("faster", "hydraulic fatigue rig", None, LAG, ("delay",), "a lag of some 8 s",
        _file("faster.csv", input="u", output="d", input_unit="V", output_unit="mm",
              rate="128.98 Hz")),
    Row("damper_half_20", "friction damper", None, (), (), FRICTION,
        _damper("damper_half_20.json")),
    Row("damper_1_80", "friction damper", None, (), (), FRICTION, _damper("damper_1_80.json")),
    Row("damper2_half_36", "friction damper", None, (), (), FRICTION,
        _damper("damper2_half_36.json")),
    Row("oring_circle_3", "pneumatic cylinder", None, (), DRIFT, O_RING,
        _file("oring_circle_3.csv", **RING, resample="100 Hz")),
    Row("oring_kidney_2", "pneumatic cylinder", None, (), DRIFT, O_RING,
        _file("oring_kidney_2.csv", **RING, resample="90 Hz")),
    Row("motor_swept1_angle", "motor with a flexible ruler", None, LAG, (*MODE, "delay"), MOTOR,
        _file("motor_swept1-0-10hz.txt", time=0, input=2, output=4)),
    Row("motor_swept1_acceleration", "motor with a flexible ruler", None, MODE, (*LAG, "delay"),
        MOTOR, _file("motor_swept1-0-10hz.txt", time=0, input=2, output=5)),
    Row("motor_fixed1_angle", "motor with a flexible ruler", None, LAG, (*MODE, "delay"), MOTOR,
        _file("motor_fixed1-5hz.txt", time=0, input=2, output=4)),
    Row("magnet_ru3", "quadrupole magnet", None, (), (), MAGNET, _magnet("magnet_ru3.dat")),
    Row("magnet_ru4", "quadrupole magnet", None, (), (), MAGNET, _magnet("magnet_ru4.dat")),
    Row("servo_single", "servo", None, ("slew_rate_limit",), (*LAG, "delay"), SERVO,
        _file("servo_single.csv", input="target pos (5)", output="pos (5)", **SLOW_SERVO)),
    Row("servo_nocomp2", "servo", None, ("slew_rate_limit",), (*LAG, "delay"), SERVO,
        _file("servo_nocomp2.csv", input="target pos (1)", output="pos (1)", **SLOW_SERVO)),
    Row("piezo_dbo_steady", "piezo stage", None, (*DRIFT, *LAG, "delay"), (),
        "the stroke shrinks; a sample late", lambda: piezo_dbo()[0]),
    Row("piezo_dbo_nested", "piezo stage", None, (*DRIFT, *LAG, "delay"), (),
        "the stroke shrinks; a sample late", lambda: piezo_dbo()[1]),
    Row("fsm_cubespec", "steering mirror", None, MODE, (*LAG, "delay", *SLOW),
        "flexible modes", _mirror),
    Row("mr_damper", "magnetorheological damper", None, (), (),
        "hysteresis of the force over the speed; no effect of the catalogue",
        lambda: mr_damper("ensaio4.2")),
    Row("wiener_hammerstein", "two filters and a diode", None, (*LAG, *MODE), ("delay",),
        "low-pass filters of third order before and after a diode",
        _training("wiener_hammerstein")),
    Row("rlc", "circuit with a saturating coil", None, MODE, (), "one mode, simulated", _circuit),
)  # fmt: skip


def answered(row: Row) -> dict[str, Any]:
    """What the diagnosis says of a recording, and how it stands to what is documented."""
    out: dict[str, Any] = {
        "recording": row.recording,
        "machine": row.machine,
        "model": row.model or "",
        "documented": "|".join(row.documented),
        "why": row.why,
    }
    began = time.perf_counter()
    try:
        recording = row.read()
        diagnosis = fj.diagnose(row.model, recording)
    except fj.InputError as error:
        return out | {"verdict": "refused", "sentence": str(error).rsplit("/", 1)[-1]}
    said = [{e.name, *e.confusable_with} for e in diagnosis.effects]
    allowed = {*row.documented, *row.plausible, "hysteresis_shape"}
    shown = {v.effect for v in diagnosis.can_show if v.size is not None}
    held_out = diagnosis.held_out
    after = held_out.extended_rmse
    right = any(names & {*row.documented} for names in said)
    return out | {
        "samples": len(recording),
        "verdict": diagnosis.verdict,
        "effects": " + ".join("|".join([e.name, *e.confusable_with]) for e in diagnosis.effects),
        "probability": " ".join(rounded(e.probability) for e in diagnosis.effects),
        "right": int(right if row.documented else not any(s - allowed for s in said)),
        "cannot_show": int(bool(row.documented) and not {*row.documented} & shown),
        "invented": " + ".join(
            e.name for e, s in zip(diagnosis.effects, said, strict=True) if not s & allowed
        ),
        "residual_over_floor": rounded(diagnosis.base.scores.rmse / diagnosis.noise.sigma),
        "held_out_before": rounded(held_out.base_rmse),
        "held_out_after": "" if after is None else rounded(after),
        "unit": recording.response_unit,
        "complete": diagnosis.complete,
        "seconds": rounded(time.perf_counter() - began),
        # Without the folder of this machine.
        "sentence": diagnosis.sentence.replace(recording.source, row.recording),
    }


def main() -> None:
    """Diagnose the recordings that are asked for, or all, and write their rows of the table."""
    wanted, rows = sys.argv[1:], []
    for row in ROWS:
        if not wanted or row.recording in wanted:
            rows.append(answered(row))
            print(rows[-1], flush=True)
    renew("others", rows, ("recording", "model"), [(r.recording, r.model or "") for r in ROWS])


if __name__ == "__main__":
    main()
