"""Drift that does not depend on the drive."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values


def _shortest_plausible(duration: float) -> float:
    """The shortest plausible time constant [s] for a recording of this duration [s]."""
    return max(0.02 * duration, min(1.0, duration))


class ThermalDrift(AbstractBlock):
    r"""The frame warms up during the recording:

        d(t) = a (1 - exp(-t/τ)) + b t

    It does not depend on the drive.  The warming at the start differs from recording to recording,
    so that each has its own a and b.
    Ranges: no frame warms up in less than a second; τ is plausible from that, or a fiftieth of the
    recording's duration if that is longer, to three times the duration.

    Args:
        time_constant: initial τ.
        longest: duration of the recording [s].

    Attributes:
        amplitude: a, one number [response].
        slope: b, one number [response/s].
        time_constant: τ, one number [s].

    Source: Slocum, Precision Machine Design (1992), section 2.3.
    """

    amplitude: Parameter
    slope: Parameter
    time_constant: Parameter

    def __init__(self, time_constant: float, *, longest: float):
        self.amplitude = Parameter(0.0, "response", gain=True, per_recording=True)
        self.slope = Parameter(0.0, "response/s", gain=True, per_recording=True)
        self.time_constant = Parameter(
            time_constant,
            "s",
            lower=1e-3 * longest,
            upper=3 * longest,
            plausible=(_shortest_plausible(longest), 3 * longest),
            logarithmic=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        time = jnp.arange(drive.shape[0]) * grid.step
        warming = -jnp.expm1(-time / self.time_constant.value)
        return self.amplitude.value * warming + self.slope.value * time


def _trials(setting: Setting) -> list:
    duration, size = setting.duration, 0.01 * setting.response_span
    constants = np.maximum(np.array([0.03, 0.1, 0.3]) * duration, _shortest_plausible(duration))
    block = ThermalDrift(constants[-1], longest=duration)
    shapes = [{"amplitude": size, "time_constant": one} for one in np.unique(constants)]
    return at_values(block, [*shapes, {"slope": size / duration}])


EFFECT = Effect(
    name="thermal_drift",
    site="additive",
    sentence="the displacement drifts slowly and independently of the drive, as when a frame warms "
    "up",
    equation="a (1 - exp(-t/tau)) + b t",
    source="Slocum, Precision Machine Design (1992), section 2.3",
    trials=_trials,
    separated_by={"creep": "a record at constant drive: drift continues, creep dies away"},
    concealed_by="the offset and the slow tail of the order alpha",
    axes=("time", "frequency"),
)
