"""The inverse in a loop: motions that are not known ahead, three stages, six controllers.

    python -m benchmarks.compensation.real_time --out benchmarks/compensation

Each stage (`stage.py`) has another law of hysteresis, none of them fracjax's, before the same
creep, mode and sensor.  A model is fitted to one record of it; `--identify` fits anew, else the
fits kept in fits/ are used.  The loop runs at 2 kHz, in the record's range of drives.  Before each
motion the stage is swung over its range twice by the controller itself, as `stage.h` asks where a
history is not known.

real_time.csv: rms and largest error of the sensor's reading in shares of the motion's stroke, its
first quarter left out; and how far the model is from the reading under the same drive, rms, which
no inverse of it can be better than.  `offline` is `compensate`, to which the whole motion is known.
Its drive is found every 2 ms and followed by a spline: a lag and a mode sampled at 2 kHz have zeros
outside the unit circle, so that the drive with the desired response at every sample rings.  It is
left out where a period has too few samples.
`real time` is the whole inverse; `linear part` an inverse of gain, creep, lag and mode without
hysteresis; `plays` of hysteresis without them; `integral` feedback alone, as fast as the mode
allows with a gain margin of 6 dB; `real time + integral` both.

adaptive.csv: a stage whose gain falls by 8 % and whose zero moves, as when it warms under load: the
inverse as it was fitted, the same with feedback of the integral, and the one whose gains follow.
"""

from __future__ import annotations

import argparse
import csv
import ctypes
import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter

import fracjax as fj
from benchmarks.compensation.stage import NOISE, Duhem, Relays, Stage, Stops, measure
from benchmarks.versions import versions
from fracjax import blocks
from fracjax._compensate import settled_offset

STEP = 5e-4  # s
LOW, HIGH = 0.0, 98.0  # V, the record's
SLEW = (HIGH - LOW) / (10 * STEP)
"""V/s, of the amplifier: its range in ten samples.  At a corner a mode's inverse asks for more,
up and down within two samples, and the hysteresis turns on that detour."""
LAWS = {"stops": Stops, "relays": Relays, "Duhem": Duhem}
SLOW = 18.0  # Hz, a tenth of the mode
STRUCTURE = "drive_lag >> prandtl_ishlinskii >> sensor_nonlinearity >> creep >> resonance"
BAND = 0.1, 40.0  # Hz
COLUMNS = "stage", "motion", "drive", "rms_percent", "max_percent", "model_percent"
WARM = "inverse", "seconds", "rms_percent"
_INTEGRAL = 30.0  # 1/s
_INSET = 0.15
_EVERY = 4
"""Samples of the loop in one of `compensate`."""
_FASTEST = 20.0  # Hz, of the motions that `compensate` follows, 25 samples a period


def times(seconds: float) -> np.ndarray:
    return STEP * np.arange(round(seconds / STEP))


def record() -> np.ndarray:
    """The identifying drive (N,): swings of several heights and rates, holds, and a chirp."""
    t = times(3.0)
    falling = 49 * (1 - np.cos(2 * np.pi * 2 * t) * (1 - t / 3.2))
    slow = 49 * (1 - np.cos(2 * np.pi * times(2.0)))
    held = np.concatenate([np.linspace(falling[-1], 60, 400), np.full(1600, 60.0)])
    chirp = 60 + 8 * np.sin(2 * np.pi * (1 + 35 * times(2.0)) * times(2.0))
    inner = 45 + 25 * np.sin(2 * np.pi * 3 * times(1.0)) + 12 * np.sin(2 * np.pi * 11 * times(1.0))
    back = np.linspace(45, 0, 1000)
    ramp = np.linspace(chirp[-1], 45, 200)
    return np.concatenate(
        [np.zeros(400), slow, falling, held, chirp, ramp, inner, back, np.zeros(1000)]
    )


def motions() -> dict[str, np.ndarray]:
    """Shapes (N,) between 0 and 1 of motions."""
    t = times(2.0)
    walk = np.cumsum(np.random.default_rng(5).standard_normal(t.size))
    walk = lfilter(*butter(3, SLOW, fs=1 / STEP), walk - walk[0])
    shapes = {
        f"sine {rate:g} Hz": (1 - np.cos(2 * np.pi * rate * t)) / 2
        for rate in (1, 3, 10, SLOW, 50, 100)
    }
    shapes["falling sine 5 Hz"] = (1 - np.cos(2 * np.pi * 5 * t) * (1 - t / 2.5)) / 2
    shapes["triangle 5 Hz"] = 1 - np.abs(1 - 2 * (5 * t % 1))
    shapes["random walk"] = (walk - walk.min()) / np.ptp(walk)
    return shapes


def structure(recording: fj.Recording) -> fj.Model:
    """Lag, plays of a curve, the sensor's curve, creep, and a mode."""
    low, high = float(recording.drive.min()), float(recording.drive.max())
    span = float(np.ptp(recording.response))
    weights = span / (high - low) * np.append(0.6, np.full(12, 0.03))
    block = (
        blocks.DriveLag(1e-3)
        >> blocks.PrandtlIshlinskii(weights, low=low, high=high)
        >> blocks.SensorNonlinearity(centre=span / 2, span=span)
        >> blocks.LogarithmicCreep(0.01, 0.01)
        >> blocks.Resonance(200.0, 0.05)
    )
    return fj.Model(block, STRUCTURE)


def identify(path: Path, recording: fj.Recording) -> None:
    """Write the fit of one stage."""
    fj.fit(structure(recording), recording, history="rest", starts=1).save(path)


def compiled(inverse: fj.StreamingInverse, folder: Path) -> Path:
    """An inverse in C, compiled as what a controller would load."""
    inverse.write_c(folder, "stage")
    library = folder / "stage.so"
    flags = ["-std=c99", "-O2", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "-o", str(library), str(folder / "stage.c"), "-lm"], check=True)
    return library


class Loop:
    """An inverse in C, started at rest at 0 V."""

    def __init__(self, library: Path):
        self.functions = ctypes.CDLL(str(library))
        self.state = ctypes.create_string_buffer(65536)
        self.output, self.predicted = ctypes.c_double(), ctypes.c_double()
        self.functions.stage_start(self.state, ctypes.c_double(0.0), ctypes.c_double(STEP))

    def __call__(self, *inputs: float) -> float:
        """The drive for one sample."""
        results = ctypes.byref(self.output), ctypes.byref(self.predicted)
        self.functions.stage_step(self.state, *map(ctypes.c_double, inputs), *results)
        return self.output.value

    def ahead(self, desired: float, _: float) -> float:
        """The drive, without a look at the reading."""
        return self(desired)


class Integral:
    """Feedback: the integral of the error, which stops at a bound."""

    def __init__(self, bound: float):
        self.value, self.bound = 0.0, bound

    def __call__(self, error: float) -> float:
        self.value = min(max(self.value + _INTEGRAL * STEP * error, -self.bound), self.bound)
        return self.value


def driven(
    control: Callable[[float, float], float],
    desired: np.ndarray,
    law: type,
    change: Callable[[float], tuple[float, float]] = lambda _: (1.0, 0.0),
) -> tuple[np.ndarray, np.ndarray]:
    """What the sensor reads (N,) [um] under a drive (N,) [V] of the desired motion and the reading.

    `change` gives by the time [s] a factor of the reading and an offset [um], as of a warm stage.
    """
    stage, noise = Stage(law(), STEP), np.random.default_rng(2)
    readings, drives = np.empty((2, desired.size))
    for n, aim in enumerate(desired):
        gain, offset = change(n * STEP)
        readings[n] = gain * stage.reading + offset + NOISE * noise.standard_normal()
        drives[n] = control(aim, readings[n])
        stage(drives[n])
    return readings, drives


def parts(model: fj.Model, recording: fj.Recording) -> tuple[fj.Model, fj.Model]:
    """The model's linear part, with the mean slope for its hysteresis, and its plays alone."""
    lag, plays, curve, creep, mode = in_series(model.block)
    slope = float(np.ptp(recording.response) / np.ptp(recording.drive))
    linear = lag >> blocks.QuasiStaticForce(slope) >> creep >> mode
    return fj.Model(linear, "linear part"), fj.Model(plays >> curve, "plays")


def in_series(block: fj.AbstractBlock) -> list[fj.AbstractBlock]:
    """The blocks of a chain, in order."""
    if not hasattr(block, "second"):
        return [block]
    return [*in_series(block.first), *in_series(block.second)]  # type: ignore[attr-defined]


def stream(model: fj.Model, offset: float, **options) -> fj.StreamingInverse:
    bounds = {"limits": (LOW, HIGH), "slew": SLEW}
    return fj.streaming_inverse(model, STEP, BAND, offset=offset, **bounds, **options)


def with_integral(loop: Loop) -> Callable[[float, float], float]:
    """An inverse whose motion is corrected by the integral of the error."""
    integral = Integral(1.0)
    return lambda aim, read: loop(aim + integral(aim - read))


def controllers(
    model: fj.Model, recording: fj.Recording, offset: float, folder: Path
) -> dict[str, Callable[[], Callable[[float, float], float]]]:
    """The controllers in the loop, each made anew for every motion."""
    linear, plays = parts(model, recording)
    slope = float(np.ptp(recording.response) / np.ptp(recording.drive))
    libraries = {
        name: compiled(stream(each, offset), folder / name.replace(" ", "_"))
        for name, each in {"real time": model, "linear part": linear, "plays": plays}.items()
    }

    def feedback() -> Callable[[float, float], float]:
        integral = Integral(HIGH)
        return lambda aim, read: float(np.clip(integral((aim - read) / slope), LOW, HIGH))

    return {
        **{name: lambda path=path: Loop(path).ahead for name, path in libraries.items()},
        "integral": feedback,
        "real time + integral": lambda: with_integral(Loop(libraries["real time"])),
    }


class Fitted(NamedTuple):
    """A model with the sensor's zero, where the stage began at rest and for one that rested."""

    model: fj.Model
    begun: float
    rested: float


def fitted(path: Path) -> Fitted:
    """A fit that was written."""
    model, content = fj.load_model(path), json.loads(path.read_text(encoding="utf-8"))
    begun, duration = content["offsets"][0], content["setting"]["duration"]
    return Fitted(model, begun, settled_offset(model, begun, "rest", duration))


def offline(one: Fitted, desired: np.ndarray) -> Callable[[float, float], float]:
    """The drive of `compensate`, played sample by sample."""
    wanted = fj.Trajectory(desired[::_EVERY], _EVERY * STEP)
    every = fj.compensate(one.model, wanted, history="rest", offset=one.begun).drive
    spline = CubicSpline(_EVERY * np.arange(every.size), every)
    drive = iter(np.clip(spline(np.arange(desired.size)), LOW, HIGH))
    return lambda aim, read: float(next(drive))


def ends(recording: fj.Recording) -> tuple[float, float]:
    """The readings [um] between which a stage swings that was driven over the record's range."""
    swung = round(2.4 / STEP)  # after two swings from 0 to 98 V
    return recording.response[swung - 1000 : swung].min(), recording.response.max()


def eased(start: float, end: float, seconds: float) -> np.ndarray:
    """A motion (N,) from one reading [um] to another, half a sine."""
    return start + (end - start) * (1 - np.cos(np.pi * times(seconds) / seconds)) / 2


def tracked(name: str, one: Fitted, recording: fj.Recording, folder: Path) -> list[dict]:
    """Every motion by every controller, on one stage."""
    law, rows = LAWS[name], []
    begin = controllers(one.model, recording, one.rested, folder / name)
    observer = fj.streaming_model(one.model, STEP, BAND, limits=(LOW, HIGH), offset=one.rested)
    low, high = ends(recording)
    swings = [eased(0.0, high, 0.5), *(eased(*two, 0.5) for two in ((high, low), (low, high)))]
    last = slice(-round(1.5 / STEP), None)
    for motion, shape in motions().items():
        shape = low + (high - low) * (_INSET + (1 - 2 * _INSET) * shape)
        desired = np.concatenate([*swings, eased(high, low, 0.5), eased(low, shape[0], 0.5), shape])
        known = {"offline": lambda wanted=desired: offline(one, wanted)}
        slow = not motion.startswith("sine") or float(motion.split()[1]) < _FASTEST
        for drive, make in {**(known if slow else {}), **begin}.items():
            read, applied = driven(make(), desired, law)
            by_model = observer.run(applied, observer.start(0.0)).output
            errors = (100 * (read - x)[last] / np.ptp(shape) for x in (desired, by_model))
            error, models = errors
            values = np.sqrt(np.mean(error**2)), np.abs(error).max(), np.sqrt(np.mean(models**2))
            texts = (name, motion, drive, *(f"{v:.3g}" for v in values))
            rows.append(dict(zip(COLUMNS, texts, strict=True)))
            print("  ".join(f"{text:>22}" for text in texts), flush=True)
    return rows


def warmed(one: Fitted, recording: fj.Recording, rmse: float, folder: Path) -> list[dict]:
    """A stage that changes, by the fixed inverse and by the adaptive one."""
    seconds = 40.0
    low, high = ends(recording)
    walk = np.cumsum(np.random.default_rng(6).standard_normal(times(seconds).size))
    walk = lfilter(*butter(2, [0.3, 5.0], "bandpass", fs=1 / STEP), walk)
    shape = np.clip(0.5 + walk / (6 * walk.std()), 0.1, 0.9)
    shape = low + (high - low) * (_INSET + (1 - 2 * _INSET) * shape)
    swings = [eased(0.0, high, 0.5), eased(high, low, 0.5), eased(low, high, 0.5)]
    desired = np.concatenate([*swings, eased(high, low, 0.5), eased(low, shape[0], 0.5), shape])
    rows = []
    adaptation = fj.Adaptation(memory=20.0, error=rmse)

    def change(t: float) -> tuple[float, float]:
        return 1 - 0.08 * t / seconds, -0.3 * t / seconds

    for name, adaptive in (("fixed", None), ("fixed + integral", None), ("adaptive", adaptation)):
        inverse = stream(one.model, one.rested, adaptive=adaptive)
        loop = Loop(compiled(inverse, folder / name.replace(" ", "_")))
        control = loop if adaptive else loop.ahead
        if "integral" in name:
            control = with_integral(loop)
        read, _ = driven(control, desired, Stops, change)
        error = 100 * (read - desired)[-shape.size :] / np.ptp(shape)
        for part, where in enumerate(np.array_split(error, 4)):
            values = name, f"{10 * part}..{10 * part + 10}", f"{np.sqrt(np.mean(where**2)):.3g}"
            rows.append(dict(zip(WARM, values, strict=True)))
            print(values, flush=True)
    return rows


def written(path: Path, columns: tuple[str, ...], rows: list[dict]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(versions(("fracjax", "jax", "numpy", "scipy", "optimistix")))
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="The folder of the two tables.")
    parser.add_argument("--identify", action="store_true", help="Fit the models anew.")
    given = parser.parse_args()
    rows, warm = [], []
    with TemporaryDirectory() as scratch:
        for name, law in LAWS.items():
            drive, fit = record(), given.out / "fits" / f"real-time-{name}.json"
            recording = fj.Recording(drive, measure(drive, 1, 0.0, law, STEP), STEP, source=name)
            if given.identify:
                identify(fit, recording)
            one = fitted(fit)
            rows += tracked(name, one, recording, Path(scratch))
            if law is Stops:
                rmse = json.loads(fit.read_text(encoding="utf-8"))["scores"]["rmse"]
                warm = warmed(one, recording, rmse, Path(scratch))
    written(given.out / "real_time.csv", COLUMNS, rows)
    written(given.out / "adaptive.csv", WARM, warm)


if __name__ == "__main__":
    main()
