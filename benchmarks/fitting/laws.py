"""Laws of actuators in NumPy alone, by which recordings are made, and which SciPy fits.

A law is a sum of columns times gains; the columns depend on the shapes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import OptimizeResult, least_squares

Range = tuple[float, float]
Shapes = Sequence[float] | np.ndarray


class Signals:
    """A drive (N,) [V] in steps of time [s], and what linear operators make of it.

    A convolution with the quadrature of second order, by one transform on a circle of twice the
    length.
    """

    def __init__(self, drive: np.ndarray, step: float):
        self.drive, self.size = drive, drive.size
        self.speed = np.abs(np.gradient(drive, step))
        self.length = 2 ** int(np.ceil(np.log2(2 * drive.size)))
        radius = 1e-10 ** (1 / self.length)
        zeta = radius * np.exp(-2j * np.pi * np.arange(self.length // 2 + 1) / self.length)
        self.s = ((1 - zeta) + (1 - zeta) ** 2 / 2) / step
        self.damping = radius ** np.arange(drive.size)
        self.transform = self.forward(drive - drive[0])

    def forward(self, signal: np.ndarray) -> np.ndarray:
        """The transform of a signal (N,)."""
        return np.fft.rfft(signal * self.damping, self.length)

    def back(self, transform: np.ndarray) -> np.ndarray:
        """The signal (N,) of a transform."""
        return np.fft.irfft(transform, self.length)[: self.size] / self.damping

    def after(self, symbol: np.ndarray) -> np.ndarray:
        """The drive's moving part after an operator."""
        return self.back(symbol * self.transform)


class Law(NamedTuple):
    """A law of actuators.

    Attributes:
        columns: the columns at given shapes.
        names: fracjax's names of the shapes, after "lg " where a shape is the logarithm.
        gains: the range of each column's gain in recordings.
        truths: the range of each shape in recordings.
        start: where SciPy's first descent starts.
        bounds: of each shape.
        starts: where its other descents start.
    """

    columns: Callable[[Signals, Shapes], list[np.ndarray]]
    names: tuple[str, ...]
    gains: tuple[Range, ...]
    truths: tuple[Range, ...]
    start: tuple[float, ...]
    bounds: tuple[Range, ...]
    starts: tuple[Range, ...]


def foh(on: Signals, shapes: Shapes) -> list[np.ndarray]:
    """u, D^α u and |u̇| D^β u."""
    alpha, beta = shapes
    return [on.drive, on.after(on.s**alpha), on.speed * on.after(on.s**beta)]


def lfdh(on: Signals, shapes: Shapes) -> list[np.ndarray]:
    """1 and s^δ over 1 + χ s^μ, with lg χ, δ and μ."""
    chi, delta, mu = shapes
    low = 1 / (1 + 10**chi * on.s**mu)
    return [on.after(low), on.after(low * on.s**delta)]


def creep(on: Signals, shapes: Shapes) -> list[np.ndarray]:
    """s^-μ, with lg μ."""
    return [on.after(on.s ** -(10 ** shapes[0]))]


def coupled(on: Signals, shapes: Shapes) -> list[np.ndarray]:
    """FOH's columns after s^-μ, with α, β and lg μ."""
    alpha, beta, mu = shapes[0], shapes[1], 10 ** shapes[2]
    late = on.s**-mu
    rated = on.forward(on.speed * on.after(on.s**beta))
    return [on.after(late), on.after(late * on.s**alpha), on.back(late * rated)]


def pea_dynamics(on: Signals, shapes: Shapes) -> list[np.ndarray]:
    """1 and s^μ over 1 + 2 ζ x + x², x = s/ω_0, with μ, lg f_0 and lg ζ."""
    mu, frequency, damping = shapes
    x = on.s / (2 * np.pi * 10**frequency)
    mode = 1 / (1 + 2 * 10**damping * x + x * x)
    return [on.after(mode), on.after(mode * on.s**mu)]


_ORDER, _LINEAR, _HYSTERETIC, _RATED = (-0.95, 0.95), (0.05, 0.1), (0.02, 0.05), (2e-4, 2e-4)
LAWS = {
    "foh": Law(
        foh, ("alpha", "beta"), (_LINEAR, _HYSTERETIC, _RATED), ((0.05, 0.3), (-0.3, -0.1)),
        (0.1, -0.1), (_ORDER, _ORDER), ((-0.6, 0.6), (-0.6, 0.6)),
    ),
    "lfdh": Law(
        lfdh, ("lg chi", "delta", "mu"), ((0.01, 0.03), (0.08, 0.16)),
        ((-1.0, -0.4), (0.2, 0.4), (0.5, 0.7)),
        (-0.7, 0.2, 0.45), ((-6.0, 3.0), (1e-3, 0.999), (1e-3, 0.999)),
        ((-2.0, 0.5), (0.02, 0.6), (0.05, 0.9)),
    ),
    "creep": Law(
        creep, ("lg mu",), (_LINEAR,), ((-2.3, -1.4),), (-2.0,), ((-5.0, -0.5),), ((-3.0, -1.4),)
    ),
    "coupled": Law(
        coupled, ("foh.alpha", "foh.beta", "lg creep.mu"), (_LINEAR, _HYSTERETIC, _RATED),
        ((0.05, 0.3), (-0.3, -0.1), (-2.3, -1.4)), (0.1, -0.1, -2.0),
        (_ORDER, _ORDER, (-5.0, -0.5)), ((-0.6, 0.6), (-0.6, 0.6), (-3.0, -1.4)),
    ),
    "pea_dynamics": Law(
        pea_dynamics, ("mu", "lg frequency", "lg damping"), (_LINEAR, (0.01, 0.03)),
        ((-0.3, -0.1), (1.3, 1.6), (-1.0, -0.3)), (-0.1, 1.5, -0.7),
        (_ORDER, (-1.0, 3.0), (-4.0, 1.0)),
        ((-0.5, 0.5), (1.0, 2.0), (-2.3, -0.3)),
    ),
}  # fmt: skip


def response_of(
    law: Law, drive: np.ndarray, step: float, generator: np.random.Generator
) -> tuple[np.ndarray, list[float]]:
    """The response (N,) [um] of a law at random shapes and gains, and the shapes."""
    shapes, gains = (
        [generator.uniform(low, high) for low, high in ranges] for ranges in (law.truths, law.gains)
    )
    return np.stack(law.columns(Signals(drive, step), shapes), axis=1) @ gains, shapes


def fit_by_scipy(
    law: Law, drive: np.ndarray, response: np.ndarray, step: float, count: int
) -> tuple[float, float]:
    """RMSE [um] and first shape, by variable projection from `count` starts."""
    on, generator = Signals(drive, step), np.random.default_rng(0)
    low, high = np.transpose(law.starts)
    shares = generator.uniform(size=(count - 1, len(law.start)))
    starts = [law.start, *(low + (high - low) * shares)]
    ends = [descend_by_scipy(law, on, response, start) for start in starts]
    best = min(ends, key=lambda result: result.cost)
    return float(np.sqrt(np.mean(best.fun**2))), float(best.x[0])


def fit_finely_by_scipy(
    law: Law, drive: np.ndarray, response: np.ndarray, step: float
) -> tuple[float, float]:
    """RMSE [um] and first shape, from one start, with steps halved on a cubic spline of the drive
    until that lowers the RMSE by less than 1 %."""
    samples, finer = np.arange(drive.size), 1
    end = descend_by_scipy(law, Signals(drive, step), response, law.start)
    while finer < 8:
        finer *= 2
        fine = CubicSpline(samples, drive)(np.arange(finer * (drive.size - 1) + 1) / finer)
        before = end.cost
        end = descend_by_scipy(law, Signals(fine, step / finer), response, end.x, finer)
        if end.cost > 0.99**2 * before:
            break
    return float(np.sqrt(np.mean(end.fun**2))), float(end.x[0])


def descend_by_scipy(
    law: Law, on: Signals, response: np.ndarray, start: Shapes, finer: int = 1
) -> OptimizeResult:
    """The end of one descent, with gains eliminated; a response for every `finer` of the drive."""

    def residual(shapes: np.ndarray) -> np.ndarray:
        columns = [column[::finer] for column in law.columns(on, shapes)]
        basis = np.stack([*columns, np.ones_like(response)], axis=1)
        return response - basis @ np.linalg.lstsq(basis, response, rcond=None)[0]

    return least_squares(residual, start, bounds=tuple(np.transpose(law.bounds)))
