"""Other packages on the same benchmarks and splits: they predict, and none says what is missing.

    ENVIRONMENT/bin/python -m benchmarks.real.peers [NAME …]

in an environment of its own, which has jax-sysid, SysIdentPy and PySINDy and no fracjax:
`pip install jax-sysid sysidentpy pysindy`.  FRACJAX_DATA is the folder of the recordings that
`machines.py` fetches.  Each is used as its documentation's examples do, with lags, orders and
thresholds chosen on the last fifth of the estimation data; the lines of code are those of its
function here.  For the positioning stage it is the regression of the benchmark's authors, whose
relative error is that on the estimation data, with NumPy and SciPy alone.
"""

from __future__ import annotations

import csv
import inspect
import os
import sys
import time
import warnings
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

HERE = Path(__file__).parent
HEADER = ("benchmark", "package", "test", "unit", "rms_error", "relative_percent", "parameters",
          "lines", "cpu_seconds")  # fmt: skip
ORDER = ["silverbox", "emps", "tanks", "f16", "wiener_hammerstein"]
Array = np.ndarray


class Split(NamedTuple):
    """Estimation data and tests: pairs of drive and response, and first samples not scored; the
    order is that of the dynamics where its authors say that it is high."""

    training: tuple[Array, Array]
    tests: dict[str, tuple[Array, Array, int]]
    step: float
    unit: str
    order: int = 0


def _columns(name: str) -> Array:
    path = Path(os.environ["FRACJAX_DATA"]) / "machines" / name
    return np.genfromtxt(path, delimiter=",", skip_header=1)


def splits() -> dict[str, Split]:
    """Those of `machines.py`."""
    tanks, silverbox = _columns("dataBenchmark.csv"), _columns("SNLS80mV.csv")[:, :2].T

    def part(begin: int, end: int) -> tuple[Array, Array]:
        return silverbox[0, begin:end], silverbox[1, begin:end]

    return {
        "silverbox": Split(
            part(40_650, 57_034),
            {"arrow head": (*part(0, 40_000), 50), "multisine": (*part(61_000, 127_500), 500)},
            2**14 / 1e7, "V",
        ),
        "tanks": Split(
            (tanks[:, 0], tanks[:, 2]), {"validation": (tanks[:, 1], tanks[:, 3], 0)}, 4.0, "V"
        ),
        "f16": _aircraft(),
        "wiener_hammerstein": _circuit(),
    }  # fmt: skip


def _aircraft() -> Split:
    """The last periods at three levels one after the other, all at half the rate."""
    from scipy.signal import resample

    period = 8192

    def periods(name: str, begin: int, end: int) -> tuple[Array, Array]:
        path = Path(os.environ["FRACJAX_DATA"]) / "machines" / f"F16Data_FullMSine_{name}.csv"
        lines = path.read_text().splitlines()[1 + begin * period : 1 + end * period]
        signals = np.array([[float(cell) for cell in line.split(",")[:4]] for line in lines])
        force, _, _, acceleration = np.asarray(resample(signals, len(lines) // 2)).T
        return force, acceleration

    steady = [periods(f"Level{level}", 8, 9) for level in (3, 5, 7)]
    force, acceleration = (np.concatenate(signals) for signals in zip(*steady, strict=True))
    tests = {
        f"level {level}": (*periods(f"Level{level}_Validation", 0, 3), period // 2)
        for level in (2, 4, 6)
    }
    return Split((force, acceleration), tests, 1 / 200, "m/s^2", 20)


def _circuit() -> Split:
    from scipy.io import loadmat

    data = loadmat(Path(os.environ["FRACJAX_DATA"]) / "machines" / "WienerHammerBenchMark.mat")
    drive, response = (np.ravel(data[f"{signal}BenchMark"]) for signal in "uy")

    def part(begin: int, end: int) -> tuple[Array, Array]:
        return drive[begin:end], response[begin:end]

    tests = {"test": (*part(100_000, 188_000), 1000)}
    return Split(part(10_000, 18_192), tests, 1 / 51_200, "V", 6)


Predictor = Callable[[Array, Array], Array]
"""The simulated response to a drive, from a response whose first samples may be used."""


def _rms(error: Array) -> float:
    return float(np.sqrt(np.mean(np.nan_to_num(error, nan=1e3) ** 2)))


def sysidentpy(split: Split, choice: Any) -> tuple[Predictor, int]:
    """A polynomial NARX by forward regression, simulated freely."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS

    degree, lags, terms = choice
    u, y = (signal[:, None] for signal in split.training)
    model = FROLS(
        n_terms=terms, order_selection=False, ylag=lags, xlag=lags,
        basis_function=Polynomial(degree=degree),
    )  # fmt: skip
    model.fit(X=u, y=y)

    def predict(drive: Array, response: Array) -> Array:
        start = response[: model.max_lag, None]
        return model.predict(X=drive[:, None], y=start)[:, 0]

    return predict, terms


def pysindy(split: Split, choice: Any) -> tuple[Predictor, int]:
    """A sparse discrete model of delayed responses, simulated freely."""
    import pysindy as ps

    degree, delays, threshold = choice
    u, y = split.training
    scale = np.std(u), np.std(y)

    def delayed(signal: Array) -> Array:
        columns = [signal[delays - 1 - k : signal.size - k] for k in range(delays)]
        return np.stack(columns, axis=1)

    model = ps.DiscreteSINDy(
        optimizer=ps.STLSQ(threshold=threshold), feature_library=ps.PolynomialLibrary(degree)
    )
    model.fit(delayed(y / scale[1]), t=1, u=delayed(u / scale[0]))
    row, powers = model.coefficients()[0], model.feature_library.powers_

    def predict(drive: Array, response: Array) -> Array:
        inputs = delayed(drive / scale[0])
        state = delayed(response / scale[1])[0]
        simulated = list(state[::-1])
        for now in inputs[:-1]:
            features = np.prod(np.concatenate([state, now]) ** powers, axis=1)
            following = float(np.clip(features @ row, -1e3, 1e3))
            state = np.concatenate([[following], state[:-1]])
            simulated.append(following)
        return scale[1] * np.array(simulated)

    return predict, int(np.count_nonzero(row))


def jax_sysid(split: Split, choice: Any) -> tuple[Predictor, int]:
    """A recurrent network with one hidden layer each, by Adam and L-BFGS."""
    import jax
    import jax.numpy as jnp
    from jax_sysid.models import Model

    states, units = choice
    jax.config.update("jax_enable_x64", True)
    u, y = (signal[:, None] for signal in split.training)
    mean, scale = (u.mean(), y.mean()), (u.std(), y.std())

    def advance(x: Any, u: Any, params: Any) -> Any:
        a, b, c, bias, first, second = params[:6]
        return a @ x + b @ u + second @ jnp.tanh(first @ x + c @ u + bias)

    def respond(x: Any, u: Any, params: Any) -> Any:
        return params[6] @ x + params[7]

    model = Model(states, 1, 1, state_fcn=advance, output_fcn=respond)
    generator = np.random.default_rng(0)
    shapes = [(states, states), (states, 1), (units, 1), (units,), (units, states),
              (states, units), (1, states), (1,)]  # fmt: skip
    start = [0.1 * generator.standard_normal(shape) for shape in shapes]
    # Of a radius below 1 with any number of states.
    start[0] = start[0] * (3 / states) ** 0.5 + 0.9 * np.eye(states)
    model.init(params=start)
    model.loss(rho_x0=1e-4, rho_th=1e-6)
    model.optimization(adam_epochs=300, lbfgs_epochs=600, iprint=-1)
    model.fit((y - mean[1]) / scale[1], (u - mean[0]) / scale[0])

    def predict(drive: Array, response: Array) -> Array:
        inputs = (drive[:, None] - mean[0]) / scale[0]
        window = slice(0, 50)
        outputs = (response[:, None] - mean[1]) / scale[1]
        first = model.learn_x0(inputs[window], outputs[window], verbosity=0)
        return mean[1] + scale[1] * np.asarray(model.predict(first, inputs)[0])[:, 0]

    return predict, sum(int(np.prod(shape)) for shape in shapes)


PEERS: dict[str, tuple[Callable, list]] = {
    "SysIdentPy": (sysidentpy, [(2, 3, 12), (3, 2, 15), (3, 3, 20)]),
    "PySINDy": (pysindy, [(2, 2, 1e-3), (3, 2, 1e-3), (3, 2, 1e-2), (3, 3, 1e-3)]),
    "jax-sysid": (jax_sysid, [(3, 8)]),
}


def choices_for(peer: str, split: Split) -> list:
    """A peer's choices, with as many lags or states as the dynamics have."""
    if not split.order:
        return PEERS[peer][1]
    n = split.order
    return {
        "SysIdentPy": [(2, n, 20), (3, min(n, 6), 20)],
        "PySINDy": [(1, n, 1e-4), (2, n, 1e-3)],
        "jax-sysid": [(n, 8)],
    }[peer]


def chosen(build: Callable, split: Split, choices: list) -> tuple[Predictor, int]:
    """The choice that simulates the last fifth of the estimation data best, fitted to all."""
    u, y = split.training
    at = u.size * 4 // 5
    shorter = split._replace(training=(u[:at], y[:at]))

    def error(choice: Any) -> float:
        return _rms(build(shorter, choice)[0](u[at:], y[at:]) - y[at:])

    return build(split, choices[0] if len(choices) == 1 else min(choices, key=error))


def idim_ls() -> dict[str, tuple[float, float]]:
    """The rms error of the stage's inverse model by least squares, and of the force itself [N], by
    the test; filters and decimation are those of the authors' Script_IDIM_LS.m."""
    from scipy.io import loadmat
    from scipy.signal import butter, decimate, filtfilt

    def regression(name: str) -> tuple[Array, Array]:
        path = Path(os.environ["FRACJAX_DATA"]) / "machines" / name
        data = {key: np.ravel(v) for key, v in loadmat(path).items() if key[0] != "_"}
        position = filtfilt(*butter(4, 100 / 500), data["qm"])
        velocity = np.gradient(position, 1e-3)
        columns = (np.gradient(velocity, 1e-3), velocity, np.sign(velocity), np.ones(velocity.size))
        force = data["gtau"][0] * data["vir"] + data.get("pulses_N", 0.0)
        *regressors, force = (decimate(c[50:-50], 10, ftype="iir") for c in (*columns, force))
        return np.stack(regressors, axis=1), force

    estimation, pulses = map(regression, ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"))
    parameters = np.linalg.lstsq(*estimation, rcond=None)[0]
    return {
        test: (_rms(force - columns @ parameters), _rms(force))
        for test, (columns, force) in {"pulses": pulses, "estimation": estimation}.items()
    }


def emps_rows() -> list[dict]:
    """The rows of the positioning stage."""
    began = time.process_time()
    errors = idim_ls()
    seconds = time.process_time() - began
    return [
        {
            "benchmark": "emps", "package": f"IDIM-LS by SciPy {version('scipy')}", "test": test,
            "unit": "N", "rms_error": f"{error:.3g}",
            "relative_percent": f"{100 * error / whole:.3g}",
            "parameters": 4, "lines": len(inspect.getsource(idim_ls).splitlines()),
            "cpu_seconds": f"{seconds:.3g}",
        }
        for test, (error, whole) in errors.items()
    ]  # fmt: skip


def written(again: list[str]) -> list[dict]:
    """The rows that the table has of other benchmarks."""
    with (HERE / "peers.csv").open(encoding="utf-8", newline="") as file:
        return [row for row in csv.DictReader(file) if row["benchmark"] not in again]


def main() -> None:
    """Write `peers.csv`."""
    warnings.simplefilter("ignore")
    names = sys.argv[1:] or ORDER
    rows = written(names) + (emps_rows() if "emps" in names else [])
    for name in set(names) - {"emps"}:
        split = splits()[name]
        for peer, (build, _) in PEERS.items():
            began = time.process_time()
            predict, parameters = chosen(build, split, choices_for(peer, split))
            seconds = time.process_time() - began
            for test, (drive, response, skipped) in split.tests.items():
                error = (predict(drive, response) - response)[skipped:]
                rows.append(
                    {
                        "benchmark": name, "package": f"{peer} {version(peer)}", "test": test,
                        "unit": split.unit, "rms_error": f"{_rms(error):.3g}",
                        "relative_percent": f"{100 * _rms(error) / _rms(response[skipped:]):.3g}",
                        "parameters": parameters,
                        "lines": len(inspect.getsource(build).splitlines()),
                        "cpu_seconds": f"{seconds:.3g}",
                    }
                )  # fmt: skip
                print(rows[-1], flush=True)
    order = {name: k for k, name in enumerate(ORDER)}
    with (HERE / "peers.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, HEADER, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda row: order[row["benchmark"]]))


if __name__ == "__main__":
    main()
