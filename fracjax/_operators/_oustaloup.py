r"""Oustaloup's recursive filter: s^μ on a band of frequencies as poles and zeros [F 3–6].

    G(s) = K Π_{k=-N..N} (s + ω'_k)/(s + ω_k)
    ω'_k = ω_b (ω_h/ω_b)^((k+N+(1-μ)/2)/(2N+1)),   ω_k = ω_b (ω_h/ω_b)^((k+N+(1+μ)/2)/(2N+1)),
    K = ω_h^μ

for either sign of μ (the paper writes it for 1/s^μ: zeros and poles swap).  As partial fractions
G(s) = K + Σ_k r_k/(s + ω_k) it is a diagonal state space, which runs sample by sample.
Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25; Xu et al.,
Fractal Fract. 8 (2024) 3, equations (3)–(6) and (10).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._recording import InputError

_SERIES_BELOW = 1e-3


class PoleZero(NamedTuple):
    """gain · Π (s + zeros)/(s + poles): zeros and poles (n,) [rad/s], both counted positive."""

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def symbol(self, s: np.ndarray | Array) -> np.ndarray | Array:
        """G(s) at complex s [1/s]."""
        response = self.gain + 0 * s
        for zero, pole in zip(self.zeros, self.poles, strict=True):
            response = response * ((s + zero) / (s + pole))
        return response

    def residues(self) -> np.ndarray:
        """r (n,) of G(s) = gain + Σ r_k/(s + poles_k)  [1/s]."""
        residues = np.empty_like(self.poles)
        for k, pole in enumerate(self.poles):
            others = np.delete(self.poles, k)
            near = np.delete(self.zeros, k) - pole
            residues[k] = self.gain * (self.zeros[k] - pole) * np.prod(near / (others - pole))
        return residues


def oustaloup(
    order: float, low: float, high: float, number: int = 4, *, unit_gain_at_centre: bool = False
) -> PoleZero:
    """Oustaloup's filter of s^order, -1 < order < 1, on the band [low, high] rad/s [F 3–6].

    `number`: N, the filter has 2N+1 pole–zero pairs.  With the true gain K = high^order it follows
    s^order inside the band; with `unit_gain_at_centre` it is 1 at sqrt(low·high), as the paper's
    [F 10], and tends to (high/low)^(∓order/2) for s → 0 and s → ∞.
    Raises InputError for an order or band out of range.
    """
    if not -1 < order < 1:
        raise InputError.at("oustaloup", "an order between -1 and 1", f"{order}", "cascade filters")
    if not 0 < low < high < math.inf:
        raise InputError.at(
            "oustaloup", "a band 0 < low < high in rad/s", f"{low} to {high}", "correct the band"
        )
    if not 0 <= number <= 50:
        raise InputError.at("oustaloup", "N from 0 to 50", f"{number}", "choose 4 or so")
    places = np.arange(2 * number + 1)
    ratio = high / low
    zeros = low * ratio ** ((places + (1 - order) / 2) / (2 * number + 1))
    poles = low * ratio ** ((places + (1 + order) / 2) / (2 * number + 1))
    filtered = PoleZero(zeros, poles, high**order)
    if unit_gain_at_centre:
        centre = abs(filtered.symbol(np.asarray(1j * math.sqrt(low * high))))
        filtered = filtered._replace(gain=filtered.gain / float(centre))
    return filtered


class StreamingFilter(NamedTuple):
    """A pole–zero filter as difference equations, one sample in, one sample out.

    Each state follows a drive that is straight between samples exactly, with E = exp(-poles step):
    x_n = E x_{n-1} + before · u_{n-1} + now · u_n, and the response is y_n = direct · u_n + Σ x_n.
    All arrays (n,); the states are in the response's unit.
    """

    decay: np.ndarray
    before: np.ndarray
    now: np.ndarray
    direct: float

    def start(self, drive: float, *, settled: bool = True) -> np.ndarray | Array:
        """States (n,) before the first sample: settled at a drive held for ever, or at rest."""
        gains = (self.before + self.now) / (1 - self.decay)
        return gains * drive if settled else gains * 0.0

    def step(
        self, states: np.ndarray | Array, previous: float | Array, drive: float | Array
    ) -> tuple[np.ndarray | Array, float | Array]:
        """The states (n,) and the response after one more sample."""
        states = self.decay * states + self.before * previous + self.now * drive
        return states, self.direct * drive + states.sum()

    def run(self, drive: Array, *, settled: bool = True) -> Array:
        """The response (N,) to a drive (N,), by `lax.scan` over its samples."""

        def one(carry: tuple[Array, Array], sample: Array) -> tuple[tuple[Array, Array], Array]:
            states, response = self.step(carry[0], carry[1], sample)
            return (jnp.asarray(states), sample), jnp.asarray(response)

        drive = jnp.asarray(drive)
        states = jnp.asarray(self.start(1.0)) * drive[0] if settled else jnp.zeros(len(self.decay))
        before = drive[0] if settled else jnp.zeros(())
        return jax.lax.scan(one, (states, before), drive)[1]


def streaming(filtered: PoleZero, step: float) -> StreamingFilter:
    """The filter's difference equations at a step [s], exact for a drive straight between samples.

    Raises InputError where the step is not positive.
    """
    if not 0 < step < math.inf:
        raise InputError.at("streaming", "a positive step in seconds", f"{step}", "correct it")
    x = filtered.poles * step
    decay = np.exp(-x)
    # ∫ exp(-p (h - τ)) τ/h dτ and its mirror image, over h; as series where the difference cancels.
    small = np.minimum(x, _SERIES_BELOW)
    now = np.where(
        x < _SERIES_BELOW,
        1 / 2 - small / 6 + small**2 / 24 - small**3 / 120,
        (x - 1 + decay) / x**2,
    )
    before = np.where(
        x < _SERIES_BELOW,
        1 / 2 - small / 3 + small**2 / 8 - small**3 / 30,
        (1 - decay - x * decay) / x**2,
    )
    scale = filtered.residues() * step
    return StreamingFilter(decay, scale * before, scale * now, filtered.gain)
