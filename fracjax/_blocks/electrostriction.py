"""Quadratic dependence of strain on the drive."""

from __future__ import annotations

import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class Electrostriction(AbstractBlock):
    r"""Strain grows with the square of the field, in addition to the piezoelectric part:

        v = u + q (u - u_0)² / U

    At each end of the range q/4 of a span U is added.  Another centre u_0 only changes gain and
    offset.

    Args:
        q: initial q.
        centre: u_0 [drive].
        span: U [drive].

    Attributes:
        q: one number, dimensionless.
        centre: u_0, the centre of the recording's drive, one number [drive].
        span: U, peak to peak of the recording's drive, one number [drive].

    Source: Uchino, Ferroelectric Devices (2010), chapter 4.
    """

    q: Parameter
    centre: Array | np.ndarray
    span: Array | np.ndarray

    def __init__(self, q: float, *, centre: float, span: float):
        self.q = Parameter(q, lower=-1.0, upper=1.0, plausible=(-0.3, 0.3))
        self.centre, self.span = np.asarray(centre, float), np.asarray(span, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return drive + self.q.value * (drive - self.centre) ** 2 / self.span


def _trials(setting: Setting) -> list:
    block = Electrostriction(0.01, centre=setting.drive_centre, span=setting.drive_span)
    return at_values(block, [{"q": q} for q in (0.02, -0.02)])


EFFECT = Effect(
    name="electrostriction",
    site="drive",
    sentence="strain grows with the square of the field, so that even harmonics grow with the "
    "square of the amplitude",
    equation="u + q (u - u0)^2 / U",
    source="Uchino, Ferroelectric Devices (2010), chapter 4",
    trials=_trials,
    separated_by={
        "saturation": "a measured drive: saturation is flat beyond a threshold",
        "minor_loop_memory": "bias sweep at one amplitude",
    },
    concealed_by="the asymmetry term k_p of the hysteresis",
    axes=("level", "harmonics", "phase"),
    rate_independent=True,
)
