"""Public benchmarks of machines whose missing physics is documented, inside their dynamics.

    python -m benchmarks.real.machines [NAME …]

What is documented is written down here before any of them is diagnosed.  Each is fitted on its
benchmark's own estimation data by a linear machine; the effects that the diagnosis names are beside
what is documented, and the errors of the linear and the extended machine are those on the
benchmark's own test data.  The recordings are listed in machines.txt and never part of this
package.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import h5py
import numpy as np
import pooch
from scipy.io import loadmat
from scipy.signal import butter, filtfilt, resample

import fracjax as fj
from benchmarks.real.recordings import HERE, renew, rounded
from fracjax import blocks
from fracjax._inside import Inside, error_on, inquire_inside
from fracjax._operators import History
from fracjax._prepare import prepare
from fracjax._solve import Solved

_ORIGIN = pooch.create(path=pooch.os_cache("fracjax"), base_url="")
_ORIGIN.load_registry(HERE / "machines.txt")


def path_of(name: str) -> str:
    """Where a recording lies: where FRACJAX_DATA points, else fetched from its origin."""
    local = Path(os.environ.get("FRACJAX_DATA", "")) / name
    if local.is_file() and pooch.file_hash(str(local)) == _ORIGIN.registry[name]:
        return str(local)
    return _ORIGIN.fetch(name)


_EMPS_BAND = 40.0
"""The band that drive and response are both cut to [Hz], the benchmark's for its regression."""


class Case(NamedTuple):
    """A benchmark.

    Attributes:
        documented: the names of the physics that its authors document, in the catalogue's words.
        source: where they do.
        machine: the linear machine that it is believed to be.
        training: recordings for the fit.
        tests: recordings for the error by the name of the test, and how many of their first samples
            are not scored.
        history: of all their drives.
        oversampling: steps of the simulation per sample.
        settling: first samples that are not fitted.
        read: first samples of a test that its start is read from.
    """

    documented: tuple[str, ...]
    source: str
    machine: Any
    training: list[fj.Recording]
    tests: dict[str, tuple[fj.Recording, int]]
    history: History = "rest"
    oversampling: int = 2
    settling: int = 0
    read: int = 0


def silverbox() -> Case:
    """A circuit that is a mass on a cubic spring: odd multisines, and an arrow head of noise."""
    drive, response = np.genfromtxt(
        path_of("machines/SNLS80mV.csv"), delimiter=",", skip_header=1
    ).T[:2]

    def part(begin: int, end: int) -> fj.Recording:
        return fj.Recording(
            drive[begin:end], response[begin:end], 2**14 / 1e7, drive_unit="V", response_unit="V",
            source="silverbox",
        )  # fmt: skip

    span = float(np.ptp(response) / np.ptp(drive))
    return Case(
        documented=("cubic_stiffness",),
        source="Wigren & Schoukens, European Control Conference (2013), pp. 2933-2938",
        machine=blocks.Oscillator(span, 60.0, 0.1),
        training=[part(40_650, 40_650 + 16_384)],
        tests={
            "arrow head": (part(0, 40_000), 0),
            "multisine": (part(61_000, 127_500), 500),
        },
    )


def emps() -> Case:
    """A motor's stage on a guide in closed loop, position to force, both low-passed (IDIM-LS)."""
    return Case(
        documented=("dry_friction",),
        source="Janot, Gautier & Brunot, Nonlinear System Identification Benchmarks (2019)",
        machine=blocks.Impedance(stiffness=0.0, damping=200.0, mass=100.0, springpot=None),
        training=[_emps("machines/DATA_EMPS.mat")],
        tests={
            "pulses": (_emps("machines/DATA_EMPS_PULSES.mat"), 100),
            "estimation": (_emps("machines/DATA_EMPS.mat"), 100),
        },
        history="constant",
        oversampling=1,
        settling=100,
    )


def _emps(name: str) -> fj.Recording:
    """Position [m] and motor force [N] at 500 Hz, both low-passed alike."""
    data = {key: np.ravel(value) for key, value in loadmat(path_of(name)).items() if key[0] != "_"}
    force = data["gtau"][0] * data["vir"] + data.get("pulses_N", 0.0)
    low_pass = butter(4, _EMPS_BAND / 500)
    position, force = (filtfilt(*low_pass, signal) for signal in (data["qm"], force))
    middle = slice(200, -200, 2)  # the filter's ends are not the machine's
    return fj.Recording(
        position[middle], force[middle], 2e-3, drive_unit="m", response_unit="N", source=name
    )


def tanks() -> Case:
    """Two tanks, one above the other, which overflow."""
    columns = np.genfromtxt(path_of("machines/dataBenchmark.csv"), delimiter=",", skip_header=1)
    estimation, validation = (
        fj.Recording(
            columns[:, k], columns[:, k + 2], 4.0, drive_unit="V", response_unit="V", source="tanks"
        )
        for k in (0, 1)
    )
    return Case(
        documented=("root_outflow", "internal_saturation"),
        source="Schoukens & Noel, IFAC-PapersOnLine 50 (2017) 446",
        machine=blocks.Lag(3.0, (100.0, 100.0)),
        training=[estimation],
        tests={"validation": (validation, 0)},
        history="rest",
        oversampling=1,
        read=50,
    )


def bouc_wen() -> Case:
    """A simulated mass on a spring with hysteresis, driven by multisines and a sine sweep.

    The test's multisine is a steady period: it is simulated twice, and the second scored.
    """

    def recording(name: str, signal: str, samples: int | None, repeats: int) -> fj.Recording:
        with h5py.File(path_of(f"machines/{name}.h5")) as file:
            drive, response = (np.ravel(file[f"{signal}/{s}"])[:samples] for s in "uy")
        return fj.Recording(
            np.tile(drive, repeats), np.tile(1e3 * response, repeats), 1 / 750,
            drive_unit="N", response_unit="mm", source=f"{name} {signal}",
        )  # fmt: skip

    return Case(
        documented=("hysteretic_spring",),
        source="Noel & Schoukens, Hysteretic benchmark with a dynamic nonlinearity (2016)",
        machine=blocks.Oscillator(0.02, 35.0, 0.05),
        training=[recording("train", "multisine", 8192, 1)],
        tests={
            "multisine": (recording("test", "multisine", None, 2), 8192),
            "sine sweep": (recording("test", "sinesweep", None, 1), 0),
        },
        oversampling=4,
    )


_PERIOD = 8192
"""Samples of a period of the aircraft's multisines, at 400 Hz.  A steady one is simulated twice,
and the second counts."""
_MODES = (3.47, 3.96, 5.18, 6.59, 7.32, 9.18, 17.0)
"""Starts of the aircraft's frequencies [Hz]: the peaks of the response over the force at the lowest
level, and one for what is above the band."""


def f16() -> Case:
    """An aircraft on the ground, shaken under a wing by three levels of a multisine: acceleration
    of the wing beside the joint of a payload that slides in a rail."""

    def periods(name: str, begin: int, end: int) -> np.ndarray:
        lines = Path(path_of(f"machines/F16Data_FullMSine_{name}.csv")).read_text().splitlines()
        cells = (line.split(",") for line in lines[1 + begin * _PERIOD : 1 + end * _PERIOD])
        return np.array([(float(row[0]), float(row[3])) for row in cells]).T

    def recording(name: str, signals: np.ndarray, rate: float) -> fj.Recording:
        force, acceleration = signals
        return fj.Recording(
            force, acceleration, 1 / rate, drive_unit="N", response_unit="m/s^2",
            source=f"F-16 {name}",
        )  # fmt: skip

    def steady(level: int) -> fj.Recording:
        """The last period, at a quarter of the rate: the band ends at 15 Hz."""
        fewer = resample(periods(f"Level{level}", 8, 9), _PERIOD // 4, axis=1)
        return recording(f"level {level}", np.tile(fewer, 2), 100.0)

    def validation(level: int) -> tuple[fj.Recording, int]:
        signals = periods(f"Level{level}_Validation", 8, 9)
        return recording(f"level {level}", np.tile(signals, 2), 400.0), _PERIOD

    count = len(_MODES)
    modes = blocks.Modes(np.full(count, -1e-6), _MODES, np.full(count, 0.02), "acceleration")
    # The structure rings as long as its period: a free start would be fitted to what it leaves out.
    rest = fj.Parameter(np.zeros(2 * count), "response", fixed=True)
    machine = eqx.tree_at(lambda block: block.start, blocks.Within(modes), rest)
    return Case(
        documented=("clearance", "dry_friction"),
        source="Noel & Schoukens, F-16 aircraft benchmark based on ground vibration test data "
        "(2017)",
        machine=machine,
        training=[steady(level) for level in (3, 5, 7)],
        tests={f"level {level}": validation(level) for level in (2, 4, 6)},
        oversampling=1,
        settling=_PERIOD // 4,
    )


def wiener_hammerstein() -> Case:
    """A circuit of a Chebyshev filter, a diode with a resistor, and an inverse Chebyshev filter,
    whose zeros lie where the noise that drives it still is."""
    data = loadmat(path_of("machines/WienerHammerBenchMark.mat"))
    drive, response = (np.ravel(data[f"{signal}BenchMark"]) for signal in "uy")

    def part(begin: int, end: int) -> fj.Recording:
        return fj.Recording(
            drive[begin:end], response[begin:end], 1 / 51_200, drive_unit="V", response_unit="V",
            source="Wiener-Hammerstein",
        )  # fmt: skip

    return Case(
        documented=("diode",),
        source="Schoukens, Suykens & Ljung, Wiener-Hammerstein benchmark, 15th IFAC Symposium on "
        "System Identification (2009)",
        machine=blocks.Filters(
            1.0, (4000.0, 5000.0), (0.5, 0.5), (4000.0, 5000.0), (9000.0, 6000.0), (0.0, 0.0)
        ),
        training=[part(10_000, 18_192)],
        tests={"test": (part(100_000, 188_000), 1000)},
    )


CASES: dict[str, Callable[[], Case]] = {
    "silverbox": silverbox,
    "emps": emps,
    "tanks": tanks,
    "bouc_wen": bouc_wen,
    "f16": f16,
    "wiener_hammerstein": wiener_hammerstein,
}


def answer(case: Case) -> tuple[Inside, dict[str, tuple[float, float]], float]:
    """The inquiry, the errors of the linear and the extended machine by test, and seconds."""
    began = time.perf_counter()
    preparation = prepare(case.training, history=case.history, settling=case.settling)
    preparation = replace(preparation, oversampling=case.oversampling)
    inside = inquire_inside(case.machine, preparation)
    seconds = time.perf_counter() - began

    def error(solved: Solved, recording: fj.Recording, skipped: int) -> float:
        return error_on(solved, recording, case.history, skipped, case.read)[0]

    errors = {
        name: (error(inside.base, *test), error(inside.extended, *test))
        for name, test in case.tests.items()
    }
    return inside, errors, seconds


def main() -> None:
    """Answer every case that is asked for, and write its rows of the table."""
    rows = []
    for name in sys.argv[1:] or CASES:
        case = CASES[name]()
        inside, errors, seconds = answer(case)
        for c in inside.candidates:
            print(" + ".join(c.names) or "nothing", rounded(c.ratio), rounded(c.probability))
        print(fj.Model(inside.block), flush=True)
        for test, (linear, extended) in errors.items():
            recording, _ = case.tests[test]
            rows.append(
                {
                    "benchmark": name,
                    "documented": " + ".join(case.documented),
                    "named": " + ".join(inside.names),
                    "sets": " + ".join("|".join(names) for names in inside.sets),
                    "probability": rounded(inside.candidates[0].probability),
                    "outside": inside.outside,
                    "test": test,
                    "unit": case.training[0].response_unit,
                    "rms": rounded(np.sqrt(np.mean(recording.response**2))),
                    "linear": rounded(linear),
                    "extended": rounded(extended),
                    "parameters": sum(
                        p.value.size
                        for p in fj.Model(inside.block).parameters.values()
                        if not p.fixed
                    ),
                    "seconds": rounded(seconds),
                    "source": case.source,
                }
            )
            print(rows[-1], flush=True)
    renew("machines", rows, ("benchmark",), [(name,) for name in CASES])


if __name__ == "__main__":
    main()
