"""What an inverse promises: its error by frequency and amplitude, before it drives anything."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._models import Model
from .._show import figure, quantity
from .._simulate import simulate

_CYCLES = (1, 4, 12, 40, 120)
"""Cycles in half of the samples: from 2.5 % of the band's usual upper end to three times it."""
_HEIGHTS = (0.8, 0.4, 0.1)
"""Heights of the sines as shares of the stroke at rest between the limits; chosen by judgement."""
_SAMPLES = 4000
"""Samples of each sine, of which the second half counts."""


class Promised(NamedTuple):
    """The error along one sine, simulated by the whole model.

    Attributes:
        frequency: [Hz].
        height: Peak to peak [response].
        error: Predicted minus desired, rms by the height, dimensionless.
        limited: The share of samples at which a limit of the drive binds.
    """

    frequency: float
    height: float
    error: float
    limited: float


def promised(
    drive: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    model: Model,
    step: float,
    offset: float,
    ends: tuple[float, float],
) -> list[Promised]:
    """The error along sines between two responses [response], by the model off the loop, with none
    of the stream's approximations.  `drive` gives drive (N,) and flags (N,) for a motion (N,)."""
    middle, stroke, rows = sum(ends) / 2, abs(ends[1] - ends[0]), []
    half = _SAMPLES // 2
    for cycles in _CYCLES:
        phase = 2 * np.pi * cycles * np.arange(_SAMPLES) / half
        for height in _HEIGHTS:
            desired = middle - height * stroke / 2 * np.cos(phase)
            output, flags = drive(desired)
            simulated = simulate(model, output, step, "constant").response
            error = (simulated + offset - desired)[half:]
            rows.append(
                Promised(
                    cycles / (half * step),
                    height * stroke,
                    float(np.sqrt(np.mean(error**2)) / (height * stroke)),
                    float(np.mean(flags[half:] != 0)),
                )
            )
    return rows


def promise_table(rows: list[Promised], unit: str) -> tuple[list[str], list[list[str]]]:
    """The errors as a table: frequencies down, heights across."""
    heights = list(dict.fromkeys(row.height for row in rows))
    headers = ["error, rms by the height", *(quantity(height, unit) for height in heights)]
    cells: dict[float, list[str]] = {}
    for row in rows:
        limit = f", {figure(100 * row.limited)} % of it at a limit" if row.limited else ""
        cells.setdefault(row.frequency, []).append(f"{figure(100 * row.error)} %{limit}")
    return headers, [[quantity(rate, "Hz"), *texts] for rate, texts in cells.items()]
