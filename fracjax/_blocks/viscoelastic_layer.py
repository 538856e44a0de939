"""A viscoelastic layer between actuator and load: fractional Zener, or a few Maxwell elements."""

from __future__ import annotations

import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values
from ._ladder import RELAXATIONS, AbstractLadder, ladders


class ViscoelasticLayer(AbstractLinearBlock):
    r"""A layer of glue or polymer whose stiffness increases with frequency over many decades:

        G(s) = 1 - Δ z / (1 + z) = (1 + (1 - Δ) z) / (1 + z),    z = (τ s)^ν

    Δ is positive if the layer acts in parallel to the actuator: the response lags and keeps moving
    after a step.  Δ is negative if the response passes through the layer to a load: it leads and
    then yields.  ν = 1 is Zener's single relaxation; for small ν the phase is nearly constant over
    decades, -90° ν times the share that relaxes.
    Ranges: ν 0.1–0.4 for stiff glues far from their glass transition, to 0.6 for damping polymers
    (Bagley & Torvik), to 0.8 if one relaxation dominates; τ depends on temperature over many
    decades.

    Attributes:
        strength: Δ, the share of the response that is missing at high frequency, one number,
            dimensionless.
        time_constant: τ, of the relaxation, one number [s].
        order: ν, one number, dimensionless.

    Source: Bagley & Torvik, J. Rheol. 27 (1983) 201; Näsholm & Holm, Fract. Calc. Appl. Anal. 16
    (2013) 26, for the fractional Zener model.
    """

    strength: Parameter
    time_constant: Parameter
    order: Parameter

    def __init__(self, strength: float, time_constant: float, order: float = 0.25):
        self.strength = Parameter(strength, lower=-1.0, upper=0.9, plausible=(-0.5, 0.5))
        self.time_constant = Parameter(
            time_constant, "s", lower=1e-8, upper=1e9, plausible=(1e-6, 1e4), logarithmic=True
        )
        self.order = Parameter(order, lower=0.05, upper=1.0, plausible=(0.1, 0.8))

    def symbol(self, s: Array) -> Array:
        # As two powers, since the power of s alone is cheap.
        order = self.order.value
        power = s**order * self.time_constant.value**order
        return 1 - self.strength.value * power / (1 + power)

    def static_gain(self) -> ArrayLike:
        return 1.0


class MaxwellLayer(AbstractLadder):
    r"""A layer through which the response passes to a spring, with a few relaxations:

        G(s) = 1 + Σ_i g_i τ_i s/(1 + τ_i s),    τ_i = τ ρ^(i-1),    i = 1 … 4

    If the layer lies in parallel to the actuator, its relaxations are those of creep, and
    `KelvinVoigtCreep` describes them.

    Args:
        share: initial value of every g_i.
        fastest: initial τ.
        ratio: initial ρ.

    Attributes:
        shares: g_i ≥ 0 (4,), by which share the load moves further before element i has relaxed,
            dimensionless.
        fastest: τ, the shortest time constant, one number [s].
        ratio: ρ, the ratio of one time constant to the next, one number, dimensionless.

    Source: Ferry, Viscoelastic Properties of Polymers (1980), chapter 1, generalised Maxwell body.
    """

    shares: Parameter
    fastest: Parameter
    ratio: Parameter

    def __init__(self, share: float = 0.01, fastest: float = 0.05, ratio: float = 6.0):
        shares = np.full(RELAXATIONS, share)
        self.shares = Parameter(shares, lower=0.0, upper=0.5, plausible=(0.0, 0.2))
        self.fastest = Parameter(
            fastest, "s", lower=1e-10, upper=1e7, plausible=(1e-5, 1e3), logarithmic=True
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
    maxwell = at_values(MaxwellLayer(), ladders(0.1 * fastest, fastest, 10 * fastest))
    return [*zener, *maxwell]


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
    concealed_by="the orders and gains of fractional models: alpha of FOH, chi and mu of LFDH, mu "
    "of creep",
    axes=("frequency", "phase", "time"),
)
