r"""Gains that follow the stage in the loop: recursive least squares that forget to the fit's gains.

The response of the stage with the most gains is θ · φ + b, with its gains θ, its features φ and an
offset b.  The measured motion, taken back through the stages behind it, gives their value at every
sample.  With x the gains in units of the fit's, and b in those of the response's range:

    x ← x_0 + a (x - x_0),    P ← a² P + (1 - a²) P_0,    a = exp(-h/T)
    K = P φ / (φ·P φ + r),    x ← x + K (y - φ·x),    P ← P - K (P φ)ᵀ

What is not excited forgets to the fit's gains within the memory T, so that P never exceeds P_0 and
nothing winds up.  Each gain stays within a share of the fit's, for which every slope keeps its
sign, whatever the others do.
Source: Ljung, System Identification (1999), sections 11.2 and 11.7.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._recording import InputError
from ._chain import Chain
from ._sections import State

_SAFE = 0.9
"""The share of the change at which a slope could lose its sign; chosen by judgement."""


class Adaptation(NamedTuple):
    """How fast and how far the gains follow the stage.

    Attributes:
        memory: The time T after which what was measured is forgotten [s].
        spread: How far a gain is expected to move, as a share of itself.
        error: What the model does not describe of the measured motion, rms [response].
        together: The time over which that error stays alike [s].
    """

    memory: float = 20.0
    spread: float = 0.1
    error: float = 0.01
    together: float = 0.01


class Learning:
    """The recursive least squares of one stage's gains in a chain."""

    def __init__(self, chain: Chain, adaptation: Adaptation, step: float):
        for name, value in adaptation._asdict().items():
            if not 0 < value < np.inf:
                raise InputError.at(
                    f"streaming inverse, adaptive {name}",
                    "a number above 0",
                    f"{value}",
                    "correct it",
                )
        sizes = [
            np.count_nonzero(each) if share else 0
            for each, share in zip((s.gains for s in chain.stages), chain.steady, strict=True)
        ]
        self.at = int(np.argmax(sizes))
        if not sizes[self.at]:
            raise InputError.at(
                "streaming inverse, adaptive",
                "a model with hysteresis, whose gains can follow the stage",
                "a model of linear laws",
                "leave it out",
            )
        self.behind = chain.stages[self.at + 1 :]
        self.ranges = chain.ranges[self.at + 1 :]
        self.gains = chain.stages[self.at].gains
        size = float(np.ptp(chain.ranges[self.at + 1]))
        self.units = np.append(self.gains, size)
        self.nominal = np.append(np.where(self.gains, 1.0, 0.0), 0.0)
        moving = np.append(np.where(self.gains, 1.0, 0.0), 1.0)
        self.prior = np.diag((adaptation.spread * moving) ** 2)
        share = min(1.0, _SAFE * chain.steady[self.at])
        self.farthest = np.append(np.full(self.gains.size, share), adaptation.spread)
        self.keep = float(np.exp(-step / adaptation.memory))
        self.variance = adaptation.error**2 * max(1.0, adaptation.together / step)

    def start(self, states: tuple) -> State:
        """The state: the fit's gains, and the stages behind as they are."""
        return {
            "gain": jnp.asarray(self.nominal),
            "p": jnp.asarray(self.prior),
            "behind": tuple(states[self.at + 1 :]),
        }

    def scaled(self, state: State) -> tuple[Array, Array]:
        """The gains (g,) and the offset at a state."""
        values = state["gain"] * self.units
        return values[:-1], values[-1]

    def follow(self, state: State, features: Array, measured: Array, eps: Array) -> State:
        """The state after a measured motion [response], the features (g,) being this sample's."""
        value, behind = measured, []
        for k in reversed(range(len(self.behind))):
            stage, gains = self.behind[k], self.behind[k].gains
            bracket = tuple(self.ranges[k])
            value = stage.drive_for(state["behind"][k], gains, value, bracket, eps)
            behind.append(stage.advance(state["behind"][k], gains, value)[2])
        x = self.nominal + self.keep * (state["gain"] - self.nominal)
        p = self.keep**2 * state["p"] + (1 - self.keep**2) * self.prior
        phi = jnp.concatenate([features, jnp.ones(1)]) * self.units
        spread = p @ phi
        gain = spread / (jnp.sum(phi * spread) + self.variance)
        x = x + gain * (value - jnp.sum(phi * x))
        x = jnp.minimum(jnp.maximum(x, self.nominal - self.farthest), self.nominal + self.farthest)
        p = p - gain[:, None] * spread[None, :]
        return {"gain": x, "p": p, "behind": tuple(behind[::-1])}
