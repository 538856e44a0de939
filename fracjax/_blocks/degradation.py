"""Gain that changes with the path travelled: fatigue, wear, running-in."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


class Degradation(AbstractBlock):
    r"""The gain changes with the path that the response has travelled, and not with time:

        x = y + g (y - y_0 + z) (1 - e^(-P/L)),    P = ∫ |dy| / s

    It is the fatigue of a ferroelectric, whose switchable polarization falls with the number of
    cycles, the wear of a contact or the running-in of a mechanism.  It does not go on at rest.
    Ranges: fatigue sets in after thousands of strokes at high fields, and running-in within a few.

    Args:
        gain: initial g.
        zero: initial z.
        path: initial L.
        size: s [response].

    Attributes:
        gain: g, the change of the gain in the end, one number, dimensionless.
        zero: z, how far y_0 lies above the unknown zero of the displacement, one number [response].
        path: L, the path along which it changes, in strokes s, one number, dimensionless.
        size: s, the stroke [response].

    Source: Genenko, Glaum, Hoffmann & Albe, Mater. Sci. Eng. B 192 (2015) 52 (mechanisms of ageing
    and fatigue in ferroelectrics).
    """

    gain: Parameter
    zero: Parameter
    path: Parameter
    size: Array | np.ndarray

    def __init__(self, gain: float, zero: float, path: float, *, size: float):
        self.gain = Parameter(gain, plausible=(-0.3, 0.3), gain=True)
        self.zero = Parameter(
            zero, "response", lower=-10 * size, upper=10 * size, plausible=(-2 * size, 2 * size)
        )
        self.path = Parameter(path, lower=1e-2, upper=1e6, plausible=(0.1, 1e4), logarithmic=True)
        self.size = np.asarray(size, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        origin = grid.origin(drive)
        steps = jnp.abs(jnp.diff(drive, prepend=drive[:1])) / self.size
        wear = -jnp.expm1(-jnp.cumsum(steps) / self.path.value)
        return drive + self.gain.value * (drive - origin + self.zero.value) * wear


def _trials(setting: Setting) -> list:
    travelled = max(setting.rms_rate * setting.duration / setting.drive_span, 1.0)
    block = Degradation(0.02, 0.0, travelled, size=setting.response_span)
    middle = setting.response_low + 0.5 * setting.response_span
    return at_values(
        block,
        [
            {"path": share * travelled, "zero": z}
            for share in (0.1, 0.3, 1.0)
            for z in (0.0, -middle)
        ],
    )


EFFECT = Effect(
    name="degradation",
    site="modulation",
    sentence="the gain changes with the path travelled, as by fatigue, wear or running-in",
    equation="y + g (y - y0 + z) (1 - exp(-P/L)), P = integral |dy| / s",
    source="Genenko, Glaum, Hoffmann & Albe, Mater. Sci. Eng. B 192 (2015) 52",
    trials=_trials,
    separated_by={
        "gain_drift": "the same loops after a rest: a warm actuator has cooled, a worn one is as it "
        "was",
        "thermal_drift": "a rest within the record: a drift goes on, degradation does not",
    },
    concealed_by="the gain, which absorbs its average",
    axes=("time", "level", "harmonics"),
)
