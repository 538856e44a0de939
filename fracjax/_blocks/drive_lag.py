"""First-order lag of the drive: amplifier resistance and stack capacitance."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class DriveLag(AbstractLinearBlock):
    r"""The voltage on the stack follows the command through a resistance [L 5]:

        RC du_pzt/dt + u_pzt = u,     G(s) = 1 / (1 + τ s)

    Attributes:
        time_constant: τ = RC, one number [s].

    Source: Zhu & Zhou (2012), equation (5), with the gain in the block that follows.
    """

    time_constant: Parameter

    def __init__(self, time_constant: float = 1e-3):
        self.time_constant = Parameter(
            time_constant, "s", lower=1e-7, upper=1e4, plausible=(1e-6, 100.0), logarithmic=True
        )

    def symbol(self, s: Array) -> Array:
        return 1 / (1 + self.time_constant.value * s)

    def static_gain(self) -> ArrayLike:
        return 1.0


def _trials(setting: Setting) -> list:
    slowest = 1 / (2 * np.pi * setting.top_frequency)
    constants = np.clip(slowest * np.geomspace(0.02, 2, 9), 1e-5, 0.05)
    return at_values(DriveLag(), [{"time_constant": c} for c in np.unique(constants)])


EFFECT = Effect(
    name="drive_lag",
    site="drive",
    sentence="the voltage on the stack lags behind the command, since a resistance charges its "
    "capacitance",
    equation="1 / (1 + tau s)",
    source="Zhu & Zhou (2012), eq. (5)",
    trials=_trials,
    separated_by={
        "delay": "a drive reaching omega*tau > 0.3, where a lag loses gain",
        "resonance": "a sweep: a lag loses gain where a resonance gains it",
        "minor_loop_memory": "the same amplitude at two frequencies: a lag's loop widens",
    },
    concealed_by="the width of the hysteresis loop",
    axes=("frequency", "rate", "phase", "harmonics"),
    one_sided=True,
)
