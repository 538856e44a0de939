"""What an inverse promises: its error by frequency and amplitude, before it drives anything."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from .._compensate import changes_by_draws
from .._models import Model
from .._show import Shown, Table, View, figure, quantity
from .._simulate import simulate

_CYCLES = (1, 4, 12, 40, 120)
"""Cycles in half of the samples: from 2.5 % of the band's usual upper end to three times it."""
_HEIGHTS = (0.8, 0.4, 0.1)
"""Heights of the sines as shares of the stroke at rest between the limits; chosen by judgement."""
_SAMPLES = 4000
"""Samples of each sine, of which the second half counts."""
_DRAWS, _ENDS = 40, (5.0, 95.0)
"""Most draws of the parameters, and the ends of the interval [%], which then rest on two draws
each; chosen by judgement."""


@dataclass(frozen=True)
class Promised:
    """The error along one sine.

    Attributes:
        frequency: [Hz].
        height: Peak to peak [response].
        linear: The error that the linear parts' difference equations promise at this frequency, as
            a share of a sine's rms by its height, dimensionless.
        error: Simulated by the whole model off the loop, with none of the stream's approximations:
            predicted minus desired, rms by the height, dimensionless.
        interval: The central 90 % of that error over draws of the parameters, apart from a constant
            offset; None without draws.
        limited: The share of samples at which a limit of the drive binds.
    """

    frequency: float
    height: float
    linear: float
    error: float
    interval: tuple[float, float] | None
    limited: float


@dataclass(frozen=True, repr=False)
class Promise(Shown):
    """The errors to expect of an inverse in a loop, and where it must fail.

    Attributes:
        model: Name of the model.
        unit: Unit of the response.
        step: The loop's time step [s].
        rows: The error along each sine.
        failures: Sentences on where it must fail.
    """

    model: str
    unit: str
    step: float
    rows: tuple[Promised, ...]
    failures: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The least and the largest error where no limit binds, in words."""
        free = [row for row in self.rows if not row.limited] or list(self.rows)
        best, worst = (choose(free, key=lambda row: row.error) for choose in (min, max))
        return (
            f"In a loop of {quantity(self.step, 's')} the inverse of {self.model} misses a sine by "
            f"{_share(best.error)} (at {quantity(best.frequency, 'Hz')}) to {_share(worst.error)} "
            f"(at {quantity(worst.frequency, 'Hz')}) of its height, rms, by the model."
        )

    def table(self) -> tuple[list[str], list[list[str]]]:
        """The errors as a table.

        Returns:
            Its headers and rows: frequencies down, heights across.
        """
        heights = dict.fromkeys(row.height for row in self.rows)
        headers = ["error, rms by the height", "promised by the linear parts"]
        headers += [f"simulated, {quantity(height, self.unit)}" for height in heights]
        cells: dict[float, list[str]] = {}
        for row in self.rows:
            linear = [_share(row.linear)]
            cells.setdefault(row.frequency, linear).append(_cell(row))
        return headers, [[quantity(rate, "Hz"), *texts] for rate, texts in cells.items()]

    def to_dict(self) -> dict[str, Any]:
        """The promise as plain data.

        Returns:
            The content by key.
        """
        return asdict(self)

    def _view(self) -> View:
        return View(self.sentence, [Table(*self.table())], self.failures)


def _share(error: float) -> str:
    return f"{figure(100 * error)} %"


def _cell(row: Promised) -> str:
    """The simulated error with its interval, and how often a limit binds."""
    text = _share(row.error)
    if row.interval is not None:
        text += f" ({figure(100 * row.interval[0])} to {figure(100 * row.interval[1])} %)"
    return text + (f", {figure(100 * row.limited)} % of it at a limit" if row.limited else "")


class Sine(NamedTuple):
    """What an inverse makes of a motion: drive and flags, each (N,)."""

    drive: np.ndarray
    flags: np.ndarray


def promised(
    drive: Callable[[np.ndarray], Sine],
    linear: Callable[[np.ndarray], np.ndarray],
    model: Model,
    step: float,
    ends: tuple[float, float],
    draws: Mapping[str, np.ndarray] | None,
) -> tuple[Promised, ...]:
    """The errors along sines between two responses [response], with the model's zero at 0.

    `drive` gives drive and flags for a motion (N,), `linear` the relative error of the linear parts
    at frequencies (F,) [Hz]; the draws are values (D,) of the parameters by name.
    """
    middle, stroke, rows = sum(ends) / 2, abs(ends[1] - ends[0]), []
    half = _SAMPLES // 2
    frequencies = np.array(_CYCLES) / (half * step)
    for cycles, frequency, relative in zip(_CYCLES, frequencies, linear(frequencies), strict=True):
        phase = 2 * np.pi * cycles * np.arange(_SAMPLES) / half
        for height in (share * stroke for share in _HEIGHTS):
            desired = middle - height / 2 * np.cos(phase)
            output, flags = drive(desired)
            response = np.asarray(simulate(model, output, step, "constant").response)
            error = (response - desired)[half:]
            interval = None
            if draws is not None:
                changed = changes_by_draws(model.block, draws, output, step, _DRAWS)[:, half:]
                moved = error + changed - changed.mean(axis=1, keepdims=True)
                low, high = np.percentile(_rms(moved) / height, _ENDS)
                interval = float(low), float(high)
            rows.append(
                Promised(
                    float(frequency),
                    float(height),
                    # A sine's rms is its height by √8.
                    float(relative / np.sqrt(8)),
                    float(_rms(error) / height),
                    interval,
                    float(np.mean(flags[half:] != 0)),
                )
            )
    return tuple(rows)


def _rms(error: np.ndarray) -> np.ndarray:
    """The rms along the last axis."""
    return np.sqrt(np.mean(error**2, axis=-1))


def draws_of(
    parameters: Mapping[str, Mapping[str, Any]], correlation: np.ndarray
) -> dict[str, np.ndarray]:
    """Draws (D,) of a fit's parameters by name, from their standard errors and correlation (n, n).

    A parameter whose interval leaves out zero keeps its sign: its logarithm is drawn.  One without
    a standard error stays as it is.
    """
    spread, turns = np.linalg.eigh(np.asarray(correlation))
    root = turns * np.sqrt(np.maximum(spread, 0.0))
    normal = np.random.default_rng(0).standard_normal((_DRAWS, spread.size)) @ root.T
    draws = {}
    for (name, one), z in zip(parameters.items(), normal.T, strict=True):
        value, error = one["value"], one["standard_error"]
        if error is None or not np.isfinite(error):
            draws[name] = np.full(_DRAWS, value)
        elif one["low"] > 0 or one["high"] < 0:
            draws[name] = value * np.exp(z * error / abs(value))
        else:
            draws[name] = value + z * error
    return draws
