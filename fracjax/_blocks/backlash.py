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

    r [response], at most 5 % of the span: beyond, it is memory.  w, the part that passes through
    the joint, between 0 and 1: after a reversal z follows with the slope 1 - w until y has moved by
    2r.  A steady loop opens by 2 w r whatever its amplitude, as long as it is over 2r wide.  Where
    y moves by more than 2r from sample to sample, only w r is known.
    It needs no reference point: a constant added to y is added to z.  Before t = 0 the joint stands
    in the middle of its clearance, or with steady periods where they leave it.
    The derivatives with respect to r and y jump where the joint closes, as JAX takes them.
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
        passed = play_after_history(drive, self.radius.value[None], grid)[:, 0]
        return drive + self.weight.value * (passed - drive)


def _trials(setting: Setting) -> list:
    span = setting.response_span
    block = Backlash(0.5, 0.01 * span, span=span)
    return at_values(block, [{"radius": share * span} for share in np.geomspace(0.002, 0.05, 8)])


EFFECT = Effect(
    name="backlash",
    site="response",
    sentence="a joint with clearance takes up part of the motion after every reversal before it "
    "passes it on",
    equation="y + w (play(y, r) - y)",
    source="Nordin & Gutman, Automatica 38 (2002) 1633",
    trials=_trials,
    separated_by={
        "coulomb_friction": "reversals at creeping speed, where friction holds and a clearance is "
        "crossed",
        "minor_loop_memory": "two amplitudes: backlash has the same width in both",
        "amplitude_dependence": "two amplitudes: backlash has the same width in both",
    },
    concealed_by="the width of the hysteresis loop",
    axes=("reversal", "phase", "harmonics", "level"),
    one_sided=True,
)
