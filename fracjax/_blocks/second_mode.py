"""Two mechanical modes side by side."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class SecondMode(AbstractLinearBlock):
    r"""The paper's mode [F 17] and one more, each with its share of the static displacement:

        G(s) = (1 - p) G_1(s) + p G_2(s),   G_i(s) = 1 / (1 + 2 ζ_i s/ω_i + s²/ω_i²)

    ω_1 = 2π f, ω_2 = ω_1 · ratio > ω_1, f in [Hz], ζ_1 = damping, ζ_2 = second_damping, p =
    participation, dimensionless.  Where sensor and actuator share a place p lies between 0 and 1,
    and a notch between the two peaks; elsewhere p has either sign, and with p < 0 the notch lies
    beyond both or vanishes.  The second mode is the faster by definition: two free frequencies
    could be exchanged with p and 1 - p.
    p = 0 leaves one mode, which is Resonance; without any, f is beyond all that is driven.  A base
    that has a mode of its own gains the other as f ratio → ∞: (1 - p) G_1 + p.
    Source: Preumont, Vibration Control of Active Structures (2011), chapter 2, for the sum over
    modes; Xu et al., Fractal Fract. 8 (2024) 3, equation (17), for each.
    """

    frequency: Parameter
    ratio: Parameter
    damping: Parameter
    second_damping: Parameter
    participation: Parameter

    def __init__(
        self,
        frequency: float,
        ratio: float = 2.0,
        participation: float = 0.2,
        damping: float = 0.02,
        second_damping: float = 0.02,
    ):
        self.frequency = Parameter(
            frequency, "Hz", lower=0.1, upper=1e8, plausible=(10.0, 1e4), logarithmic=True
        )
        self.ratio = Parameter(
            ratio, lower=1.01, upper=100.0, plausible=(1.05, 20.0), logarithmic=True
        )
        self.damping, self.second_damping = (
            Parameter(z, lower=1e-3, upper=1.0, plausible=(4e-3, 0.2), logarithmic=True)
            for z in (damping, second_damping)
        )
        self.participation = Parameter(participation, lower=-1.0, upper=1.0, plausible=(-0.8, 0.95))

    @property
    def accuracy(self) -> int:
        return 3

    def symbol(self, s: Array) -> Array:
        x = s / (2 * np.pi * self.frequency.value)
        first = 1 / (1 + 2 * self.damping.value * x + x * x)
        x = x / self.ratio.value
        second = 1 / (1 + 2 * self.second_damping.value * x + x * x)
        return first + self.participation.value * (second - first)

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    nyquist = 0.5 / setting.step
    lowest = max(min(2 * setting.top_frequency, nyquist / 8), 0.1)
    frequencies = np.geomspace(lowest, max(nyquist, 2 * lowest), 4)
    return at_values(
        SecondMode(lowest),
        [
            {"frequency": f, "ratio": ratio, "participation": p}
            for f in frequencies
            for ratio in (1.4, 3.0)
            for p in (0.3, -0.3)
        ],
    )


EFFECT = Effect(
    name="second_mode",
    site="response",
    sentence="a second mechanical mode moves beside the first, with a peak of its own and a notch "
    "where the two cancel",
    equation="(1 - p) G1(s) + p G2(s), Gi = 1 / (1 + 2 zeta_i s/omega_i + s^2/omega_i^2)",
    source="Preumont, Vibration Control of Active Structures (2011), chapter 2",
    trials=_trials,
    separated_by={
        "resonance": "a sweep through both suspected frequencies: two modes leave a notch beside "
        "their peaks",
    },
    concealed_by="one equivalent mode, while the drive stays below both",
    axes=("frequency", "reversal", "rate"),
)
