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
_PLACES = (np.arange(_GROUPS * _TOGETHER) + 0.5) / (_GROUPS * _TOGETHER)


class AmplitudeDependence(AbstractBlock):
    r"""Domain walls pushed over random obstacles: plays of all thresholds, equally frequent:

        v = u + (4 α/U) ∫_0^U p_r(t) dr,    p_r the play of the drive u with radius r

    Each branch then adds Rayleigh's parabola to the drive: from the virgin state at u_0 (that of
    t = 0) 2 α (u - u_0)²/U, and from a turning point u_1 ±α (u - u_1)²/U, until an older branch is
    met, which goes on as if nothing had been.  A steady loop A wide has the mean slope 1 + α A/U,
    the opening α A²/(2U) and the area α A³/(3U): Rayleigh's coefficient d_0 + α A/U with the base's
    d_0 for unity.  Rayleigh's own constant is 2 α/U, for an amplitude E_0 = A/2.
    An actuator that has been exercised is not virgin: its plays then stand by a share e of their
    radius above the drive at t = 0, e = 1 after it came down from beyond its range, and the first
    branch is 1/(1 + e) of the virgin one; e < 0 after it came up.
    α and e are dimensionless.  Soft ceramics gain tens of percent of slope below the coercive
    field, hard ones a few; a hysteresis beside it may have taken up too much, hence a bound below
    zero.
    U [drive] is the span of the recording's drive: a larger one finds no further thresholds.
    The integral is a sum over 64 radii, exact but for 2.5e-4 α U at each turning point kept.
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

        # A few radii at a time: all at once would be the largest array of a fit.
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
        "width that grows as the square",
        "cubic_nonlinearity": "an amplitude ladder: the cube widens no loop",
        "backlash": "two amplitudes: backlash has the same width in both",
    },
    concealed_by="the gain and the width of the hysteresis, while the amplitude does not change",
    axes=("level", "reversal", "phase", "harmonics"),
    one_sided=True,
)
