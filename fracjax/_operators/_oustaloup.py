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
"""pole · step below which a series replaces the closed form, which cancels there: the first term
left out is 3e-15 of the result."""


class PoleZero(NamedTuple):
    """The filter gain · Π (s + zeros)/(s + poles).

    Attributes:
        zeros: (n,) [rad/s], counted positive.
        poles: (n,) [rad/s], counted positive.
        gain: G(s) for s → ∞, in response unit per drive unit.
    """

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def symbol(self, s: np.ndarray | Array) -> np.ndarray | Array:
        """G(s), the transfer function.

        Args:
            s: complex, of any shape [1/s].

        Returns:
            G(s), complex, of s's shape, in the unit of the gain.
        """
        response = self.gain + 0 * s
        for zero, pole in zip(self.zeros, self.poles, strict=True):
            response = response * ((s + zero) / (s + pole))
        return response

    def residues(self) -> np.ndarray:
        """The residues of G(s) = gain + Σ_k r_k/(s + poles_k).

        Returns:
            r (n,) [unit of the gain · rad/s].
        """
        residues = np.empty_like(self.poles)
        for k, pole in enumerate(self.poles):
            others = np.delete(self.poles, k)
            near = np.delete(self.zeros, k) - pole
            residues[k] = self.gain * (self.zeros[k] - pole) * np.prod(near / (others - pole))
        return residues


def oustaloup(
    order: float, low: float, high: float, number: int = 4, *, unit_gain_at_centre: bool = False
) -> PoleZero:
    """Oustaloup's filter of s^μ on a band of frequencies [F 3–6].

    Args:
        order: μ, dimensionless, -1 < μ < 1.
        low: ω_b, the lower end of the band [rad/s].
        high: ω_h, the upper end of the band [rad/s].
        number: N, 0 to 50; the filter has 2N+1 pole–zero pairs.
        unit_gain_at_centre: if true, |G| is 1 at sqrt(low·high), as in [F 10], and tends to
            (high/low)^(∓μ/2) for s → 0 and s → ∞; if false, the gain is K = high^μ, and the filter
            follows s^μ inside the band.

    Returns:
        The filter, with n = 2N+1.

    Raises:
        InputError: if the order, the band or N is out of range.
    """
    if not -1 < order < 1:
        raise InputError.at("oustaloup", "an order between -1 and 1", f"{order}", "cascade filters")
    if not 0 < low < high < math.inf:
        raise InputError.at(
            "oustaloup", "a band 0 < low < high in rad/s", f"{low} to {high}", "correct the band"
        )
    if not 0 <= number <= 50:
        raise InputError.at("oustaloup", "N from 0 to 50", f"{number}", "choose N near 4")
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

        x_n = E x_{n-1} + before · u_{n-1} + now · u_n,    y_n = direct · u_n + Σ x_n

    The states x (n,), in response units, are exact for a drive u that is straight between samples.

    Attributes:
        decay: E = exp(-poles · step) (n,), dimensionless.
        before: factor (n,) of the sample before, in response unit per drive unit.
        now: factor (n,) of the present sample, in response unit per drive unit.
        direct: feed-through, one number, in response unit per drive unit.
    """

    decay: np.ndarray
    before: np.ndarray
    now: np.ndarray
    direct: float

    def start(self, drive: float, *, settled: bool = True) -> np.ndarray | Array:
        """The states before the first sample.

        Args:
            drive: the first sample, one number, in drive units.
            settled: if true, the drive had this value at all times before; if false, it was zero.

        Returns:
            The states (n,), in response units.
        """
        gains = (self.before + self.now) / (1 - self.decay)
        return gains * drive if settled else gains * 0.0

    def step(
        self, states: np.ndarray | Array, previous: float | Array, drive: float | Array
    ) -> tuple[np.ndarray | Array, float | Array]:
        """The states and the response after one more sample.

        Args:
            states: (n,), in response units.
            previous: the drive at the sample before, one number, in drive units.
            drive: the drive at this sample, one number, in drive units.

        Returns:
            The states (n,) and the response, one number, both in response units.
        """
        states = self.decay * states + self.before * previous + self.now * drive
        return states, self.direct * drive + states.sum()

    def run(self, drive: Array, *, settled: bool = True) -> Array:
        """The response to a whole drive, by `lax.scan` over its samples.

        Args:
            drive: (N,), in drive units.
            settled: if true, the drive had its first value at all times before; if false, it was
                zero.

        Returns:
            The response (N,), in response units.
        """

        def one(carry: tuple[Array, Array], sample: Array) -> tuple[tuple[Array, Array], Array]:
            states, response = self.step(carry[0], carry[1], sample)
            return (jnp.asarray(states), sample), jnp.asarray(response)

        drive = jnp.asarray(drive)
        states = jnp.asarray(self.start(1.0)) * drive[0] if settled else jnp.zeros(len(self.decay))
        before = drive[0] if settled else jnp.zeros(())
        return jax.lax.scan(one, (states, before), drive)[1]


def streaming(filtered: PoleZero, step: float) -> StreamingFilter:
    """The filter's difference equations, exact for a drive that is straight between samples.

    Args:
        filtered: the filter, with n poles [rad/s].
        step: time between samples [s].

    Returns:
        The difference equations, with n states.

    Raises:
        InputError: if the step is not positive.
    """
    if not 0 < step < math.inf:
        raise InputError.at(
            "streaming", "a positive step in seconds", f"{step}", "give the time between samples"
        )
    x = filtered.poles * step
    decay = np.exp(-x)
    # ∫ exp(-p (h - τ)) τ/h dτ and its mirror image, over h; a series where the closed form cancels.
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
