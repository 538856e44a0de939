"""The script that a SciPy user would write: read a recording, fit the same model, save it.

Run: python -m benchmarks.startup.scipy_fit FILE MODEL OUT
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares


def foh(shapes: np.ndarray, u: np.ndarray, s: np.ndarray, damping: np.ndarray, step: float):
    """Columns u, D^α u and |u̇| D^β u."""
    n, size = 2 * (s.size - 1), u.size
    moved = np.fft.rfft((u - u[0]) * damping, n)

    def after(order: float) -> np.ndarray:
        return np.fft.irfft(s**order * moved, n)[:size] / damping

    speed = np.abs(np.gradient(u, step))
    return [u, after(shapes[0]), speed * after(shapes[1])]


def lfdh(shapes: np.ndarray, u: np.ndarray, s: np.ndarray, damping: np.ndarray, step: float):
    """Columns of (k_1 + k_2 s^δ)/(1 + χ s^μ)."""
    n, size = 2 * (s.size - 1), u.size
    chi, delta, mu = 10 ** shapes[0], shapes[1], shapes[2]
    low = np.fft.rfft((u - u[0]) * damping, n) / (1 + chi * s**mu)
    return [np.fft.irfft(x, n)[:size] / damping for x in (low, low * s**delta)]


MODELS = {
    "foh": (foh, ([-0.95, -0.95], [0.95, 0.95])),
    "lfdh": (lfdh, ([-6, 1e-3, 1e-3], [3, 0.999, 0.999])),
}
STARTS = 8


def main() -> None:
    """Fit from eight starts with gains eliminated, as fracjax does."""
    path, model, out = sys.argv[1:]
    columns_of, bounds = MODELS[model]
    t, u, y = np.loadtxt(path, delimiter=",", skiprows=1).T
    step = float(np.mean(np.diff(t)))
    n = 2 ** int(np.ceil(np.log2(2 * u.size)))
    radius = 1e-10 ** (1 / n)
    zeta = radius * np.exp(-2j * np.pi * np.arange(n // 2 + 1) / n)
    s, damping = ((1 - zeta) + (1 - zeta) ** 2 / 2) / step, radius ** np.arange(u.size)

    def residual(shapes: np.ndarray) -> np.ndarray:
        columns = np.column_stack([*columns_of(shapes, u, s, damping, step), np.ones(u.size)])
        return y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]

    rng = np.random.default_rng(0)
    low, high = map(np.array, bounds)
    starts = low + (high - low) * rng.uniform(0.2, 0.8, (STARTS, low.size))
    best = min((least_squares(residual, x, bounds=bounds) for x in starts), key=lambda r: r.cost)
    Path(out).write_text(json.dumps({"shapes": best.x.tolist(), "cost": float(best.cost)}))


if __name__ == "__main__":
    main()
