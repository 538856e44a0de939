"""The response of a model to a drive, on a grid refined until it no longer matters."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from ._models import Model, understood
from ._operators import HISTORIES, Grid, History, refine
from ._recording import InputError

_ERROR = 1e-4
_FINEST = 32


class Simulation(NamedTuple):
    """A response (N,) in the model's response unit, and the `error` of its discretisation.

    The error is what the last halving of the step changed, as a share of the response's span.
    """

    response: np.ndarray
    error: float


def simulate(
    model: Model | str, drive: np.ndarray, step: float, history: History = "constant"
) -> Simulation:
    """The response (N,) of a model, or that of a name, to a drive (N,) sampled every `step` [s].

    The grid is refined until halving it changes the response by less than 1e-4 of its span, or to
    32 steps per sample.  Units: the response's, as the model was fitted or written.
    Raises InputError for a drive that is no finite real channel, or an unknown history.
    """
    model = understood(model)
    drive = np.asarray(drive)
    if drive.ndim != 1 or drive.size < 5 or drive.dtype.kind not in "iuf":
        raise InputError.at(
            "simulate",
            "a real drive (N,) of at least 5 samples",
            f"{drive.dtype} of shape {drive.shape}",
            "give one channel at a time",
        )
    if not np.isfinite(drive).all():
        at = int(np.argmin(np.isfinite(drive)))
        raise InputError.at(
            f"simulate, sample {at}", "a finite drive", f"{drive[at]}", "correct or cut it"
        )
    if not 0 < step < np.inf:
        raise InputError.at("simulate", "a positive step in seconds", f"{step}", "correct it")
    if history not in HISTORIES:
        raise InputError.at(
            "simulate", f"a history out of {', '.join(HISTORIES)}", f'"{history}"', "correct it"
        )

    def respond(oversampling: int) -> np.ndarray:
        fine = refine(drive.astype(float), oversampling, history)
        grid = Grid(np.asarray(step / oversampling), history)
        return model.block.respond(fine, grid)[::oversampling]

    with jax.enable_x64(True):
        oversampling, error = 2, np.inf
        response = respond(oversampling)
        while not error <= _ERROR and oversampling < _FINEST:
            oversampling *= 2
            coarse, response = response, respond(oversampling)
            error = float(np.abs(response - coarse).max() / max(np.ptp(response), 1e-300))
    return Simulation(response, error)
