"""Two mechanical modes in parallel."""

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

    If sensor and actuator are collocated, p lies between 0 and 1, and a notch lies between the two
    peaks; otherwise p or 1 - p is negative, and for p < 0 the notch lies beyond both peaks or
    vanishes.  The second mode has the higher frequency by definition: two free frequencies could be
    exchanged together with p and 1 - p.
    p = 0 is one mode, as in Resonance.  If the base has a mode itself, a further one is the limit
    of a large ratio, (1 - p) G_1 + p: a pole pair and a pair of zeros, which lie above the poles
    for p < 1 and below for p > 1.

    Attributes:
        frequency: f = ω_1/2π, one number [Hz].
        ratio: ω_2/ω_1 > 1, one number, dimensionless.
        damping: ζ_1, one number, dimensionless.
        second_damping: ζ_2, one number, dimensionless.
        participation: p, one number, dimensionless.

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
            frequency, "Hz", lower=1e-6, upper=1e8, plausible=(10.0, 1e5), logarithmic=True
        )
        self.ratio = Parameter(
            ratio, lower=1.01, upper=100.0, plausible=(1.05, 100.0), logarithmic=True
        )
        self.damping, self.second_damping = (
            Parameter(z, lower=1e-3, upper=1.0, plausible=(4e-3, 0.2), logarithmic=True)
            for z in (damping, second_damping)
        )
        self.participation = Parameter(participation, lower=-1.0, upper=2.0, plausible=(-0.8, 1.8))

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


_SHAPES = ((1.5, 0.3), (1.5, -0.3), (3.0, 0.3), (10.0, 0.5), (10.0, 1.5))
"""Ratio and participation of the trials: two modes of similar size, and one in addition to a mode
of the base."""


def _trials(setting: Setting) -> list:
    # Well damped and dense: a refit then finds modes at half to twice these frequencies.
    lowest = max(0.6 * setting.top_frequency, 10.0)
    highest = max(min(24 * setting.top_frequency, 0.5 / setting.step), 2 * lowest)
    return at_values(
        SecondMode(lowest, damping=0.1, second_damping=0.1),
        [
            {"frequency": f, "ratio": ratio, "participation": p}
            for f in np.geomspace(lowest, highest, 6)
            for ratio, p in _SHAPES
        ],
    )


def _with_lower_mode(block: SecondMode) -> list:
    """Blocks with the fitted single mode as the upper of two: if that moves more, it hides the
    lower one."""
    upper, lowest = block.frequency.value, block.frequency.lower
    return at_values(
        block,
        [
            {"frequency": np.maximum(upper / k, lowest), "ratio": k, "participation": 0.7}
            for k in (1.4, 2.0, 4.0)
        ],
    )


EFFECT = Effect(
    name="second_mode",
    site="response",
    sentence="a second mechanical mode moves in addition to the first, with a peak of its own and "
    "a notch where the two cancel",
    equation="(1 - p) G1(s) + p G2(s), Gi = 1 / (1 + 2 zeta_i s/omega_i + s^2/omega_i^2)",
    source="Preumont, Vibration Control of Active Structures (2011), chapter 2",
    trials=_trials,
    separated_by={
        "resonance": "a sweep through both suspected frequencies: two modes show a notch next to "
        "their peaks",
    },
    concealed_by="one equivalent mode, if the drive stays below both",
    axes=("frequency", "reversal", "rate"),
    special_case="resonance",
    beyond=_with_lower_mode,
)
