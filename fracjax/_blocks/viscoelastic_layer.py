"""A viscoelastic layer between actuator and load: fractional Zener, or a few Maxwell arms."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values
from ._ladder import RELAXATIONS, AbstractLadder, ladders


class ViscoelasticLayer(AbstractLinearBlock):
    r"""A layer of glue or polymer whose stiffness rises from E to a larger one over many decades:

        G(s) = 1 - Δ z / (1 + z) = (1 + (1 - Δ) z) / (1 + z),    z = (τ s)^ν

    Δ: share of the response that is missing at high frequency.  Positive where the layer acts
    beside the actuator, against which it stiffens: the response lags and goes on after a step.
    Negative where the response passes through it to a load: it leads and then gives way.
    τ [s] the time of its relaxation, ν the breadth: 1 is Zener's single one, small values a phase
    that is nearly constant over decades, -90° ν times the share that relaxes.
    Ranges: ν 0.1–0.4 for stiff glues far from their glass transition, to 0.6 for damping polymers
    (Bagley & Torvik), to 0.8 where one relaxation dominates; τ wherever temperature has put it.
    Source: Bagley & Torvik, J. Rheol. 27 (1983) 201; Näsholm & Holm, Fract. Calc. Appl. Anal. 16
    (2013) 26, for the fractional Zener law.
    """

    strength: Parameter
    time_constant: Parameter
    order: Parameter

    def __init__(self, strength: float, time_constant: float, order: float = 0.25):
        self.strength = Parameter(strength, lower=-1.0, upper=0.9, plausible=(-0.5, 0.5))
        self.time_constant = Parameter(
            time_constant, "s", lower=1e-8, upper=1e6, plausible=(1e-6, 1e4), logarithmic=True
        )
        self.order = Parameter(order, lower=0.05, upper=1.0, plausible=(0.1, 0.8))

    def symbol(self, s: Array) -> Array:
        # Apart, for the power of s alone is the cheap one.
        order = self.order.value
        power = s**order * self.time_constant.value**order
        return 1 - self.strength.value * power / (1 + power)

    def static_gain(self) -> ArrayLike:
        return 1.0


class MaxwellLayer(AbstractLadder):
    r"""A layer that the response passes through to a spring: it stiffens by a few relaxations,

        G(s) = 1 + Σ_i g_i τ_i s/(1 + τ_i s),    τ_i = τ ρ^(i-1),    i = 1 … 4

    g_i ≥ 0: share by which the load moves further before arm i has given way, dimensionless; τ [s]
    the fastest; ρ the ratio of one to the next.  Where the layer lies beside the actuator its
    relaxations are those of a creep, and are named so.
    Source: Ferry, Viscoelastic Properties of Polymers (1980), chapter 1, generalised Maxwell body.
    """

    shares: Parameter
    fastest: Parameter
    ratio: Parameter

    def __init__(self, share: float = 0.01, fastest: float = 0.05, ratio: float = 6.0):
        shares = np.full(RELAXATIONS, share)
        self.shares = Parameter(shares, lower=0.0, upper=0.5, plausible=(0.0, 0.2))
        self.fastest = Parameter(
            fastest, "s", lower=1e-6, upper=1e4, plausible=(1e-5, 1e3), logarithmic=True
        )
        self.ratio = Parameter(ratio, lower=2.0, upper=100.0, plausible=(3.0, 40.0))

    def relaxation(self, k: int, z: Array) -> Array:
        return self.shares.value[k] * z / (1 + z)


def _trials(setting: Setting) -> list:
    fastest = 1 / (2 * np.pi * setting.top_frequency)
    zener = at_values(
        ViscoelasticLayer(0.05, fastest),
        [
            {"strength": sign * 0.05, "time_constant": share * fastest, "order": order}
            for sign in (1, -1)
            for share in (0.1, 3.0, 100.0)
            for order in (0.15, 0.35, 0.7)
        ],
    )
    arms = at_values(MaxwellLayer(), ladders(0.1 * fastest, fastest, 10 * fastest))
    return [*zener, *arms]


EFFECT = Effect(
    name="viscoelastic_layer",
    site="series",
    sentence="a layer of glue or polymer stiffens with frequency over many decades, with nearly "
    "the same phase at all of them",
    equation="1 - Delta z/(1 + z), z = (tau s)^nu, or 1 + sum_i g_i tau_i s/(1 + tau_i s)",
    source="Bagley & Torvik, J. Rheol. 27 (1983) 201; Nasholm & Holm, Fract. Calc. Appl. Anal. 16 "
    "(2013) 26; Ferry, Viscoelastic Properties of Polymers (1980), chapter 1",
    trials=_trials,
    separated_by={
        "creep": "the same drive with another load: the layer's share changes with the load, the "
        "ceramic's creep does not",
        "drive_lag": "a sweep over two decades: a lag turns the phase at its corner, a layer over "
        "the whole band",
    },
    concealed_by="the orders and gains of fractional laws: alpha of FOH, chi and mu of LFDH, mu of "
    "creep",
    axes=("frequency", "phase", "time"),
)
