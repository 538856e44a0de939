"""Quantisation, detected in the recording's codes instead of in a residual."""

from __future__ import annotations

from .._blocks import EFFECTS
from .._fit import Estimate
from ._judgement import SUREST, residual_is_noise
from ._result import NamedEffect
from ._stage import Stage

_NAME = "quantisation"
_LEAST = 0.9
"""The smallest step that counts, over the noise level; chosen by judgement."""
_EXACT = 1e-3
"""Relative standard error that is stated for the step, which is exact; chosen by judgement."""


def detected_in_codes(base: Stage, stage: Stage) -> NamedEffect | None:
    """The converter's steps, if all values lie on a grid whose step is as large as the noise.

    If the noise exceeds a third of a step, the rounding error is independent of the response
    (Widrow & Kollár, Quantization Noise (2008), chapter 19): in a residual it looks like noise, and
    a noise floor that was estimated from the recording contains it.  The codes show it all the
    same.  The result is None if the steps are finer, if the residual exceeds the noise, or if a fit
    has adopted quantisation.
    """
    step = stage.preparation.setting.resolution
    floors = [take.noise.sigma for take in stage.preparation.takes if take.noise is not None]
    if _NAME in stage.adopted or step < _LEAST * min(floors) or not residual_is_noise(base, stage):
        return None
    unit = stage.preparation.takes[0].recording.response_unit
    return NamedEffect(
        name=_NAME,
        site=EFFECTS[_NAME].site,
        probability=SUREST,
        explained_fraction=min(1.0, step**2 / 12 / min(floors) ** 2),
        parameters=(Estimate("step", step, _EXACT * step, unit, True, False),),
        confusable_with=(),
        explains="the noise floor",
    )
