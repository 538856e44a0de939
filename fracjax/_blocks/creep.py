"""Fractional creep."""

from __future__ import annotations

from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._block import AbstractLinearBlock
from ._effect import Effect, Setting, at_values


class Creep(AbstractLinearBlock):
    r"""A fractional integral of small order [F 11]:

        G_c(s) = k_c s^-μ        (constant phase -90°·μ)

    After a step it goes on as t^μ/Γ(1+μ) ≈ 1 + μ (ln t + 0.577…): the log law, with 2.303 μ per
    decade of time.  What was held before t = 0 is the datum creep is counted from.
    k_c is dimensionless · s^-μ and merges into the gains of a hysteresis it follows, so it stays
    fixed there.
    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (10) and (11).
    """

    k_c: Parameter
    mu: Parameter

    def __init__(self, k_c: float = 1.0, mu: float = 0.0072, *, fixed_gain: bool = False):
        self.k_c = Parameter(k_c, "s^-mu", gain=True, fixed=fixed_gain)
        self.mu = Parameter(
            mu, lower=1e-5, upper=0.3, plausible=(1e-3, 0.04), logarithmic=True
        )

    def symbol(self, s: Array) -> Array:
        return self.k_c.value * s ** -self.mu.value

    def static_gain(self) -> ArrayLike:
        return self.k_c.value


def _trials(setting: Setting) -> list:
    return at_values(Creep(fixed_gain=True), [{"mu": mu} for mu in (0.003, 0.01, 0.03)])


EFFECT = Effect(
    name="creep",
    site="response",
    sentence="after each change of the drive the displacement goes on creeping with the logarithm "
    "of time, in proportion to the change",
    equation="s^-mu",
    source="Xu et al., Fractal Fract. 8 (2024) 3, eq. (11); Jung & Gweon, Rev. Sci. Instrum. 71 "
    "(2000) 1896 for the log law",
    trials=_trials,
    separated_by={
        "thermal_drift": "steps up and down with holds over three decades of time",
        "drive_lag": "steps up and down with holds over three decades of time",
    },
    concealed_by="the order alpha and the gain k_h of the hysteresis",
    axes=("time", "reversal", "frequency"),
)
