"""Measurement noise of four colours, and the filters that whiten it.

white: independent;  ar: e_k = order · e_(k-1) + white;  pink: (1 - B)^(order/2) e = white, a
spectrum 1/f^order (B is the delay of one sample);  quantised: white, then rounded to a step.
Source of pink: N. J. Kasdin, Proceedings of the IEEE 83 (1995) 802.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve, lfilter

from ..drives import Array

Rng = np.random.Generator
SHARES = {"white": 0.45, "ar": 0.2, "pink": 0.15, "quantised": 0.2}


@dataclass(frozen=True)
class Noise:
    """Noise of standard deviation `sd` in um; `order` is the colour's, or the step over the sd."""

    colour: str
    sd: float
    order: float

    def sample(self, n: int, rng: Rng) -> Array:
        """n samples in um; for `quantised` without the rounding."""
        if self.colour == "ar":
            e = rng.standard_normal(n + 200)
            return self.sd * np.sqrt(1 - self.order**2) * lfilter([1], [1, -self.order], e)[200:]
        e = rng.standard_normal(n)
        if self.colour == "pink":
            pulse = self._pulse(n, -self.order / 2)
            return self._innovation(n) * fftconvolve(e, pulse)[:n]
        return self.sd * e

    def recorded(self, y: Array) -> Array:
        """A response in um as the recorder codes it."""
        if self.colour != "quantised":
            return y
        step = self.order * self.sd
        return step * np.round(y / step)

    @property
    def total(self) -> float:
        """Standard deviation in um of all that hides a signal: noise and rounding."""
        if self.colour != "quantised":
            return self.sd
        return self.sd * float(np.sqrt(1 + self.order**2 / 12))

    def whiten(self, x: Array) -> Array:
        """x, along its first axis, in units in which the noise is white with variance 1."""
        if self.colour == "ar":
            white = lfilter([1, -self.order], [1], x, axis=0)
            return white / (self.sd * np.sqrt(1 - self.order**2))
        if self.colour == "pink":
            pulse = self._pulse(len(x), self.order / 2).reshape(-1, *[1] * (x.ndim - 1))
            return fftconvolve(x, pulse, axes=0)[: len(x)] / self._innovation(len(x))
        return x / self.total

    @staticmethod
    def _pulse(n: int, power: float) -> Array:
        """Coefficients of (1 - B)^power."""
        k = np.arange(1, n)
        return np.concatenate([[1.0], np.cumprod((k - 1 - power) / k)])

    def _innovation(self, n: int) -> float:
        """Standard deviation in um of pink noise's white source, for `sd` over n samples."""
        growing = np.cumsum(self._pulse(n, -self.order / 2) ** 2)
        return self.sd / float(np.sqrt(growing.mean()))


def draw_noise(rng: Rng, stroke: float) -> Noise:
    """A colour by SHARES and .02 to .3 % of the stroke, evenly in the logarithm."""
    colour = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    sd = stroke * float(np.exp(rng.uniform(np.log(2e-4), np.log(3e-3))))
    ranges = {"white": (0.0, 0.0), "ar": (0.3, 0.9), "pink": (0.6, 1.0), "quantised": (0.5, 4.0)}
    return Noise(colour, sd, float(rng.uniform(*ranges[colour])))
