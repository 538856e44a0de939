"""What a posterior predicts for another drive."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from .._blocks import Setting
from .._models import Model, parse_model
from .._operators import History
from .._recording import InputError, Recording
from .._show import view_of_tuple
from .._simulate import simulate, step_to_predict

CENTRAL = (2.5, 97.5)
"""Percentiles at the ends of the central 95 %."""


class PosteriorPrediction(NamedTuple):
    """What a posterior predicts for a drive, without the sensor's noise.

    Attributes:
        mean: Mean (N,) over the draws, in the response's unit.
        interval: Lower and upper end (2, N) of the central 95 %, in the same unit.
    """

    mean: np.ndarray
    interval: np.ndarray

    def __repr__(self) -> str:
        return view_of_tuple(self).brief()

    def _repr_html_(self) -> str:
        return view_of_tuple(self).html()


@dataclass(frozen=True, eq=False)
class Predictor:
    """Some draws of a posterior, with the first recording's offset, and what they are to drive.

    Attributes:
        model: The model; None where it was loaded, and its name does not build it.
        values: Values of the model's parameters by name, as fitted.
        setting: Ranges of the recordings, by which the model was built.
        draws: By free parameter (D, …), in its unit.
        offsets: What the first recording's sensor reads at the model's zero (D,) [response].
        step: The first recording's step [s].
        history: What the drive did before the first sample, where a call does not say.
    """

    model: Model | None
    values: Mapping[str, Any]
    setting: Setting
    draws: Mapping[str, np.ndarray]
    offsets: np.ndarray
    step: float
    history: History

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None,
        history: History | None,
        units: tuple[str, str],
        source: str,
    ) -> PosteriorPrediction:
        """Mean and interval of the responses of all draws, as `Posterior.predict` says."""
        model = self.model
        if model is None:
            raise InputError.at(
                "posterior, predict",
                "a model that its name builds",
                "one of a class of its own, in a posterior loaded from a file",
                "sample it in this session",
            )
        step = step_to_predict(drive, step, self.step, units, source)
        responses = np.stack(
            [
                simulate(
                    model.with_values({name: draw[at] for name, draw in self.draws.items()}),
                    drive,
                    step,
                    history or self.history,
                ).response
                + offset
                for at, offset in enumerate(self.offsets)
            ]
        )
        return PosteriorPrediction(
            responses.mean(axis=0), np.percentile(responses, CENTRAL, axis=0)
        )

    def to_dict(self) -> dict[str, Any]:
        """What `model_of` reads of it, for JSON."""
        return {
            "setting": asdict(self.setting),
            "values": dict(self.values),
            "step_s": self.step,
            "history": self.history,
        }


def predictor_of(
    name: str, entry: Mapping[str, Any], draws: Mapping[str, np.ndarray], offsets: np.ndarray
) -> Predictor:
    """The predictor of a saved posterior of the model of this name."""
    setting, values = Setting(**entry["setting"]), entry["values"]
    model = None
    with suppress(InputError):
        model = parse_model(name, setting, values).with_values(values)
    return Predictor(model, values, setting, draws, offsets, entry["step_s"], entry["history"])
