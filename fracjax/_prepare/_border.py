"""The border of the public functions: what a call gives, or one sentence that says why not."""

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
from ._preparation import settling_samples
from ._setting import setting_of

PASTS = (*HISTORIES, "estimated")


def recordings_of(
    given: Recording | Iterable[Recording], where: str = "recording"
) -> list[Recording]:
    """One recording or several, as a list.  Raises InputError."""
    listed = [given] if isinstance(given, Recording | str) else _listed(given)
    for k, recording in enumerate(listed):
        require_recording(recording, f"{where} {k + 1}" if len(listed) > 1 else where)
    if not listed:
        raise InputError("expected at least one recording, found none; give one")
    return listed


def _listed(given: Any) -> list:
    try:
        return list(given)
    except TypeError:
        return [given]


def require_recording(given: Recording, where: str) -> None:
    """Raise InputError where something is no recording."""
    require_kind(given, Recording, where, "read a file by fracjax.read(path) first")


def model_of(given: Model | str, recordings: list[Recording]) -> Model:
    """A model, or that of a name, its effects of a size that suits the recordings.  Raises
    InputError."""
    return as_model(given, setting_of(recordings) if isinstance(given, str) else None)


def whole(given: int, where: str, least: int) -> int:
    """A whole number.  Raises InputError."""
    if not isinstance(given, numbers.Integral) or isinstance(given, bool) or given < least:
        raise InputError.at(where, f"a whole number from {least} on", found_in(given), "correct it")
    return int(given)


def past_of(given: str | None) -> Any:
    """A history, None where the data shall decide.  Raises InputError."""
    if given is not None and given not in PASTS:
        raise InputError.at(
            "history", f"one of {', '.join(PASTS)}, or None", found_in(given), "correct it"
        )
    return given


def settling_of(given: int | str | None, recording: Recording) -> int | None:
    """Samples of a recording to leave out, from their number or a time such as "1 s".  Raises
    InputError where too few, or none, would be left."""
    if given is None:
        return None
    if isinstance(given, str):
        return settling_samples(given, recording)
    most = len(recording) - MINIMUM_SAMPLES
    if whole(given, "settling", 0) > most:
        raise InputError.at("settling", f"at most {most} samples", f"{given}", "shorten it")
    return int(given)


def sigma_of(given: float | str | None, unit: str) -> float | None:
    """The sensor's noise [unit, rms], from a number or a text such as "0.07 um".  Raises
    InputError."""
    if given is None:
        return None
    sigma = math.nan
    if isinstance(given, str | numbers.Real) and not isinstance(given, bool):
        sigma = parse_quantity(given, unit, "noise") if isinstance(given, str) else float(given)
    if not 0 < sigma < math.inf:
        raise InputError.at(
            "noise", f'a number above 0, in {unit}, or a text such as "0.07 {unit}"',
            found_in(given), "give the sensor's noise, rms",
        )  # fmt: skip
    return sigma
