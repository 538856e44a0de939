"""Clearance in a joint behind the actuator."""

from __future__ import annotations

import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from .minor_loop_memory import play_after_history


class Backlash(AbstractBlock):
    r"""Part of the motion passes through a joint with clearance 2r:

        z = y + w (p_r - y),    p_r the play of the response y with radius r

    After a reversal z follows with the slope 1 - w until y has moved by 2r.  A steady loop opens by
    2 w r at every amplitude, if it is more than 2r wide.  If y moves by more than 2r from sample to
    sample, only the product w r is determined.
    A constant added to y is added to z.  Before t = 0 the joint is in the middle of its clearance,
    with `periodic` history where the steady periods leave it.
    The derivatives with respect to r and y, which JAX computes, jump where the joint closes.

    Args:
        weight: initial w.
        radius: initial r.
        span: peak to peak of the response [response]; r is at most 5 % of it, since a larger
            clearance acts like `MinorLoopMemory`.

    Attributes:
        weight: w, the part of the motion that passes through the joint, one number from 0 to 1,
            dimensionless.
        radius: r, half the clearance, one number [response].

    Source: Nordin & Gutman, Automatica 38 (2002) 1633; Brokate & Sprekels, Hysteresis and Phase
    Transitions (1996), chapter 2, for the play.
    """

    weight: Parameter
    radius: Parameter

    def __init__(self, weight: float, radius: float, *, span: float):
        self.weight = Parameter(weight, lower=0.0, upper=1.0, plausible=(0.01, 1.0))
        self.radius = Parameter(
            radius,
            "response",
            lower=1e-5 * span,
            upper=0.1 * span,
            plausible=(1e-4 * span, 0.05 * span),
            logarithmic=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        behind_joint = play_after_history(drive, self.radius.value[None], grid)[:, 0]
        return drive + self.weight.value * (behind_joint - drive)


def _trials(setting: Setting) -> list:
    span = setting.response_span
    block = Backlash(0.5, 0.01 * span, span=span)
    return at_values(block, [{"radius": share * span} for share in np.geomspace(0.002, 0.05, 8)])


EFFECT = Effect(
    name="backlash",
    site="response",
    sentence="a joint with clearance absorbs part of the motion after every reversal before it "
    "transmits it",
    equation="y + w (play(y, r) - y)",
    source="Nordin & Gutman, Automatica 38 (2002) 1633",
    trials=_trials,
    separated_by={
        "coulomb_friction": "reversals at very low speed, where friction holds the load and a "
        "clearance is crossed",
        "minor_loop_memory": "two amplitudes: backlash has the same width in both",
        "amplitude_dependence": "two amplitudes: backlash has the same width in both",
    },
    concealed_by="the width of the hysteresis loop",
    axes=("reversal", "phase", "harmonics", "level"),
    one_sided=True,
    rate_independent=True,
)
