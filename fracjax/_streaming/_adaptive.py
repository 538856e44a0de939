r"""Gains that follow the stage in the loop: recursive least squares that forget to the fit's gains.

The response of the stage with the most gains is θ · φ + b, with its gains θ, its features φ and an
offset b.  What the measured motion misses of the predicted one, e, is what it misses too, by the
ratio of their ranges: stages behind it hardly change what is slow.  With x the gains in units of
the fit's, and b in those of the response's range:

    x ← x_0 + a (x - x_0),    P ← a² P + (1 - a²) P_0,    a = exp(-h/T)
    K = P φ / (φ·P φ + r),    r ≥ φ·P φ τ/h,    x ← x + K e,    P ← P - K (P φ)ᵀ

What is not excited forgets to the fit's gains within the memory T, so that P never exceeds P_0 and
nothing winds up.  Each gain stays within a share of the fit's, for which every slope keeps its
sign, whatever the others do.  The bound of r keeps the corrections slower than the time τ.
Source: Ljung, System Identification (1999), sections 11.2 and 11.7.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._recording import InputError
from .._show import Shown
from ._chain import WIDER, Chain
from ._sections import State

_SAFE = 0.9
"""The share of the change at which a slope could lose its sign; chosen by judgement."""
_FARTHEST = 3.0
"""A gain stays within so many of its expected changes; chosen by judgement."""


@dataclass(frozen=True, repr=False)
class Adaptation(Shown):
    """How fast and how far the gains follow the stage.

    Attributes:
        memory: The time T after which what was measured is forgotten [s].
        spread: How far a gain is expected to move, as a share of itself.
        error: What the model does not describe of the measured motion, rms [response].
        together: The time over which that error stays alike [s]; the gains correct no faster, so
            that the loop which they close stays slower than the stage.
    """

    memory: float = 20.0
    spread: float = 0.1
    error: float = 0.01
    together: float = 0.1


class Learning:
    """The recursive least squares of one stage's gains in a chain."""

    def __init__(self, chain: Chain, adaptation: Adaptation, step: float):
        for name, value in asdict(adaptation).items():
            if not 0 < value < np.inf:
                raise InputError.at(
                    f"streaming inverse, adaptive {name}",
                    "a number above 0",
                    f"{value}",
                    "correct it",
                )
        sizes = [
            int(np.count_nonzero(each)) if share else 0
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
        self.gains = chain.stages[self.at].gains
        size, last = (np.ptp(chain.ranges[k]) / (1 + 2 * WIDER) for k in (self.at + 1, -1))
        self.scale = float(size / last) * float(
            np.prod([stage.sign for stage in chain.stages[self.at + 1 :]])
        )
        self.units = np.append(self.gains, size)
        moving = np.append(np.where(self.gains, 1.0, 0.0), 1.0)
        self.nominal = moving - np.eye(moving.size)[-1]
        self.prior = np.diag((adaptation.spread * moving) ** 2)
        share = min(_FARTHEST * adaptation.spread, _SAFE * chain.steady[self.at])
        self.farthest = np.append(np.full(self.gains.size, share), _FARTHEST * adaptation.spread)
        self.keep = float(np.exp(-step / adaptation.memory))
        error = adaptation.error * abs(self.scale)
        self.slowness = adaptation.together / step
        self.variance = error**2 * self.slowness

    def start(self) -> State:
        """The state: the fit's gains."""
        return {"gain": jnp.asarray(self.nominal), "p": jnp.asarray(self.prior)}

    def scaled(self, state: State) -> tuple[Array, Array]:
        """The gains (g,) and the offset at a state."""
        values = state["gain"] * self.units
        return values[:-1], values[-1]

    def follow(self, state: State, features: Array, missed: Array) -> State:
        """The state after a sample with these features (g,), at which the measured motion differs
        from the predicted one [response]."""
        x = self.nominal + self.keep * (state["gain"] - self.nominal)
        p = self.keep**2 * state["p"] + (1 - self.keep**2) * self.prior
        phi = jnp.concatenate([features, jnp.ones(1)]) * self.units
        spread = p @ phi
        unknown = jnp.sum(phi * spread)
        gain = spread / (unknown + jnp.maximum(self.variance, self.slowness * unknown))
        x = x + gain * (self.scale * missed)
        x = jnp.minimum(jnp.maximum(x, self.nominal - self.farthest), self.nominal + self.farthest)
        return {"gain": x, "p": p - gain[:, None] * spread[None, :]}
