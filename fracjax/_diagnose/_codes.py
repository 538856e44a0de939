"""Quantisation, seen in the recording's own codes instead of in a residual."""

from __future__ import annotations

from .._blocks import EFFECTS
from .._fit import Estimate
from ._judgement import SUREST, is_exhausted
from ._result import NamedEffect
from ._stage import Stage

_NAME = "quantisation"
_LEAST = 0.9
_EXACT = 1e-3


def seen_in_codes(base: Stage, stage: Stage) -> NamedEffect | None:
    """The converter's steps, where all values lie on a grid as coarse as the noise is large.

    A noise that reaches over a third of a step makes the rounding error independent of the response
    (Widrow & Kollár, Quantization Noise (2008), chapter 19): in a residual it looks like noise, and
    a noise floor that was read from the recording holds it.  The codes show it all the same.  None
    where the steps are finer, where something else is left over, or where a fit has found it.
    """
    step = stage.preparation.setting.resolution
    floors = [take.noise.sigma for take in stage.preparation.takes if take.noise is not None]
    if _NAME in stage.adopted or step < _LEAST * min(floors) or not is_exhausted(base, stage):
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
