"""Mains frequency and its harmonics in the sensor signal."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values

_LINES = 5
"""Harmonics that are fitted at most; chosen by judgement."""
_WANDER = 0.002
"""The plausible relative deviation of the mains' frequency, ±0.1 Hz at 50 Hz."""
_MOST_TRIED = 6
"""Trials of the frequency at most on either side of the nominal one; chosen by judgement."""


class MainsInterference(AbstractBlock):
    r"""The mains' fundamental and its harmonics to the 5th, in no relation to the drive:

        d(t) = Σ_{k=1}^{lines} a_k cos(2πk f t) + b_k sin(2πk f t)

    Harmonics above half the recording's rate are left out, as by the filter before a converter: an
    aliased one could follow any slow drift.  Amplitudes, phases and f are separate for each
    recording.

    Args:
        frequency: initial f [Hz].
        lines: number of harmonics, with the fundamental.

    Attributes:
        cosines: a_k (lines,) [response].
        sines: b_k (lines,) [response].
        frequency: f, within 1 % of its initial value, one number [Hz].

    Source: Ott, Electromagnetic Compatibility Engineering (2009), chapter 3.
    """

    cosines: Parameter
    sines: Parameter
    frequency: Parameter

    def __init__(self, frequency: float, lines: int = _LINES):
        none = np.zeros(lines)
        self.cosines = Parameter(none, "response", gain=True, per_recording=True)
        self.sines = Parameter(none, "response", gain=True, per_recording=True)
        self.frequency = Parameter(
            frequency,
            "Hz",
            lower=0.99 * frequency,
            upper=1.01 * frequency,
            plausible=((1 - _WANDER) * frequency, (1 + _WANDER) * frequency),
            per_recording=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        time = jnp.arange(drive.shape[0]) * grid.step
        orders = np.arange(1, self.cosines.value.size + 1)
        angles = 2 * np.pi * self.frequency.value * time[:, None] * orders
        return jnp.cos(angles) @ self.cosines.value + jnp.sin(angles) @ self.sines.value


def _trials(setting: Setting) -> list:
    size = 0.001 * setting.response_span
    trials = []
    for mains in (50.0, 60.0):
        count = int(np.clip(0.5 / setting.step // (mains * (1 + _WANDER)), 1, _LINES))
        lines = size * np.eye(count)
        # A recording of the duration T distinguishes frequencies that differ by 1/T, and an
        # optimiser does not cross from one to the next.
        either_side = min(round(_WANDER * mains * setting.duration), _MOST_TRIED)
        # At the nominal frequency itself sampling often aliases one harmonic to another.
        aside = min(0.25 / setting.duration, 0.25 * _WANDER * mains)
        shapes = [
            {"frequency": mains + k / setting.duration + aside, name: line}
            for k in range(-either_side, either_side + 1)
            for name in ("cosines", "sines")
            for line in lines
        ]
        trials += at_values(MainsInterference(mains, count), shapes)
    return trials


EFFECT = Effect(
    name="mains_interference",
    site="additive",
    sentence="the sensor signal contains the mains frequency and its harmonics",
    equation="sum_k a_k cos(2 pi k f t) + b_k sin(2 pi k f t)",
    source="Ott, Electromagnetic Compatibility Engineering (2009), chapter 3",
    trials=_trials,
    separated_by={"resonance": "a drive at other frequencies than multiples of the mains'"},
    concealed_by="nothing, unless the drive itself runs at the mains frequency",
    axes=("frequency",),
)
