"""The sensor's zero of a stage that has rested, from a fit that counts from zero."""

from __future__ import annotations

import numpy as np

from .._models import Model
from .._simulate import simulate

_SAMPLES = 200
"""Samples over the recording at which a drive of zero is simulated; chosen by judgement."""


def settled_offset(model: Model, offset: float, history: str, duration: float) -> float:
    """What the sensor reads where the response is zero, for a stage at rest before it moves.

    With the history "rest" every law's own drive is zero before the recording.  A law whose
    response at zero is another one then sets off a transient in those after it, such as creep,
    which the fit's offset makes up for on average.

    Args:
        model: The fitted model.
        offset: The fit's offset [response].
        history: The fit's history.
        duration: That of its recording [s].

    Returns:
        The offset [response] for the history "constant".
    """
    if history != "rest":
        return offset
    zero, step = np.zeros(_SAMPLES), duration / _SAMPLES
    transient, rest = (simulate(model, zero, step, each).response for each in ("rest", "constant"))
    return offset + float(np.mean(transient - rest))
