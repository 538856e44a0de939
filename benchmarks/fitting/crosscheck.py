"""Does the gradient fit stand at the optimum?  Beside swarm, evolution and SciPy, on 27 recordings.

    FRACJAX_DATA=DIR python -m benchmarks.fitting.crosscheck

Five synthetic recordings of each of four laws, from the exam's simulator, which shares no numerics
with any of the methods, with 0.1 % of noise; and real ones: a piezo stack's steady cycles and
nested loops, one axis of a fast steering mirror, three loops of a magnetorheological damper.  All
methods minimise one objective: the whitened residual of `fracjax.crosscheck`, which settles history
and noise; particle swarm and evolution look 40 × 200 times, with gains eliminated and over all
parameters.  SciPy's `least_squares` starts from 16 points, its Jacobian by differences.
`over_best` is the root of the gradient fit's objective over the best one, `rmse_over_best` the
ratio of the e_RMS of the two; at most 1.0001 agrees.  A recording that fails is a row with its
reason.

The table goes on where it was interrupted.  About half a minute per recording and core; the damper,
whose law is integrated step by step, up to five.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import equinox as eqx
import jax
import numpy as np
from scipy.optimize import least_squares

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from benchmarks.fitting.tables import HERE, Table
from benchmarks.real import fsm_cubespec, mr_damper
from benchmarks.real.recordings import fsm_cubespec as mirror
from benchmarks.real.recordings import mr_damper as damper
from benchmarks.real.recordings import piezo_dbo
from fracjax._crosscheck._variable_projection import project
from fracjax._prepare._layout import layout_of, position_of, with_shapes_at
from fracjax._prepare._setting import setting_of

STEP = 2e-3  # s
SAMPLES = 2000
NOISE = 1e-3  # of the span
SEEDS = 5
AGREED = 1.0001
STARTS = 16
PACKAGES = ("fracjax", "jax", "jaxlib", "numpy", "scipy", "optimistix", "jaxopt")
COLUMNS = ("recording", "model", "samples", "gradient_rmse", "unit", "over_best", "rmse_over_best",
           "agrees", "best", "bounded", "pso", "de", "scipy", "seconds", "reason")  # fmt: skip

Case = tuple[str, str, Callable[[], fj.Recording]]


# Recordings ---------------------------------------------------------------------------------------


def synthetic(name: str, seed: int) -> fj.Recording:
    """A law at gains and shapes of its own, driven by four tones, on a grid 32 times finer."""
    generator = np.random.default_rng([seed, *name.encode()])
    times = np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER
    frequencies = np.array([0.7, 2.3, 5.9, 11.7]) * generator.uniform(0.9, 1.1, 4)
    phases = generator.uniform(0, 2 * np.pi, 4)
    drive = 50 + np.sin(2 * np.pi * np.outer(times, frequencies) + phases) @ [15, 10, 7, 5]
    base = BASES[name]
    clean = base.response(drive, STEP / OVER, base.draw(generator))[::OVER]
    noise = NOISE * np.ptp(clean) * generator.standard_normal(SAMPLES)
    return fj.Recording(drive[::OVER], clean + noise, STEP)


def mirror_axis() -> fj.Recording:
    """The first axis' answer to itself alone, below the modes."""
    drives, responses = mirror()
    own = fsm_cubespec.alone(*(signals[:, :, :3] for signals in (drives, responses)), 0)
    return fsm_cubespec.recordings(*own, "axis 0")[0]


def cases() -> Iterator[Case]:
    for name in BASES:
        for seed in range(SEEDS):
            yield f"{name} {seed}", name, lambda name=name, seed=seed: synthetic(name, seed)
    for model in ("foh", "lfdh"):
        yield "piezo_dbo steady", model, lambda: piezo_dbo()[0].window(0, 4000)
    yield "piezo_dbo nested", "coupled", lambda: piezo_dbo()[1].window(0, 4000)
    yield "fsm_cubespec axis 0", "pea_dynamics", mirror_axis
    for name in ("ensaio4.2", "ensaio1.2", "ensaio.A.2"):
        yield f"mr_damper {name}", "bouc_wen", lambda name=name: mr_damper.moving(damper(name))


# Methods ------------------------------------------------------------------------------------------


@eqx.filter_jit
def residual(position, block, problems):
    """The whitened residual at a point of the unit cube, gains and own terms at their best."""
    return project(with_shapes_at(block, position), problems)[1]


def by_scipy(found: fj.Crosscheck, seed: int) -> float:
    """The least objective from 16 points of the cube, its Jacobian by differences."""
    fit = found.fit
    block, problems = fit.model.block, fit.preparation.problems()
    size = sum(size for _, size in layout_of(block).shapes)
    generator = np.random.default_rng(seed)

    def whitened(position: np.ndarray) -> np.ndarray:
        return np.nan_to_num(np.asarray(residual(position, block, problems)), nan=1e6, posinf=1e6)

    runs = [
        least_squares(whitened, start, bounds=(0, 1), x_scale="jac")
        for start in generator.uniform(0.02, 0.98, (STARTS, size))
    ]
    return 2 * min(float(run.cost) for run in runs)


def row_of(case: Case, swarm: tuple[int, int]) -> dict:
    """All methods on one recording, each by its objective over the gradient fit's."""
    name, model, taken = case
    row = dict.fromkeys(COLUMNS, "") | {"recording": name, "model": model, "agrees": False}
    began = time.perf_counter()
    try:
        recording = taken()
        with jax.enable_x64(True):
            found = fj.crosscheck(
                fj.parse_model(model, setting_of([recording])),
                recording,
                population=swarm[0],
                iterations=swarm[1],
            )
            gradient = found.rows[0]
            of_gradient = fit_cost(found)
            scipy = float(np.sqrt(by_scipy(found, 0) / of_gradient))
    except Exception as error:
        return row | {"reason": f"{type(error).__name__}: {' '.join(str(error).split())}"}
    rows = {
        kind: [r for r in found.rows if r.method.startswith(start)]
        for kind, start in (("bounded", "bounded"), ("pso", "PSO"), ("de", "DE"))
    }
    ratios = {
        kind: min(r.over_best for r in some) / gradient.over_best for kind, some in rows.items()
    } | {"scipy": scipy}
    best = min(ratios, key=ratios.__getitem__)
    over_best = max(1 / ratios[best], 1.0)
    least = min(found.rows, key=lambda r: r.over_best)
    return row | {
        "samples": len(recording),
        "gradient_rmse": f"{gradient.rmse:.6g}",
        "unit": recording.response_unit,
        "over_best": f"{over_best:.7f}",
        "rmse_over_best": f"{gradient.rmse / least.rmse:.7f}",
        "agrees": over_best <= AGREED,
        "best": best if over_best > AGREED else "gradient",
        **{kind: f"{ratio:.7f}" for kind, ratio in ratios.items()},
        "seconds": f"{time.perf_counter() - began:.0f}",
        "reason": "" if found.fit.converged else "the gradient fit did not converge",
    }


def fit_cost(found: fj.Crosscheck) -> float:
    """χ² of the gradient fit, by the very function that SciPy minimises."""
    block, problems = found.fit.model.block, found.fit.preparation.problems()
    return float(np.sum(np.asarray(residual(position_of(block), block, problems)) ** 2))


def main() -> None:
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "crosscheck.csv")
    parser.add_argument("--only", nargs="+", help="Of these words one begins a recording's name.")
    parser.add_argument("--swarm", type=int, nargs=2, default=(40, 200), metavar=("P", "T"))
    options = parser.parse_args()
    table = Table(options.out, COLUMNS, ("recording", "model"), PACKAGES)
    for case in cases():
        chosen = not options.only or case[0].startswith(tuple(options.only))
        if chosen and case[:2] not in table.done():
            table.add([row_of(case, tuple(options.swarm))])
    rows = table.rows()
    agreed = [row for row in rows if row["agrees"] == "True"]
    print(f"{len(agreed)} of {len(rows)} gradient fits at the best of all methods (1.0001)")


if __name__ == "__main__":
    main()
