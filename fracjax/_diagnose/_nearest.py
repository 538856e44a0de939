"""Which other model of a loop is nearer to a recording that one is far from."""

from __future__ import annotations

from typing import NamedTuple

from .._computing import Clock
from .._fit import settle
from .._models import Model
from .._prepare import HistoryOption, Preparation, model_of
from .._solve import Progress
from ._fitted import fitted
from ._held_out import Predict

_LOOPS = ("prandtl_ishlinskii", "bouc_wen", "foh", "lfdh")
"""The models of a loop that are compared, from a sum of plays to a fractional derivative."""
_STARTS = 4
"""Starts of each fit; chosen by judgement."""
_CLEARLY = 0.7
"""The error on held-out data, over the model's own, below which another model is nearer;
chosen by judgement."""


class Nearest(NamedTuple):
    """A model, and its error on held-out data [response unit]."""

    name: str
    rmse: float


def nearest_model(
    model: Model,
    rmse: float,
    preparation: Preparation,
    history: HistoryOption | None,
    predict: Predict,
    progress: Progress,
    clock: Clock,
) -> Nearest | None:
    """The model that predicts held-out data best, if that is clearly better than `rmse`, the error
    of the one that was diagnosed; None if there is none, or the time is over or interrupted."""
    best = Nearest(model.name, _CLEARLY * rmse)
    recordings = [take.recording for take in preparation.takes]
    try:
        for name in _LOOPS:
            if clock.is_over:
                return None
            if name == model.name:
                continue
            progress(f"comparing with {name}")
            block = model_of(name, recordings).block
            solved = settle(block, preparation, history=history, starts=_STARTS, seed=0)
            predicted = predict(fitted([solved.block], solved.preparation)).rmse
            best = min(best, Nearest(name, predicted), key=lambda nearest: nearest.rmse)
    except KeyboardInterrupt:
        clock.stopped = True
        return None
    return best if best.name != model.name else None
