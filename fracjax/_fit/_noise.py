"""The noise floor of a recording and its colour, from the first source that applies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solve_toeplitz

from .._recording import InputError, Recording

Method = Literal["repeats", "static", "specification", "residual"]
_LARGEST_ORDER = 12
_REST_SECONDS = 0.2


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: Σ_k filter[k] e_{t-k} = innovation · white, filter[0] = 1.

    `sigma` is its standard deviation in `unit`, `method` where it was read.
    """

    sigma: float
    unit: str
    method: Method
    filter: np.ndarray
    innovation: float

    @property
    def whitening(self) -> np.ndarray:
        """The filter that turns this noise into white noise of unit variance."""
        return self.filter / self.innovation


def autoregression(series: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """AR(p) filter and innovation sd of one or more stretches of noise, p by BIC (Yule–Walker)."""
    count = sum(s.size for s in series)
    largest = min(_LARGEST_ORDER, count // 20)
    autocovariance = np.array(
        [sum(float(s[k:] @ s[: s.size - k]) for s in series) / count for k in range(largest + 1)]
    )
    best, best_score = (np.ones(1), float(np.sqrt(autocovariance[0]))), count * np.log(
        autocovariance[0]
    )
    for order in range(1, largest + 1):
        coefficients = solve_toeplitz(autocovariance[:order], autocovariance[1 : order + 1])
        variance = autocovariance[0] - coefficients @ autocovariance[1 : order + 1]
        score = count * np.log(variance) + order * np.log(count)
        if score < best_score:
            best = np.concatenate([[1.0], -coefficients]), float(np.sqrt(variance))
            best_score = score
    return best


def _noise(series: list[np.ndarray], unit: str, method: Method) -> Noise:
    coefficients, innovation = autoregression(series)
    sigma = float(np.sqrt(np.mean(np.concatenate(series) ** 2)))
    return Noise(sigma, unit, method, coefficients, innovation)


def _from_repeats(recording: Recording) -> list[np.ndarray]:
    """Differences of successive periods /√2, where neither is still settling."""
    repeats = recording.drive_period()
    if repeats is None:
        return []
    response = recording.response[repeats.start : repeats.stop]
    difference = (response[repeats.period :] - response[: -repeats.period]) / np.sqrt(2)
    periods = difference[: difference.size // repeats.period * repeats.period]
    periods = periods.reshape(-1, repeats.period)
    spread = periods.std(axis=1)
    settled = int(np.argmax(spread <= 1.2 * np.median(spread)))
    kept = difference[settled * repeats.period :]
    return [kept - kept.mean()]


def _from_static(recording: Recording) -> list[np.ndarray]:
    """Rests with their slow motion (a parabola) taken off, the first fifth left out."""
    stretches = []
    for start, stop in recording.static_stretches(_REST_SECONDS):
        begin = start + (stop - start) // 5
        y = recording.response[begin:stop]
        x = np.linspace(-1, 1, y.size)
        stretches.append(y - np.polynomial.Polynomial.fit(x, y, 2)(x))
    return stretches


def measured_noise(
    recording: Recording, repeat: Recording | None = None, specification: float | None = None
) -> Noise | None:
    """Noise from repeated periods, a repeat recording, a rest, or the sensor's specification.

    None where the recording offers no source; then only the residual of a fit is left.
    """
    unit = recording.response_unit
    if repeat is not None:
        if len(repeat) != len(recording) or not np.allclose(
            repeat.drive, recording.drive, atol=1e-2 * np.ptp(recording.drive)
        ):
            raise InputError(
                f"{repeat.source}: expected a repeat with the drive of {recording.source} "
                f"({len(recording)} samples), found another drive ({len(repeat)} samples); "
                "record the same drive twice"
            )
        difference = (repeat.response - recording.response) / np.sqrt(2)
        return _noise([difference - difference.mean()], unit, "repeats")
    if series := _from_repeats(recording):
        return _noise(series, unit, "repeats")
    if series := _from_static(recording):
        return _noise(series, unit, "static")
    if specification is not None:
        return Noise(specification, unit, "specification", np.ones(1), specification)
    return None


def residual_noise(residual: np.ndarray, unit: str) -> Noise:
    """The last resort: what a fit left over, taken as noise, mismatch and all."""
    return _noise([residual - residual.mean()], unit, "residual")
