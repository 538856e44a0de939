"""D^0.4 t² by fracjax and its peers, in one run: time, error against the closed form, ratios.

Run: python -m benchmarks.operators.run --out benchmarks/operators/results.csv
Peers that are not installed are left out: differint, differintP, pycaputo, torch, ducc0, mkl_fft.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import scipy.fft
from scipy.special import gamma

from benchmarks.versions import versions
from fracjax import Grid, derivative
from fracjax._operators import generating_function
from fracjax._operators._convolution_quadrature import circle

ORDER = 0.4
LENGTHS = (1_000, 5_000, 10_000, 100_000, 1_000_000)
PACKAGES = ("fracjax", "jax", "jaxlib", "numpy", "scipy", "torch", "differint", "differintP",
            "pycaputo", "ducc0", "mkl_fft")  # fmt: skip
COLUMNS = ("N", "method", "seconds", "over_scipy", "max_error", "note")
_QUADRATIC_LIMIT = 10_000  # beyond it the O(N²) peers would take minutes

Run = Callable[[], object]
Method = tuple[str, Run, str]


def gl_weights(count: int) -> np.ndarray:
    j = np.arange(1, count)
    return np.concatenate([[1.0], np.cumprod((j - 1 - ORDER) / j)])


def by_transform(signal: np.ndarray, step: float, fft) -> np.ndarray:
    """Grünwald–Letnikov by two real transforms, as one writes it in NumPy or SciPy."""
    count = signal.size
    length = scipy.fft.next_fast_len(2 * count, True)
    product = fft.rfft(gl_weights(count), length) * fft.rfft(signal, length)
    return fft.irfft(product, length)[:count] * step**-ORDER


def fracjax_methods(signal: np.ndarray, step: float) -> list[Method]:
    grid, drive = Grid(step, "rest"), jnp.asarray(signal)
    length, radius = circle(signal.size)
    zeta = radius * np.exp(-2j * np.pi * np.arange(length // 2 + 1) / length)
    logarithm = jnp.asarray(np.log(generating_function(zeta, 4) / step))
    growth = jnp.asarray(radius ** -np.arange(signal.size, dtype=float))
    spectrum = jnp.fft.rfft(drive / growth, length)

    def kept(order, spectrum):
        return jnp.fft.irfft(jnp.exp(order * logarithm) * spectrum, length)[: signal.size] * growth

    def total(order, drive):
        return jnp.sum(derivative(order, drive, grid) ** 2)

    first = jax.jit(lambda a, u: derivative(a, u, grid, 1))
    fourth = jax.jit(lambda a, u: derivative(a, u, grid, 4))
    summed, both, kept = jax.jit(total), jax.jit(jax.value_and_grad(total)), jax.jit(kept)
    return [
        ("fracjax, first order", lambda: first(ORDER, drive), "Grünwald–Letnikov"),
        ("fracjax", lambda: fourth(ORDER, drive), "fourth order"),
        ("fracjax, a sum of squares", lambda: summed(ORDER, drive), "value"),
        ("fracjax, its gradient too", lambda: both(ORDER, drive), "value and d/d order"),
        ("fracjax, spectrum kept", lambda: kept(ORDER, spectrum), "fourth order"),
    ]


def peer_methods(signal: np.ndarray, step: float) -> list[Method]:
    """Whatever is installed."""
    count = signal.size
    length = scipy.fft.next_fast_len(2 * count, True)
    end = step * (count - 1)
    half = scipy.fft.rfft(signal, length)
    methods: list[Method] = [
        ("numpy", lambda: by_transform(signal, step, np.fft), "Grünwald–Letnikov by FFT"),
        ("bare scipy.fft", lambda: scipy.fft.irfft(scipy.fft.rfft(signal, length), length), ""),
        ("bare jax.numpy.fft", _bare_jax(signal, length), "jitted"),
    ]
    for name, make in (
        ("ducc0", lambda m: lambda: m.fft.c2r(m.fft.r2c(_padded(signal, length)), lastsize=length)),
        ("mkl_fft", lambda m: lambda: m.irfft(m.rfft(signal, length), length)),
    ):
        if module := _installed(name):
            methods.append((f"bare {name}", make(module), ""))
    if torch := _installed("torch"):
        methods.append(("torch", _torch(torch, signal, step), "Grünwald–Letnikov by FFT"))
        methods.append(("torch, bare", _torch_bare(torch, half, length), "one inverse transform"))
    if _installed("differint"):
        module = importlib.import_module("differint.differint")
        note = "convolves circularly"
        methods.append(("differint GL", lambda: module.GL(ORDER, signal, 0.0, end, count), note))
        if count <= _QUADRATIC_LIMIT // 10:
            methods.append(
                ("differint RL", lambda: module.RL(ORDER, signal, 0.0, end, count), "dense matrix")
            )
    if module := _installed("differintP"):
        methods.append(("differintP GL", lambda: module.GL(ORDER, signal, 0.0, end, count), ""))
    if _installed("pycaputo") and count <= _QUADRATIC_LIMIT:
        methods.append(("pycaputo L1", _pycaputo(end, count), "Caputo, O(N²)"))
    return methods


def _padded(signal: np.ndarray, length: int) -> np.ndarray:
    return np.pad(signal, (0, length - signal.size))


def _bare_jax(signal: np.ndarray, length: int) -> Run:
    run = jax.jit(lambda u: jnp.fft.irfft(jnp.fft.rfft(u, length), length))
    drive = jnp.asarray(signal)
    return lambda: run(drive)


def _torch(torch, signal: np.ndarray, step: float) -> Run:
    drive, count = torch.from_numpy(signal), signal.size
    length = scipy.fft.next_fast_len(2 * count, True)
    j, one = torch.arange(1, count, dtype=torch.float64), torch.ones(1, dtype=torch.float64)

    def run():
        weights = torch.cat([one, torch.cumprod((j - 1 - ORDER) / j, 0)])
        product = torch.fft.rfft(weights, length) * torch.fft.rfft(drive, length)
        return torch.fft.irfft(product, length)[:count] * step**-ORDER

    return run


def _torch_bare(torch, half: np.ndarray, length: int) -> Run:
    spectrum = torch.from_numpy(half)
    return lambda: torch.fft.irfft(spectrum, length)


def _pycaputo(end: float, count: int) -> Run:
    from pycaputo.differentiation import caputo, diff
    from pycaputo.grid import make_uniform_points

    method, points = caputo.L1(alpha=ORDER), make_uniform_points(count, a=0.0, b=end)
    return lambda: diff(method, lambda t: t**2, points)


def _installed(name: str):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(name)
    except ImportError:
        return None


def timed(run: Run, budget: float = 1.0) -> tuple[float, np.ndarray]:
    """The least time of at least three runs, for about `budget` seconds, and the result."""
    result = np.asarray(jax.block_until_ready(run()))
    least, began, runs = np.inf, time.perf_counter(), 0
    while runs < 3 or time.perf_counter() - began < budget:
        start = time.perf_counter()
        jax.block_until_ready(run())
        least, runs = min(least, time.perf_counter() - start), runs + 1
    return least, result


def compile_seconds(count: int) -> float:
    """Compiling the derivative for a new length, tracing included."""
    drive, grid = jnp.linspace(0.0, 1.0, count), Grid(1 / count, "rest")
    began = time.perf_counter()
    jax.jit(lambda a, u: derivative(a, u, grid)).lower(ORDER, drive).compile()
    return time.perf_counter() - began


def rows_for(count: int) -> list[dict]:
    """All methods at one length, each as a ratio to SciPy's first-order time in this run."""
    step = 1 / count
    times = step * np.arange(count)
    signal = times**2
    exact = 2 / gamma(3 - ORDER) * times ** (2 - ORDER)
    by_scipy: Method = (
        "scipy",
        lambda: by_transform(signal, step, scipy.fft),
        "Grünwald–Letnikov by FFT",
    )
    rows = []
    for name, run, note in [by_scipy, *fracjax_methods(signal, step), *peer_methods(signal, step)]:
        seconds, result = timed(run)
        compared = result.shape == (count,) and "bare" not in name
        error = np.nanmax(np.abs(result - exact)) if compared else None
        values = (count, name, seconds, None, error, note)
        rows.append(dict(zip(COLUMNS, values, strict=True)))
        print(f"{count:>8} {name:<28} {seconds:.2e} s   {error or 0:.1e}", flush=True)
    for row in rows:
        row["over_scipy"] = row["seconds"] / rows[0]["seconds"]
    return rows


def main() -> None:
    """Write the table."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    with jax.enable_x64(True), options.out.open("w", newline="") as file:
        file.write(versions(PACKAGES))
        table = csv.DictWriter(file, COLUMNS)
        table.writeheader()
        for count in LENGTHS:
            rows = rows_for(count)
            values = (count, "fracjax, compile", compile_seconds(count), None, None, "per length")
            rows.append(dict(zip(COLUMNS, values, strict=True)))
            for row in rows:
                for key in ("seconds", "over_scipy", "max_error"):
                    if row[key] is not None:
                        row[key] = f"{row[key]:.3g}"
                table.writerow(row)


if __name__ == "__main__":
    main()
