"""A loop's step, and models of every law that runs in it."""

import os
import shutil
import subprocess
from functools import cache

import numpy as np

import fracjax as fj
from fracjax import blocks

STEP, LOW, HIGH = 1e-3, -20.0, 120.0
BAND = (0.1, 40.0)
TIMES = STEP * np.arange(2500)
SWINGS = 50 - 45 * np.cos(2 * np.pi * TIMES) * (1 - 0.2 * TIMES) + 5 * np.sin(14 * np.pi * TIMES)
"""A drive [V] that turns within its range, large and small."""

PLAYS = blocks.PrandtlIshlinskii(
    np.append(0.05, np.linspace(0.002, 0.006, 12)), 0.1, low=0.0, high=100.0
)
STACK = (
    blocks.DriveLag(1e-3)
    >> PLAYS
    >> blocks.SensorNonlinearity(0.02, 0.0, centre=4.0, span=8.0)
    >> blocks.KelvinVoigtCreep(0.01, 0.01)
    >> blocks.Resonance(180.0, 0.05)
)
"""A stage: lag, thirteen plays of a curve, the sensor's curve, four sections of creep, a mode."""
GAIN = blocks.QuasiStaticForce(0.05)
NONLINEAR = {
    "foh": blocks.FOH(0.05, 0.05, 1e-6, 0.1, -0.1),
    "plays": PLAYS,
    "bouc_wen": blocks.BoucWen(0.1, -0.5, 0.03),
    "minor loops": GAIN + blocks.MinorLoopMemory(np.full(6, 0.005), span=100.0),
    "drive memory": blocks.DriveMemory(np.full(6, 0.02), span=100.0) >> GAIN,
    "amplitude": blocks.AmplitudeDependence(0.1, 0.5, span=100.0) >> GAIN,
    "backlash": GAIN >> blocks.Backlash(0.3, 0.1, span=10.0),
    "curves": blocks.Electrostriction(0.02, centre=50.0, span=100.0)
    >> blocks.CubicNonlinearity(0.02, low=0.0, high=100.0)
    >> GAIN
    >> blocks.SensorNonlinearity(0.01, 0.01, centre=3.0, span=6.0),
    "gain drift": GAIN >> blocks.GainDrift(0.05, 0.0, 1.0, 1.5, speed=100.0, size=4.0),
    "foh + plays": blocks.FOH(0.05, 0.02, 0.0, 0.1, -0.1)
    + blocks.MinorLoopMemory(np.full(12, 0.004), span=100.0),
    "falling": blocks.QuasiStaticForce(-0.05)
    + blocks.MinorLoopMemory(np.full(6, -0.005), span=100.0),
}
LINEAR = {
    "lfdh": blocks.LFDH(),
    "creep": blocks.LogarithmicCreep(0.02, 0.05) >> GAIN,
    "dynamics": blocks.PEADynamics(0.1, 0.01, -0.1, 150.0, 0.05),
    "delay": GAIN >> blocks.Delay(3.4e-3, longest=1e-2),
    "mode beside": GAIN + blocks.Resonance(150.0, 0.1),
}
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
COMPILERS = [path for name in ("gcc", "clang") if (path := shutil.which(name))]


@cache
def checks_of(compiler: str) -> tuple[str, ...]:
    """The flags of a compiler's sanitizers; none where their library is not installed."""
    command = [compiler, *SANITIZED, "-x", "c", "-", "-o", os.devnull]
    done = subprocess.run(command, input=b"int main(void) { return 0; }", capture_output=True)
    return SANITIZED if done.returncode == 0 else ("-O1",)


def model(block) -> fj.Model:
    return fj.Model(block, "model")


def inverse_of(block, **options) -> fj.StreamingInverse:
    return fj.streaming_inverse(model(block), STEP, BAND, **{"limits": (LOW, HIGH), **options})


def model_of(block, **options) -> fj.StreamingModel:
    return fj.streaming_model(model(block), STEP, BAND, **{"limits": (LOW, HIGH), **options})
