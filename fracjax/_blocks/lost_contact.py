"""Contact lost between actuator and load: a unilateral spring."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values

_LEAST = 1e-9
"""The smallest base of a power, as a share of the span."""


class LostContact(AbstractBlock):
    r"""If the actuator retracts too far, it no longer moves the load, or only partly:

        x = y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3)

    Above the threshold y_c the load follows through a Hertzian contact, which stiffens with the
    load: c Y is its deflection at one span Y above the threshold, and c = 0 is a rigid contact.
    Below the threshold the load follows by the share 1 - w of the motion; for w = 1 a stop or its
    own spring holds it.
    y and y_c are counted from the response at the first sample, with `rest` history from zero.  The
    reason is that a recording does not show where the zero of its sensor lies, and that the level
    of a model with memory depends on its prior history.  Recordings that are fitted together, or
    predicted, must therefore start from the same displacement; and the response must count
    positive in the direction in which the actuator pushes.
    The kink acts at each sample, with no assumption about the motion between samples.
    `ThrownLoad` describes a load that its own inertia throws off.
    Ranges: y_c anywhere in the stroke, w from 0 to 1 by its meaning, c some percent.

    Args:
        share: initial w.
        threshold: initial y_c.
        compliance: initial c.
        low: the lowest response, counted from the first sample [response].
        span: Y [response].

    Attributes:
        share: w, one number, dimensionless.
        compliance: c, one number, dimensionless.
        threshold: y_c, one number [response].
        span: Y, peak to peak of the recorded response, one number [response].

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
        above = drive - grid.origin(drive) - self.threshold.value
        # A cube root has no derivative at 0.
        pressed = jnp.maximum(above / self.span, _LEAST) ** (2 / 3)
        missing = self.share.value * jnp.minimum(above, 0.0)
        return drive - missing - self.compliance.value * self.span * pressed


class ThrownLoad(AbstractBlock):
    r"""If the actuator retracts faster than its load can fall, the load flies until they meet:

        x_n = max(y_n, 2 x_{n-1} - x_{n-2} - a h²)

    h [s] is the grid's step.  While y'' > -a the load stays on the actuator; otherwise it moves as
    a thrown body, x'' = -a, and does not bounce when it lands.  The response must be the motion of
    the load, and count positive in the direction in which the actuator pushes.
    Ranges: around the acceleration of a motion with the recording's stroke and speed.

    Args:
        holding: initial a.
        typical: the acceleration from which the ranges are derived [response/s²].

    Attributes:
        holding: a, the acceleration that holds the load down (preload over mass, plus gravity), one
            number [response/s²].

    Source: Holmes, J. Sound Vib. 84 (1982) 173, with no restitution.
    """

    holding: Parameter

    def __init__(self, holding: float, *, typical: float):
        self.holding = Parameter(
            holding,
            "response/s^2",
            lower=1e-2 * typical,
            upper=1e6 * typical,
            plausible=(0.1 * typical, 1e4 * typical),
            logarithmic=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        fall = self.holding.value * grid.step**2

        def step(before: tuple[Array, Array], y: Array) -> tuple[tuple[Array, Array], Array]:
            last, earlier = before
            x = jnp.maximum(y, 2 * last - earlier - fall)
            return (x, last), x

        start = (drive[0], drive[0])
        if grid.history == "periodic":
            start, _ = jax.lax.scan(step, start, drive)
        return jax.lax.scan(step, start, drive)[1]


def _trials(setting: Setting) -> list:
    low, span = setting.response_low, setting.response_span
    block = LostContact(0.1, low + 0.2 * span, low=low, span=span)
    shapes = [{"threshold": low + share * span} for share in np.geomspace(0.003, 0.6, 14)]
    pressed = {"threshold": low + 0.08 * span, "compliance": 0.02}
    # Thrown at the recording's speed v, a load rises by v²/2a.  A small change of a decides how far
    # a smooth motion throws it: some of these do nothing, some far too much, one is about right.
    typical = 0.5 * span * (setting.top_rate / setting.drive_span) ** 2
    thrown = at_values(
        ThrownLoad(typical, typical=typical),
        [{"holding": typical / height} for height in np.geomspace(0.02, 2.0, 14)],
    )
    return [*at_values(block, [*shapes, pressed]), *thrown]


EFFECT = Effect(
    name="lost_contact",
    site="response",
    sentence="below a certain displacement, or when it retracts too fast, the actuator loses "
    "contact with its load and no longer moves it, or only partly",
    equation="y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3), or x'' = -a wherever x > y",
    source="Shaw & Holmes, J. Sound Vib. 90 (1983) 129; Holmes, J. Sound Vib. 84 (1982) 173",
    trials=_trials,
    separated_by={
        "saturation": "the same amplitude at another bias: contact is lost at low drive only, a "
        "supply limits at high drive only",
        "backlash": "loops at a higher bias or preload: contact is then never lost, while backlash "
        "stays at every reversal",
        "electrostriction": "the same amplitude at another bias: a kink stays at its level, a "
        "curvature acts at every level",
    },
    concealed_by="the asymmetry term k_p of the hysteresis",
    axes=("level", "phase", "harmonics"),
    one_sided=True,
    rate_independent=True,
)
