"""Checks of the arguments of public functions: the value, or one sentence that names the error."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable
from typing import Any

from .._models import Model, as_model
from .._operators import HISTORIES
from .._recording import (
    MINIMUM_SAMPLES,
    InputError,
    Recording,
    found_in,
    parse_quantity,
    require_kind,
)
from ._setting import setting_of
from ._take import settling_samples

HISTORY_OPTIONS = (*HISTORIES, "estimated")
"""The histories that a call can choose."""


def recordings_of(
    recordings: Recording | Iterable[Recording], where: str = "recording"
) -> list[Recording]:
    """One recording or several, as a list of at least one.  Raises InputError."""
    listed = [recordings] if isinstance(recordings, Recording | str) else _listed(recordings)
    for k, recording in enumerate(listed):
        require_recording(recording, f"{where} {k + 1}" if len(listed) > 1 else where)
    if not listed:
        raise InputError("expected at least one recording, found none; give one")
    return listed


def _listed(value: Any) -> list:
    """The items of an iterable, or the value itself as the only item."""
    try:
        return list(value)
    except TypeError:
        return [value]


def require_recording(value: Recording, where: str) -> None:
    """Raise InputError where a value is no recording."""
    require_kind(value, Recording, where, "read a file by fracjax.read(path) first")


def model_of(model: Model | str, recordings: list[Recording]) -> Model:
    """A model, or the model of a name with effects sized for the recordings.  Raises InputError."""
    return as_model(model, setting_of(recordings) if isinstance(model, str) else None)


def require_whole_number(value: int, where: str, least: int) -> int:
    """A whole number of at least `least`.  Raises InputError."""
    if not isinstance(value, numbers.Integral) or isinstance(value, bool) or value < least:
        raise InputError.at(where, f"a whole number from {least} on", found_in(value), "correct it")
    return int(value)


def history_of(history: str | None) -> Any:
    """A history, or None where the data decide.  Raises InputError."""
    if history is not None and history not in HISTORY_OPTIONS:
        raise InputError.at(
            "history",
            f"one of {', '.join(HISTORY_OPTIONS)}, or None",
            found_in(history),
            "correct it",
        )
    return history


def settling_of(settling: int | str | None, recording: Recording) -> int | None:
    """The number of samples to leave out at a recording's start, from a number or a time such as "1
    s".

    Raises InputError where too few samples would remain.
    """
    if settling is None:
        return None
    if isinstance(settling, str):
        return settling_samples(settling, recording)
    largest = len(recording) - MINIMUM_SAMPLES
    if require_whole_number(settling, "settling", 0) > largest:
        raise InputError.at("settling", f"at most {largest} samples", f"{settling}", "shorten it")
    return int(settling)


def sigma_of(noise: float | str | None, unit: str) -> float | None:
    """The sensor's noise [unit, rms], from a number or a text such as "0.07 um".

    Raises InputError where it is not above 0.
    """
    if noise is None:
        return None
    sigma = math.nan
    if isinstance(noise, str | numbers.Real) and not isinstance(noise, bool):
        sigma = parse_quantity(noise, unit, "noise") if isinstance(noise, str) else float(noise)
    if not 0 < sigma < math.inf:
        raise InputError.at(
            "noise", f'a number above 0, in {unit}, or a text such as "0.07 {unit}"',
            found_in(noise), "give the sensor's noise, rms",
        )  # fmt: skip
    return sigma
