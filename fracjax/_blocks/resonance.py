"""One mechanical mode."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class Resonance(AbstractLinearBlock):
    r"""Moving mass on the stack's stiffness, with damping [F 17]:

        G(s) = 1 / (1 + 2 ζ s/ω_0 + s²/ω_0²),   ω_0 = 2π f_0

    Attributes:
        frequency: f_0, one number [Hz].
        damping: damping ratio ζ, one number, dimensionless.

    Source: Xu et al., Fractal Fract. 8 (2024) 3, equation (17), with the static gain in the block
    before.
    """

    frequency: Parameter
    damping: Parameter

    def __init__(self, frequency: float, damping: float = 0.02):
        self.frequency = Parameter(
            frequency, "Hz", lower=1e-6, upper=1e8, plausible=(10.0, 1e5), logarithmic=True
        )
        self.damping = Parameter(
            damping, lower=1e-3, upper=1.0, plausible=(4e-3, 0.2), logarithmic=True
        )

    @property
    def accuracy(self) -> int:
        return 3

    def symbol(self, s: Array) -> Array:
        x = s / (2 * np.pi * self.frequency.value)
        return 1 / (1 + 2 * self.damping.value * x + x * x)

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    nyquist = 0.5 / setting.step
    frequencies = np.geomspace(min(10.0, nyquist / 8), 2 * nyquist, 12)
    return at_values(Resonance(nyquist, damping=0.05), [{"frequency": f} for f in frequencies])


EFFECT = Effect(
    name="resonance",
    site="response",
    sentence="a mechanical mode rings after fast changes and raises the gain as the square of "
    "frequency",
    equation="1 / (1 + 2 zeta s/omega0 + s^2/omega0^2)",
    source="Xu et al., Fractal Fract. 8 (2024) 3, eq. (17)",
    trials=_trials,
    separated_by={
        "delay": "a sweep up to a third of the suspected natural frequency, or fast steps",
        "drive_lag": "a sweep: a lag loses gain where a resonance gains it",
    },
    concealed_by="the hysteresis, if the drive contains only low harmonics",
    axes=("frequency", "rate", "reversal"),
    one_sided=True,
)
