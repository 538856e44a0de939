"""Which effects could pass for a truth on a recording: λ = |P d_k|² less what effect l explains.

d_k is what the truth changed, d_l what another effect of the simulator changes at several shapes
(secants), P takes out what an oracle that knows the law absorbs, all in units of the noise.  λ is
twice the gain in log-likelihood of the truth over effect l at its best amplitude.
"""

from __future__ import annotations

import numpy as np

from ..drives import Array
from ..separability import SEPARABLE, Other, others, unexplained_by
from ..truth import EFFECTS, play
from .noises import Noise
from .oracle import span
from .stage import Stage

NEAR = 0.5  # share of the truth's power that a first look must leave for an effect to be far
ALIKE = 0.1  # share left by an effect that explains nine tenths


class Rivals:
    """Changes of every catalogued effect to one stage, whitened.

    Args:
        stage: The stage without effects.
        noise: The recording's noise.
        seed: Draws the effects' shapes.
    """

    def __init__(self, stage: Stage, noise: Noise, seed: int) -> None:
        self.stage, self.noise = stage.coarse(), noise
        self.plain = self.stage.recorded([])
        self.others = others(seed)
        self.first = {o.name: self._columns(o, 1.0) for o in self.others}

    def _columns(self, other: Other, times: float, further: bool = False) -> Array:
        """Whitened changes at `times` the typical amplitude, a column per shape."""
        rows = []
        for key, shape in (*other.draws, *(other.further if further else ())):
            e = EFFECTS[key]
            a = min(times * e.typical, e.cap)
            pair = (e, e.parameters(a, shape, self.stage.scene))
            rows.append(self.stage.recorded([pair]) - self.plain)
        return self.noise.whiten(np.column_stack(rows))

    def separation(self, truth: Array, basis: Array, own: str) -> dict[str, float]:
        """λ of a truth from every effect but its own, beyond a basis.

        Args:
            truth: Whitened residual of the truth.
            basis: Orthonormal columns that are taken out of every effect.
            own: Name of the truth.

        Returns:
            λ by effect.  Effects that come near are taken at more shapes, and at the amplitude
            that leaves as much as the truth does.
        """
        truth = off(basis, truth)
        power, out = float(truth @ truth), {}
        for other in self.others:
            if other.name == own:
                continue
            columns = off(basis, self.first[other.name])
            sizes = np.sum(columns**2, axis=0)
            columns, sizes = columns[:, sizes > 0], sizes[sizes > 0]
            if not len(sizes):
                continue
            least = unexplained_by(other.name, truth, columns)
            if least < NEAR * power:
                times = float(np.sqrt(power / np.mean(sizes)))
                again = off(basis, self._columns(other, times, further=True))
                again = again[:, np.any(again != 0, axis=0)]
                least = min(least, unexplained_by(other.name, truth, again))
            out[other.name] = least
        return out


def off(basis: Array, x: Array) -> Array:
    """x without its part in the span of an orthonormal basis."""
    return x - basis @ (basis.T @ x)


def look_alikes(separation: dict[str, float], least: float = SEPARABLE) -> list[str]:
    """Effects whose λ is under a limit."""
    return sorted(k for k, v in separation.items() if v < least)


def beyond_shape(u: Array, tangent: Array, noise: Noise, plays: int = 20) -> Array:
    """Orthonormal basis of the tangent and of loops of any shape, for one who knows no law.

    Args:
        u: Recorded drive in V.
        tangent: The oracle's columns in um.
        noise: The recording's noise.
        plays: Thresholds of plays on the drive and on two curves of it.

    Returns:
        Whitened basis: a static curve by Chebyshev's polynomials to the seventh order, and plays.
    """
    v = (u - u.min()) / np.ptp(u)
    static = np.polynomial.chebyshev.chebvander(2 * v - 1, 7)
    curves = (v, v**2, 1 - (1 - v) ** 2)
    loops = [play(e, r) - e for e in curves for r in np.linspace(0.008, 0.49, plays)]
    return span(noise.whiten(np.column_stack([tangent, static, *loops])))
