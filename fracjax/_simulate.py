"""The response of a model to a drive, on a grid refined until the response no longer changes."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from ._models import Model, as_model
from ._operators import HISTORIES, Grid, History, refine
from ._recording import InputError, Recording, parse_quantity, require_units
from ._show import view_of_tuple

_TOLERANCE = 1e-4
"""Largest change at the last halving of the step, by the response's span; by judgement."""
_FINEST = 32
"""Most steps per sample; chosen by judgement."""


class Simulation(NamedTuple):
    """A simulated response and its discretisation error.

    Attributes:
        response: The response (N,), in the unit of the recording that the model was fitted to or
            the parameters were written for.
        error: Largest change of the response at the last halving of the step, as a share of its
            span.
    """

    response: np.ndarray
    error: float

    def __repr__(self) -> str:
        return view_of_tuple(self).brief()

    def _repr_html_(self) -> str:
        return view_of_tuple(self).html()


def simulate(
    model: Model | str,
    drive: np.ndarray | Recording,
    step: float | str | None = None,
    history: History = "constant",
) -> Simulation:
    """The response of a model to a drive, or to that of a recording.

    The grid is refined until halving its step changes the response by at most 1e-4 of its span, or
    to 32 steps per sample.

    Args:
        model: The model, or its name.
        drive: The drive (N,), in the unit that the model was fitted with; or a recording, of which
            drive and step are taken.
        step: The time between samples [s], or a text such as "1 ms"; not for a recording, whose
            time steps it says.
        history: What the drive did before the first sample: "rest" (zero), "constant" (its first
            value) or "periodic" (the same cycles).

    Returns:
        The response (N,) in the model's response unit, and its discretisation error.

    Raises:
        InputError: When the drive is not one channel of at least 5 finite real samples, the step is
            not positive, or the history or the model's name is unknown.
    """
    model = as_model(model)
    drive, step = _samples(drive, step)
    if drive.ndim != 1 or drive.size < 5 or drive.dtype.kind not in "iuf":
        raise InputError.at(
            "simulate",
            "a real drive (N,) of at least 5 samples",
            f"{drive.dtype} of shape {drive.shape}",
            "give one channel at a time",
        )
    if not np.isfinite(drive).all():
        sample = int(np.argmin(np.isfinite(drive)))
        raise InputError.at(
            f"simulate, sample {sample}", "a finite drive", f"{drive[sample]}", "correct or cut it"
        )
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
        while not error <= _TOLERANCE and oversampling < _FINEST:
            oversampling *= 2
            coarse, response = response, respond(oversampling)
            error = float(np.abs(response - coarse).max() / max(np.ptp(response), 1e-300))
    return Simulation(response, error)


def step_to_predict(
    drive: object, step: float | str | None, usual: float, units: tuple[str, str], source: str
) -> float | str | None:
    """The step for `simulate` of a drive for a result fitted to `source`, in its units.

    The step as given, else the usual one [s]; a recording has its own.  Raises InputError where a
    recording has other units.
    """
    if isinstance(drive, Recording):
        require_units(units, source, drive)
        return step
    return usual if step is None else step


def _samples(drive: object, step: float | str | None) -> tuple[np.ndarray, float]:
    """The drive (N,) and its step [s].  Raises InputError where the step is missing or none."""
    if isinstance(drive, Recording):
        if step is not None:
            expected = "a recording, or a drive and its step"
            raise InputError.at("simulate", expected, "a recording and a step", "omit the step")
        return drive.drive, drive.dt
    if step is None:
        raise InputError.at(
            "simulate", "a recording, or a drive and its step", "no step", "give step in seconds"
        )
    seconds = parse_quantity(step, "s", "simulate, step")
    if not 0 < seconds < np.inf:
        raise InputError.at("simulate", "a positive step in seconds", f"{step}", "correct it")
    return np.asarray(drive), seconds
