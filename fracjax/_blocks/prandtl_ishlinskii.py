"""Generalised Prandtl–Ishlinskii hysteresis: plays of a curve of the drive."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from .._recording import InputError
from ._block import AbstractBlock
from .minor_loop_memory import _FINE, play_after_history

_SHARES = np.append(0.0, _FINE)
"""Radii as shares of the drive's span: the curve itself, then those of `MinorLoopMemory`."""


class PrandtlIshlinskii(AbstractBlock):
    r"""Generalised Prandtl–Ishlinskii, rate-independent, its loops may be asymmetric:

        y = Σ_i w_i p_i,    p_i the play of v with radius r_i,    r_0 = 0
        v = γ(u) - γ(0),    γ(u) = u + q (u - u_0)²/U

    U and u_0 are the span and the centre of the recording's drive; its slope γ' is 1 ± q at the
    ends of the span, and beyond them γ goes straight on.  The twelve further radii r_i are 2–48 %
    of U, of v.  After a turn the response moves with the slope s_0 = w_0 [response per v], and
    s_j = w_0 + … + w_j once v has moved back by 2 r_j.  With q = 0 the loops are those of a
    classical operator, symmetric about their centre; otherwise one end is wider than the other.

    The curve acts on the drive, for two reasons.  A response Σ w_i p_i is linear in its weights, so
    that a fit iterates q alone.  And the operator is the classical one after γ: where all slopes
    s_j have one sign, its inverse is γ^-1 after a classical operator with known weights and radii.
    Neither holds together for a curve after the plays (not linear) or beside them (no such
    inverse).  The weights themselves may have either sign.  `cubic_nonlinearity` in series before
    it makes the curve one of third order, for recordings of several amplitudes: a single one may
    not tell it from the weights.

    The derivatives, which JAX computes, jump where a play begins to move.

    Args:
        weights: initial w_i (13,).
        q: initial q.
        low: the lowest drive [drive].
        high: the highest drive [drive].

    Attributes:
        weights: w_i (13,) [response/drive].
        q: q, one number, dimensionless.
        radii: r_i (13,) [drive], fixed.
        ends: the ends of the drive's span, u_0 ± U/2 (2,) [drive], fixed.

    Raises:
        InputError: if there are not 13 weights.

    Source: Al Janaideh, Rakheja & Su, IEEE/ASME Trans. Mechatronics 16 (2011) 734, plays of a curve
    of the drive, and the inverse; Kuhnen, Eur. J. Control 9 (2003) 407; Krejci & Kuhnen, IEE Proc.
    Control Theory Appl. 148 (2001) 185, the inverse of the classical operator.
    """

    weights: Parameter
    q: Parameter
    radii: Parameter
    ends: Parameter

    def __init__(self, weights: np.ndarray, q: float = 0.0, *, low: float, high: float):
        if np.shape(weights) != _SHARES.shape:
            raise InputError.at(
                "Prandtl-Ishlinskii",
                f"{_SHARES.size} weights, one for each radius from 0",
                f"an array of shape {np.shape(weights)}",
                "give as many, with 0 for unused radii",
            )
        self.weights = Parameter(weights, "response/drive", gain=True)
        self.q = Parameter(q, lower=-0.9, upper=0.9, plausible=(-0.3, 0.3))
        self.radii = Parameter(_SHARES * (high - low), "drive", fixed=True)
        self.ends = Parameter(np.array([low, high]), "drive", fixed=True)

    @property
    def linear(self) -> bool:
        return False

    @property
    def slopes(self) -> Array:
        """s_j = w_0 + … + w_j (13,) [response/drive]: the operator has an inverse where all have
        one sign."""
        return jnp.cumsum(jnp.asarray(self.weights.value))

    @property
    def curve(self) -> Curve:
        """v = γ(u) - γ(0), at these parameters."""
        low, high = self.ends.value
        return Curve(self.q.value, low, high)

    def __call__(self, drive: Array, grid: Grid) -> Array:
        plays = play_after_history(self.curve(drive, grid), jnp.asarray(self.radii.value), grid)
        return plays @ self.weights.value


class Curve(AbstractBlock):
    """The curve γ(u) - γ(0) of `PrandtlIshlinskii`, which rises everywhere.

    Attributes:
        q: dimensionless.
        low: the lowest drive [drive].
        high: the highest drive [drive].
    """

    q: Array
    low: Array
    high: Array

    @property
    def linear(self) -> bool:
        return False

    def _at(self, drive: Array) -> Array:
        """γ (N,) [drive], up to the constant u_0."""
        centre, span = (self.low + self.high) / 2, self.high - self.low
        inside = jnp.clip(drive, self.low, self.high) - centre
        slope = 1 + 2 * self.q * inside / span
        return inside + self.q * inside**2 / span + slope * (drive - centre - inside)

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self._at(drive) - self._at(jnp.zeros(()))

    def inverse(self) -> InverseCurve:
        """The block from v back to u."""
        return InverseCurve(self)


class InverseCurve(AbstractBlock):
    """The drive u [drive] at which a curve has its value v [drive]: a root of a square.

    Attributes:
        curve: the curve.
    """

    curve: Curve

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        q, low, high = self.curve.q, self.curve.low, self.curve.high
        centre, span = (low + high) / 2, high - low
        value = drive + self.curve._at(jnp.zeros(()))
        inside = jnp.clip(value, self.curve._at(low), self.curve._at(high))
        # The square's discriminant is the curve's slope, squared.
        slope = jnp.sqrt(1 + 4 * q * inside / span)
        return centre + 2 * inside / (1 + slope) + (value - inside) / slope
