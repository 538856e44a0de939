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
_UNROLLED = 8


class LostContact(AbstractBlock):
    r"""Where the actuator draws back too far it no longer moves the load, or only partly:

        x = y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3)

    Above the threshold y_c [response] the load follows, behind a contact that yields as Hertz's,
    the less the more it is pressed (c Y is what it has yielded one span Y [response] above; c = 0:
    a rigid one); below it, by the share 1 - w of the motion (w = 1: the load stays where a stop or
    its own spring holds it).  y is counted from the response at the first sample, as y_c is, but
    after a rest from that at rest: where a drive jumps from it, what follows at once depends on the
    step.  For a recording does not tell where the zero of its sensor lies, and a law with memory
    leaves its own level open by what happened before.  Recordings that are fitted together, or
    predicted, must therefore start from the same displacement; and the response must count
    positive in the direction in which the actuator pushes.
    Between samples nothing is assumed: the kink acts at each instant.  A load that its own inertia
    throws off is `ThrownLoad`'s.
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
        above = drive - grid.origin(drive) - self.threshold.value
        # A cube root has no derivative at 0.
        pressed = jnp.maximum(above / self.span, _LEAST) ** (2 / 3)
        missing = self.share.value * jnp.minimum(above, 0.0)
        return drive - missing - self.compliance.value * self.span * pressed


class ThrownLoad(AbstractBlock):
    r"""Where the actuator draws back faster than its load can fall, the load flies until they meet:

        x_n = max(y_n, 2 x_{n-1} - x_{n-2} - a h²)

    a [response/s²]: the acceleration that holds the load down, its preload over its mass, and its
    weight; h the grid's step.  Where y'' > -a the load stays on it; else it goes on as a body
    thrown, x'' = -a, and does not bounce where it lands.  The response must count positive in the
    direction in which the actuator pushes, and be the load's.
    Ranges: about what throws a load by the recording's stroke at its speed.
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
            start, _ = jax.lax.scan(step, start, drive, unroll=_UNROLLED)
        return jax.lax.scan(step, start, drive, unroll=_UNROLLED)[1]


def _trials(setting: Setting) -> list:
    low, span = setting.response_low, setting.response_span
    block = LostContact(0.1, low + 0.2 * span, low=low, span=span)
    shapes = [{"threshold": low + share * span} for share in np.geomspace(0.003, 0.6, 14)]
    pressed = {"threshold": low + 0.08 * span, "compliance": 0.02}
    # Thrown at the recording's speed v, a load rises by v²/2a.  How far a smooth motion throws it
    # depends on little: some of these do nothing, some far too much, and one between them enough.
    typical = 0.5 * span * (setting.top_rate / setting.drive_span) ** 2
    thrown = at_values(
        ThrownLoad(typical, typical=typical),
        [{"holding": typical / height} for height in np.geomspace(0.02, 2.0, 14)],
    )
    return [*at_values(block, [*shapes, pressed]), *thrown]


EFFECT = Effect(
    name="lost_contact",
    site="response",
    sentence="below a displacement, or where it draws back too fast, the actuator loses contact "
    "with its load and no longer moves it, or only partly",
    equation="y - w min(y - y_c, 0) - c Y^(1/3) max(y - y_c, 0)^(2/3), or x'' = -a wherever x > y",
    source="Shaw & Holmes, J. Sound Vib. 90 (1983) 129; Holmes, J. Sound Vib. 84 (1982) 173",
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
