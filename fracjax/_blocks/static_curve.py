"""A static curve between two parts of a machine."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock

_KNOTS = 9
"""Values that make the curve; chosen by judgement."""


class StaticCurve(AbstractBlock):
    r"""A curve without memory, straight between values at equal distances, and straight on beyond:

        y = v_k + (v_{k+1} - v_k) (x - x_k)/(x_{k+1} - x_k),    x_k ≤ x ≤ x_{k+1}

    Between two lags it makes a Wiener–Hammerstein model, after one a Wiener and before one a
    Hammerstein model.  Corners, as of a diode or a saturation, are met to the distance of the
    values.

    Args:
        low: the lowest x_k [drive].
        high: the highest x_k [drive].
        values: initial v_k; x_k where not given.

    Attributes:
        values: v_k (9,) [response].
        low: the lowest x_k, one number [drive].
        high: the highest x_k, one number [drive].

    Source: Schoukens & Ljung, IEEE Control Syst. Mag. 39 (2019) 28, block-oriented models.
    """

    values: Parameter
    low: Parameter
    high: Parameter

    def __init__(self, low: float = -1.0, high: float = 1.0, values: np.ndarray | None = None):
        start = np.linspace(low, high, _KNOTS) if values is None else values
        self.values = Parameter(start, "response", gain=True)
        self.low = Parameter(low, "drive", fixed=True)
        self.high = Parameter(high, "drive", fixed=True)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        values = jnp.asarray(self.values.value)
        pieces = values.size - 1
        place = (drive - self.low.value) / (self.high.value - self.low.value) * pieces
        below = jnp.clip(jnp.floor(place), 0, pieces - 1).astype(int)
        share = place - below
        return values[below] * (1 - share) + values[below + 1] * share
