"""The model extended by the named effects, under the law that predicts held-out parts best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .._blocks import EFFECTS, AbstractBlock
from .._computing import Clock
from .._inside import Inside
from .._models import Model
from .._naming import block_name
from .._prepare import Preparation, model_of, residual_noises
from .._solve import Progress
from ._fitted import Fitted, fitted
from ._held_out import Predict, of_determined
from ._inquiry import Inquiry
from ._layers import Layer, path_of, wrapped
from ._thresholds import BETTER
from ._views import block_of

ANY_LOOP = "prandtl_ishlinskii"
"""The model that stands for a loop of any shape."""


@dataclass(frozen=True, eq=False)
class Extension:
    """A law with effects around it, the first innermost, or inside a machine, where each name has
    a first place among its effects, `inside`; `is_other_law` where the law is not the model that
    was asked about."""

    law: str
    layers: tuple[Layer, ...]
    fitted: Fitted
    is_other_law: bool
    inside: tuple[int, ...] = ()

    def path_of(self, k: int) -> str:
        """The dotted path of the parameters of the named effect k."""
        return path_of(self.layers, k) if self.layers else f"effects.{self.inside[k]}."


def extended_inside(law: Model, inside: Inside, preparation: Preparation) -> Extension | None:
    """A machine with the effects that were found inside it, if any."""
    if not inside.names:
        return None
    before = len(inside.base.block.effects)  # type: ignore[attr-defined]
    every = [block_name(effect) for effect in inside.block.effects]
    name = " @ ".join([law.name, *every[before:]])
    places = tuple(every.index(n, before) for n in inside.names)
    extended = fitted([inside.block], preparation)
    takes = preparation.takes
    if any(take.noise is not None and take.noise.method == "residual" for take in takes):
        # What a model without them leaves is no noise.
        noises = [
            own if take.noise is None or take.noise.method == "residual" else take.noise
            for take, own in zip(takes, residual_noises(extended.residuals), strict=True)
        ]
        extended = fitted([extended.solved.block], preparation.with_noises(noises))
    return Extension(name, (), extended, False, places)


def extended_by(
    inquiry: Inquiry,
    model: Model,
    predict: Predict,
    progress: Progress,
    clock: Clock,
) -> Extension | None:
    """The model with the named effects.  Where the model does not describe the recordings, a sum of
    plays takes its place if it predicts held-out data better; None if nothing is added."""
    if inquiry.explanation is not None:
        explanation = inquiry.explanation
        return Extension(model.name, explanation.layers, explanation.fitted, False)
    layers = tuple(_layer(inquiry, name.effect) for name in inquiry.names)
    if clock.is_over or inquiry.is_adequate:
        return None
    base, preparation = inquiry.base, inquiry.base.preparation
    own = None
    if layers:
        progress(f"refitting {model.name} with {' and '.join(n.effect for n in inquiry.names)}")
        own = Extension(model.name, layers, _with(layers, base.solved.block, preparation), False)
    if model.name == ANY_LOOP or inquiry.model is None:
        return own
    progress(f"comparing with {ANY_LOOP}")
    recordings = [take.recording for take in preparation.takes]
    # Under the same noise and history, so that the two are compared.
    preparation = preparation.uncorrected
    other = fitted([model_of(ANY_LOOP, recordings).block], preparation)
    if layers:
        other = _with(layers, other.solved.block, preparation)
    mine = [base] if own is None else [base, own.fitted]
    *before, after = of_determined([predict(each) for each in (*mine, other)])
    if after.rmse < BETTER * min(each.rmse for each in before):
        return Extension(ANY_LOOP, layers, other, True)
    return own


def _layer(inquiry: Inquiry, name: str) -> Layer:
    """An effect with the shape that it has under path curves."""
    effect, setting = EFFECTS[name], inquiry.base.preparation.setting
    return Layer(effect, block_of(effect, inquiry.curves.shape_of(name), setting))


def _with(layers: Sequence[Layer], block: AbstractBlock, preparation: Preparation) -> Fitted:
    """A law fitted with effects around it: from their shapes as found, and as they usually are."""
    usual = [Layer(la.effect, la.effect.trials(preparation.setting)[0]) for la in layers]
    return fitted([wrapped(block, layers), wrapped(block, usual)], preparation)
