"""A gain that drifts as the actuator warms, by the clock of the loop.

T follows the power of each step, as in the block; the stage is cold where it rested.
Source: Zheng, Takahashi, Yoshikawa, Uchino & de Vries, J. Am. Ceram. Soc. 79 (1996) 3193.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import GainDrift
from ..._blocks.gain_drift import _LEAST
from ._section import Response, Sampling, Section, State, section_of


class GainDriftSection(Section):
    """y + g (y - y_0 + z) T."""

    labels = ("response", "gain_drift")

    def __init__(self, block: GainDrift, step: float):
        self.gains = np.array([1.0, float(block.gain.value)])
        self.zero, self.losses = float(block.zero.value), float(block.losses.value)
        self.speed, self.size = float(block.speed) * step, float(block.size)
        self.decay = float(np.exp(-step / float(block.time_constant.value)))

    def start(self, drive: Array) -> State:
        return {"origin": drive, "last": drive, "warming": jnp.zeros(())}

    def begin(self, state: State) -> Response:
        origin, last, warming = state["origin"], state["last"], state["warming"]

        def respond(drive: Array) -> tuple[Array, State]:
            speed = jnp.maximum(jnp.abs(drive - last) / self.speed, _LEAST)
            size = jnp.maximum(jnp.abs(0.5 * (drive + last) - origin) / self.size, _LEAST)
            power = speed**self.losses * size ** (2 - self.losses)
            warm = self.decay * warming + (1 - self.decay) * power
            features = jnp.stack([drive, (drive - origin + self.zero) * warm])
            return features, {"origin": origin, "last": drive, "warming": warm}

        return respond


@section_of.register
def _(block: GainDrift, sampling: Sampling) -> Section:
    return GainDriftSection(block, sampling.step)
