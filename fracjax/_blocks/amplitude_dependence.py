"""Rayleigh's law: gain and hysteresis that grow with the amplitude."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting
from .minor_loop_memory import play_after_history

_GROUPS, _TOGETHER = 8, 8
"""64 radii, in groups that are computed together; the docstring below states the error."""
_PLACES = (np.arange(_GROUPS * _TOGETHER) + 0.5) / (_GROUPS * _TOGETHER)
"""Radii as shares of the span (64,), the middles of equal intervals."""


class AmplitudeDependence(AbstractBlock):
    r"""Domain walls pushed over random obstacles: play operators of all thresholds, equally dense:

        v = u + (4 α/U) ∫_0^U p_r(t) dr,    p_r the play of the drive u with radius r

    Each branch then adds Rayleigh's parabola to the drive: 2 α (u - u_0)²/U from the virgin state
    u_0 (that of t = 0), and ±α (u - u_1)²/U from a turning point u_1, until it meets an older
    branch, which then continues.  A steady loop of the width A has the mean slope 1 + α A/U, the
    opening α A²/(2U) and the area α A³/(3U): Rayleigh's coefficient d_0 + α A/U, if the base has
    d_0 = 1.  Rayleigh's own constant is 2 α/U, for an amplitude E_0 = A/2.
    An actuator that has been exercised is not virgin: its play operators then start above the drive
    at t = 0, by the share e of their radius.  After the drive came down from beyond its range
    e = 1, and the first branch is 1/(1 + e) of the virgin one; after it came up e < 0.
    Soft ceramics gain tens of percent of slope below the coercive field, hard ones a few percent.
    α may be negative, since the hysteresis of the base model may have absorbed too much.
    The integral is a sum over 64 radii, with an error of 2.5e-4 α U at each remembered turning
    point.

    Args:
        alpha: initial α.
        exercised: initial e.
        span: U, peak to peak of the recording's drive [drive]; a larger drive meets no further
            thresholds.

    Attributes:
        alpha: α, one number, dimensionless.
        exercised: e, one number, dimensionless.
        radii: r (8, 8) [drive].

    Source: D. Damjanovic & M. Demartin, J. Phys. D 29 (1996) 2057; D. A. Hall, J. Mater. Sci. 36
    (2001) 4575; Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2, for the
    sum of plays.
    """

    alpha: Parameter
    exercised: Parameter
    radii: Array | np.ndarray

    def __init__(self, alpha: float, exercised: float = 0.0, *, span: float):
        self.exercised = Parameter(exercised, lower=-1.0, upper=1.0)
        self.alpha = Parameter(alpha, lower=-0.5, upper=2.0, plausible=(0.0, 1.0))
        self.radii = (_PLACES * span).reshape(_GROUPS, _TOGETHER)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        def add(total: Array, radii: Array) -> tuple[Array, None]:
            plays = play_after_history(drive, radii, grid, self.exercised.value)
            return total + plays.sum(axis=1), None

        # A few radii at a time: all of them together would be the largest array of a fit.
        total, _ = jax.lax.scan(add, jnp.zeros_like(drive), jnp.asarray(self.radii))
        return drive + 4 * self.alpha.value * total / self.radii.size


def _trials(setting: Setting) -> list:
    span = setting.drive_span
    return [AmplitudeDependence(0.03, exercised, span=span) for exercised in (0.0, 1.0)]


EFFECT = Effect(
    name="amplitude_dependence",
    site="drive",
    sentence="domain walls move irreversibly over random obstacles, so that the gain grows with "
    "the amplitude and the width of the loop with its square",
    equation="u + (4 alpha/U) integral of play(u, r) over r from 0 to U: d = d0 (1 + alpha A/U)",
    source="Damjanovic & Demartin, J. Phys. D 29 (1996) 2057; Hall, J. Mater. Sci. 36 (2001) 4575",
    trials=_trials,
    separated_by={
        "minor_loop_memory": "an amplitude ladder: only Rayleigh's loop keeps its shape, with a "
        "width that grows as the square of the amplitude",
        "cubic_nonlinearity": "an amplitude ladder: a cubic nonlinearity widens no loop",
        "backlash": "two amplitudes: backlash has the same width in both",
    },
    concealed_by="the gain and the width of the hysteresis, if the amplitude does not change",
    axes=("level", "reversal", "phase", "harmonics"),
    one_sided=True,
    rate_independent=True,
)
