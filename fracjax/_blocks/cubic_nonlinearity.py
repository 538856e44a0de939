"""Cubic dependence of strain on the drive."""

from __future__ import annotations

import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class CubicNonlinearity(AbstractBlock):
    r"""The odd part of a curved relation between field and strain, about the state of rest:

        v = u + q_3 (u - u_0)³ / U²

    If u_0 is the centre of the drive, q_3/8 of a whole span U is added at each end, and v increases
    with u for q_3 > -4/3.  The curve is odd about u_0: the internal bias after poling, somewhere in
    the drive's range, or zero field, which lies at the end of a drive of one sign.  u_0 is a
    parameter, since about another point the same curve has a square as well.
    q_3 < 0 is the onset of saturation, q_3 > 0 a coefficient that grows with the field.

    Args:
        q_3: initial q_3.
        low: the lowest drive of the recording [drive].
        high: the highest drive of the recording [drive].

    Attributes:
        q_3: one number, dimensionless.
        centre: u_0, one number [drive].
        span: U, peak to peak of the recording's drive, one number [drive].

    Source: D. A. Hall, J. Mater. Sci. 36 (2001) 4575: constitutive equations with higher powers of
    the field, whose coefficients change by tens of percent below the coercive field.
    """

    q_3: Parameter
    centre: Parameter
    span: Array | np.ndarray

    def __init__(self, q_3: float, *, low: float, high: float):
        span = high - low
        self.q_3 = Parameter(q_3, lower=-1.0, upper=1.0, plausible=(-0.5, 0.5))
        ends = min(low, 0.0), max(high, 0.0)
        self.centre = Parameter(
            0.5 * (low + high),
            "drive",
            lower=ends[0] - span,
            upper=ends[1] + span,
            plausible=(ends[0] - 0.1 * span, ends[1] + 0.1 * span),
        )
        self.span = np.asarray(span, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return drive + self.q_3.value * (drive - self.centre.value) ** 3 / self.span**2


def _trials(setting: Setting) -> list:
    low, high = setting.drive_low, setting.drive_high
    block = CubicNonlinearity(0.05, low=low, high=high)
    sizes = {low: 0.02, setting.drive_centre: 0.05, high: 0.02}
    shapes = [{"centre": u, "q_3": sign * q} for u, q in sizes.items() for sign in (1, -1)]
    return at_values(block, shapes)


EFFECT = Effect(
    name="cubic_nonlinearity",
    site="drive",
    sentence="strain depends on the cube of the field in addition to the field itself, so that "
    "odd harmonics grow with the cube of the amplitude",
    equation="u + q3 (u - u0)^3 / U^2",
    source="Hall, J. Mater. Sci. 36 (2001) 4575",
    trials=_trials,
    separated_by={
        "electrostriction": "an amplitude ladder at two biases: a cube's even harmonics vanish "
        "at one bias, a square's at none",
        "slew_rate_limit": "an amplitude ladder at a tenth of the frequency: the cube does not "
        "depend on the rate",
        "amplitude_dependence": "an amplitude ladder: a cubic nonlinearity widens no loop",
        "saturation": "a measured drive: saturation is flat beyond a threshold",
        "sensor_nonlinearity": "the same drive with the sensor's gap shifted",
    },
    concealed_by="the gain k_l of the hysteresis, if the amplitude does not change",
    axes=("level", "harmonics", "phase"),
    rate_independent=True,
)
