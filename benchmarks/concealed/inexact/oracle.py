"""An oracle that knows the law: what a change of its gain, shapes and offset could take up.

    left = y - y(p),  p by Gauss and Newton's steps on the whitened residual, tangent held

What is left after it is what the recording shows of an effect to one who knows everything else.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property

import numpy as np

from ..drives import Array
from .noises import Noise
from .stage import Stage

STEP = 1e-3  # of a parameter, for central differences
SMALLEST = 0.05  # what a parameter's size is at least taken for
FARTHEST = 0.3  # of a parameter's size, the longest step of a refit
RANK = 1e-6


def span(columns: Array) -> Array:
    """An orthonormal basis of the columns' span, directions below RANK of the first left out."""
    u, size, _ = np.linalg.svd(columns / _size(columns), full_matrices=False)
    return u[:, size > RANK * size[0]]


def _size(columns: Array) -> Array:
    return np.sqrt(np.sum(columns**2, axis=0)) + 1e-300


class Oracle:
    """Refits of a stage's own law, about its own numbers.

    Args:
        stage: The stage without effects.
        noise: The noise that the refit weighs residuals by.
        held: Parameters of the law that are not refitted.
    """

    def __init__(self, stage: Stage, noise: Noise, held: Collection[str] = ()) -> None:
        self.stage, self.noise = stage, noise
        self.names = [k for k, v in stage.params.items() if isinstance(v, float) and k not in held]

    @cached_property
    def derivatives(self) -> Array:
        """Derivatives in um by the law's parameters, its gain and an offset."""
        columns = []
        for name in self.names:
            step = STEP * self._scale(name)
            up, down = (self._moved({name: sign * step}) for sign in (1, -1))
            columns.append((up - down) / (2 * step))
        recorded = self.stage.recorded([])
        return np.array([*columns, recorded, np.ones(len(recorded))]).T

    @cached_property
    def tangent(self) -> Array:
        """The derivatives, each of unit length."""
        return self.derivatives / _size(self.derivatives)

    @cached_property
    def basis(self) -> Array:
        """Orthonormal basis of the whitened tangent."""
        return span(self.noise.whiten(self.tangent))

    @cached_property
    def _inverse(self) -> Array:
        return np.linalg.pinv(self.noise.whiten(self.tangent), rcond=RANK).astype(np.float64)

    def left(self, y: Array, steps: int = 3) -> Array:
        """Residual in um of the refit to a recording without noise."""
        moves = np.zeros(len(self.names))
        best, least = y, np.inf
        for k in range(steps + 1):
            residual = y - self._moved(dict(zip(self.names, moves, strict=True)))
            move = self._inverse @ self.noise.whiten(residual)
            off = residual - self.tangent @ move
            power = float(np.sum(self.noise.whiten(off) ** 2))
            if power < least:
                best, least = off, power
            if k == steps or power > 2 * least:
                break
            shapes = (move / _size(self.derivatives))[: len(self.names)]
            limits = FARTHEST * np.array([self._scale(name) for name in self.names])
            moves = moves + np.clip(shapes, -limits, limits)
        return best

    def _moved(self, moves: dict[str, float]) -> Array:
        params = self.stage.params
        changed = {k: params[k] + v for k, v in moves.items()}
        return self.stage.with_params({**params, **changed}).recorded([])

    def _scale(self, name: str) -> float:
        return max(abs(float(self.stage.params[name])), SMALLEST)
