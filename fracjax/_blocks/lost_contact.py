"""Contact lost between actuator and load: a unilateral spring."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values

_LEAST = 1e-9


class LostContact(AbstractBlock):
    r"""Where the actuator draws back too far it no longer moves the load, or only partly:

        x = y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3)

    Above the threshold y_c [response] the load follows, behind a contact that yields as Hertz's,
    the less the more it is pressed (c Y is what it has yielded one span Y [response] above; c = 0:
    a rigid one); below it, by the share 1 - w of the motion (w = 1: the load stays where a stop or
    its own spring holds it).  y is counted from the response at the first sample, as y_c is: a
    recording does not tell where the zero of its sensor lies, and a law with memory leaves its own
    level open by what happened before.  Recordings that are fitted together, or predicted, must
    therefore start from the same displacement; and the response must count positive in the
    direction in which the actuator pushes.
    Between samples nothing is assumed: the kink acts at each instant.  A load thrown off by its own
    inertia at peak acceleration, instead of left behind at low drive, is not in it.
    Ranges: y_c anywhere in the stroke, w from 0 to 1 by its meaning, c some percent.
    Source: Shaw & Holmes, J. Sound Vib. 90 (1983) 129: the piecewise linear oscillator; Johnson,
    Contact Mechanics (1985), chapter 4, for the contact.
    """

    share: Parameter
    compliance: Parameter
    threshold: Parameter
    span: Array | np.ndarray

    def __init__(
        self, share: float, threshold: float, compliance: float = 0.0, *, low: float, span: float
    ):
        self.share = Parameter(share, plausible=(0.0, 1.0), gain=True)
        self.compliance = Parameter(compliance, plausible=(0.0, 0.3), gain=True)
        self.threshold = Parameter(
            threshold,
            "response",
            lower=low - 0.1 * span,
            upper=low + span,
            plausible=(low - 0.05 * span, low + 0.7 * span),
        )
        self.span = np.asarray(span, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        above = drive - drive[0] - self.threshold.value
        # A cube root has no derivative at 0.
        pressed = jnp.maximum(above / self.span, _LEAST) ** (2 / 3)
        missing = self.share.value * jnp.minimum(above, 0.0)
        return drive - missing - self.compliance.value * self.span * pressed


def _trials(setting: Setting) -> list:
    low, span = setting.response_low, setting.response_span
    block = LostContact(0.1, low + 0.2 * span, low=low, span=span)
    shapes = [{"threshold": low + share * span} for share in np.geomspace(0.003, 0.6, 14)]
    pressed = {"threshold": low + 0.08 * span, "compliance": 0.02}
    return at_values(block, [*shapes, pressed])


EFFECT = Effect(
    name="lost_contact",
    site="response",
    sentence="below a displacement the actuator loses contact with its load and no longer moves "
    "it, or only partly",
    equation="y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3)",
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
