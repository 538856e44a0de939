"""Contact lost between actuator and load: a unilateral spring."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class LostContact(AbstractBlock):
    r"""Where the actuator draws back too far it no longer moves the load, or only partly:

        x = y - w min(y - y_c, 0)

    Above the threshold y_c [response] the load follows wholly; below it, by the share 1 - w of the
    motion (w = 1: the load stays where a stop or its own spring holds it).  y is counted from the
    response at the first sample, as y_c is: a recording does not tell where the zero of its sensor
    lies, and a law with memory leaves its own level open by what happened before.  Recordings that
    are fitted together, or predicted, must therefore start from the same displacement; and the
    response must count positive in the direction in which the actuator pushes.
    Between samples nothing is assumed: the kink acts at each instant.  A load thrown off by its own
    inertia at peak acceleration, instead of left behind at low drive, is not in it.
    Ranges: y_c anywhere in the stroke, w from 0 to 1 by its meaning.
    Source: Shaw & Holmes, J. Sound Vib. 90 (1983) 129: the piecewise linear oscillator.
    """

    share: Parameter
    threshold: Parameter

    def __init__(self, share: float, threshold: float, *, low: float, span: float):
        self.share = Parameter(share, plausible=(0.0, 1.0), gain=True)
        self.threshold = Parameter(
            threshold,
            "response",
            lower=low - 0.1 * span,
            upper=low + span,
            plausible=(low, low + 0.7 * span),
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        missing = jnp.minimum(drive - drive[0] - self.threshold.value, 0.0)
        return drive - self.share.value * missing


def _trials(setting: Setting) -> list:
    low, span = setting.response_low, setting.response_span
    block = LostContact(0.1, low + 0.2 * span, low=low, span=span)
    shares = (0.03, 0.08, 0.15, 0.25, 0.4, 0.6)
    return at_values(block, [{"threshold": low + share * span} for share in shares])


EFFECT = Effect(
    name="lost_contact",
    site="response",
    sentence="below a displacement the actuator loses contact with its load and no longer moves "
    "it, or only partly",
    equation="y - w min(y - y_c, 0)",
    source="Shaw & Holmes, J. Sound Vib. 90 (1983) 129",
    trials=_trials,
    separated_by={
        "saturation": "the same amplitude at another bias: contact is lost at low drive only, a "
        "supply limits at high drive only",
        "backlash": "loops at a higher bias or preload: contact is then never lost, while backlash "
        "stays at every reversal",
        "electrostriction": "the same amplitude at another bias: a kink stays at its level, a "
        "curvature is there at every level",
    },
    concealed_by="the asymmetry term k_p of the hysteresis",
    axes=("level", "phase", "harmonics"),
    one_sided=True,
)
