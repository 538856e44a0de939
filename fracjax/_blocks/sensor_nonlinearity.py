"""Curvature of the displacement sensor."""

from __future__ import annotations

import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class SensorNonlinearity(AbstractBlock):
    r"""The reading is a curved function of the displacement:

        z = y + Y (s_2 x² + s_3 x³),   x = 2 (y - y_0)/Y

    A data sheet's non-linearity, the largest distance from the best straight line, is |s_2|/2 and
    |s_3|/4 of the range: 0.1 % for a capacitive or eddy-current sensor to 1 % for a strain gauge.
    y [response] is the model's response, without the recording's offset, which is fitted
    separately.  The range is therefore not the sensor's own but that of the recording.  About
    another point, or with a constant added to y, the same curve has the same s_3 and another s_2,
    gain and offset, so that the choice of y_0 costs no generality.
    Within the bounds z increases with y over the whole range.

    Args:
        s_2: initial s_2.
        s_3: initial s_3.
        centre: y_0 [response].
        span: Y [response].

    Attributes:
        s_2: the even part at the ends of the range, x = ±1, as a share of Y, one number,
            dimensionless.
        s_3: the odd part there, one number, dimensionless.
        centre: y_0, the response of a proportional model to the drive's centre, one number
            [response].
        span: Y, peak to peak of the recorded response, one number [response].

    Source: A. J. Fleming, Sens. Actuators A 190 (2013) 106: definition of non-linearity, and table
    of sensors.
    """

    s_2: Parameter
    s_3: Parameter
    centre: Array | np.ndarray
    span: Array | np.ndarray

    def __init__(self, s_2: float = 0.0, s_3: float = 0.0, *, centre: float, span: float):
        self.s_2, self.s_3 = (
            Parameter(s, lower=-0.1, upper=0.1, plausible=(-0.04, 0.04)) for s in (s_2, s_3)
        )
        self.centre, self.span = np.asarray(centre, float), np.asarray(span, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        x = 2 * (drive - self.centre) / self.span
        return drive + self.span * x * x * (self.s_2.value + self.s_3.value * x)


def _trials(setting: Setting) -> list:
    slope = setting.response_span / setting.drive_span
    block = SensorNonlinearity(centre=slope * setting.drive_centre, span=setting.response_span)
    shapes = [{name: s} for name in ("s_2", "s_3") for s in (0.005, -0.005)]
    return at_values(block, shapes)


EFFECT = Effect(
    name="sensor_nonlinearity",
    site="response",
    sentence="the sensor reads a curved function of the displacement, the same at every rate",
    equation="y + Y (s2 x^2 + s3 x^3), x = 2 (y - y0)/Y",
    source="Fleming, Sens. Actuators A 190 (2013) 106",
    trials=_trials,
    separated_by={
        "electrostriction": "the same drive with the sensor's gap shifted: a sensor's curvature "
        "changes, the material's does not",
        "cubic_nonlinearity": "the same drive with the sensor's gap shifted",
        "saturation": "a measured drive: saturation is flat beyond a threshold",
    },
    concealed_by="the asymmetry term k_p of the hysteresis",
    axes=("level", "harmonics", "phase"),
    rate_independent=True,
)
