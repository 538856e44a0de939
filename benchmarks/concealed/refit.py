"""What a base absorbs: its least-squares refit, its tangent space, and quick chord steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares

from .columns import Columns
from .drives import Array
from .truth import Base


class Absorber:
    """Refits of one base to displacements on one drive; gains and an offset are eliminated."""

    def __init__(self, base: Base, columns: Columns, shape: Sequence[float]) -> None:
        self.base, self.columns = base, columns
        self.low, self.high = np.array(list(base.shapes.values())).T
        self.shape = np.asarray(shape, float)

    def matrix(self, shape: Sequence[float]) -> Array:
        """Columns of the gains, and of the offset."""
        columns = self.columns(shape)
        return np.column_stack([*columns, np.ones(len(columns[0]))])

    def project(self, shape: Sequence[float], y: Array) -> tuple[Array, Array]:
        """Best prediction in um for these shapes, and its gains (offset last)."""
        a = self.matrix(shape)
        size = np.linalg.norm(a, axis=0) + 1e-300
        gains = np.linalg.lstsq(a / size, y, rcond=1e-12)[0] / size
        return a @ gains, gains

    def tangent(self, shape: Sequence[float], gains: Array) -> Array:
        """Jacobian of the prediction in shapes (first) and gains, shapes by central differences."""
        shape = np.asarray(shape, float)
        rows = []
        for k, span in enumerate(self.high - self.low):
            d = np.zeros(len(shape))
            d[k] = 1e-4 * span
            up = np.minimum(shape + d, self.high)
            down = np.maximum(shape - d, self.low)
            rows.append((self.matrix(up) - self.matrix(down)) @ gains / (up - down)[k])
        return np.column_stack([*rows, self.matrix(shape)])

    def fit(self, y: Array, thorough: bool = False) -> tuple[Array, Array, Array]:
        """Shapes, gains and residual of the best refit; `thorough` tries other basins too."""
        nominal = np.array(self.base.nominal)
        starts = [self.shape]
        if thorough:
            starts.append(nominal)
            if "beta" in self.base.shapes:
                starts += [np.array([nominal[0], b, *nominal[2:]]) for b in (-0.6, 0.6)]
            else:
                starts += [0.5 * nominal, 2.0 * nominal]
        span, best = self.high - self.low, None
        for start in starts:
            x0 = np.clip(start, self.low + 1e-4 * span, self.high - 1e-4 * span)
            found = least_squares(
                lambda x: self.project(x, y)[0] - y, x0, bounds=(self.low, self.high),
                x_scale=np.maximum(np.abs(x0), 0.05), xtol=1e-7, ftol=1e-7, max_nfev=25,
            )  # fmt: skip
            if best is None or found.cost < 0.999 * best.cost:
                best = found
        prediction, gains = self.project(best.x, y)
        return best.x, gains, y - prediction


class Chord:
    """Refits near one point with its Jacobian held: what stays of small changes there."""

    def __init__(self, absorber: Absorber, shape: Array, gains: Array) -> None:
        self.absorber, self.shape = absorber, np.asarray(shape, float)
        jacobian = absorber.tangent(shape, gains)
        self.size = np.linalg.norm(jacobian, axis=0) + 1e-300
        self.jacobian = jacobian / self.size
        self.inverse = np.linalg.pinv(self.jacobian, rcond=1e-10)
        self.prediction = jacobian[:, len(self.shape) :] @ gains

    def left(self, y: Array, steps: int = 2) -> Array:
        """Residual of y after `steps` chord steps of the refit, then off the tangent space."""
        shape, r = self.shape, y - self.prediction
        for _ in range(steps):
            move = (self.inverse @ r / self.size)[: len(shape)]
            shape = np.clip(shape + move, self.absorber.low, self.absorber.high)
            r = y - self.absorber.project(shape, y)[0]
        return r - self.jacobian @ (self.inverse @ r)
