"""The noise floor of a recording and its colour, from the first source that applies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.signal import lfilter
from scipy.stats import kurtosis

from .._recording import InputError, Recording

Method = Literal["repeats", "static", "specification", "residual"]
_LARGEST_ORDER = 12
_REST_SECONDS = 0.2
# Successive second differences have the correlations -2/3 and 1/6: 1 + 2 Σ ρ² ≈ 2.
_SHARED = 2.0


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: Σ_k filter[k] e_{t-k} = innovation · white, filter[0] = 1.

    `sigma` is the rms of all that does not repeat, in `unit`; `method` says where it was read.  The
    filter leaves lines of the mains out, so that they count as mismatch and can be named.
    It was read from `effective` independent samples, of this `kurtosis`: a floor read from a short
    rest, or from noise with heavy tails, is known less well than the recording's length suggests.
    `lines`: frequencies [1/sample] and power (n,) of the whitened noise, 1 where the filter fits,
    each as good as 2/`shared` degrees of freedom.
    """

    sigma: float
    unit: str
    method: Method
    filter: np.ndarray
    innovation: float
    effective: float = np.inf
    kurtosis: float = 3.0
    lines: tuple[np.ndarray, np.ndarray] = (np.zeros(0), np.zeros(0))
    shared: float = 1.0

    def doubt(self, kurtosis: float = 3.0) -> float:
        """The relative standard error of the variance, with the heavier of both tails."""
        return float(np.sqrt((max(kurtosis, self.kurtosis) - 1) / self.effective))

    @property
    def whitening(self) -> np.ndarray:
        """The filter that turns this noise into white noise of unit variance."""
        return self.filter / self.innovation


def _autocovariance(series: np.ndarray, lags: int) -> np.ndarray:
    """Autocovariance (lags+1,) from a spectrum smoothed by a running median, so that lines of the
    mains, which are no noise but interference, do not count."""
    power = np.abs(np.fft.rfft(series)) ** 2 / series.size
    power[0] = power[1]
    width = 2 * (max(power.size // 40, 5)) + 1
    # Periodogram values are exponentially distributed: their median is ln 2 of their mean.
    smooth = median_filter(power, min(width, power.size), mode="nearest") / np.log(2)
    return np.fft.irfft(smooth, series.size)[: lags + 1]


def autoregression(series: list[np.ndarray]) -> tuple[np.ndarray, float]:
    """AR(p) filter and innovation sd of one or more stretches, p by BIC (Yule–Walker)."""
    count = sum(s.size for s in series)
    largest = min(_LARGEST_ORDER, min(s.size for s in series) // 20)
    weights = [s.size / count for s in series]
    autocovariance = np.sum(
        [w * _autocovariance(s, largest) for w, s in zip(weights, series, strict=True)], axis=0
    )
    best, best_score = (
        (np.ones(1), float(np.sqrt(autocovariance[0]))),
        count * np.log(autocovariance[0]),
    )
    for order in range(1, largest + 1):
        coefficients = solve_toeplitz(autocovariance[:order], autocovariance[1 : order + 1])
        variance = autocovariance[0] - coefficients @ autocovariance[1 : order + 1]
        score = count * np.log(variance) + order * np.log(count)
        if score < best_score:
            best = np.concatenate([[1.0], -coefficients]), float(np.sqrt(variance))
            best_score = score
    return best


def _noise(series: list[np.ndarray], unit: str, method: Method, shared: float = 1.0) -> Noise:
    """Noise from stretches that hold nothing else; `shared`: how many of their samples hold the
    same noise."""
    coefficients, innovation = autoregression(series)
    sigma = float(np.sqrt(np.mean(np.concatenate(series) ** 2)))
    taps = coefficients / innovation
    stretches = [np.asarray(lfilter(taps, 1.0, s))[taps.size - 1 :] for s in series]
    white = np.concatenate(stretches)
    tails = max(float(kurtosis(white, fisher=False)), 3.0)
    spectra = [
        (np.fft.rfftfreq(w.size)[1:], np.abs(np.fft.rfft(w))[1:] ** 2 / w.size) for w in stretches
    ]
    frequencies, power = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
    return Noise(
        sigma,
        unit,
        method,
        coefficients,
        innovation,
        effective=white.size / shared,
        kurtosis=tails,
        lines=(frequencies, power),
        shared=shared,
    )


def _from_repeats(recording: Recording, counts: np.ndarray | None) -> list[np.ndarray]:
    """Second differences over successive periods /√6, once the response has settled.

    A first difference would still hold the slow decay of the actuator's memory of its start; the
    second keeps only what is new in each period.  Those with samples of weight 0 are left out.
    """
    repeats = recording.drive_period()
    if repeats is None:
        return []
    period = repeats.period
    y = recording.response[repeats.start : repeats.stop]
    difference = (y[2 * period :] - 2 * y[period:-period] + y[: -2 * period]) / np.sqrt(6)
    # Period by period: across periods a difference has a comb for its spectrum, noise has none.
    blocks = difference[: difference.size // period * period].reshape(-1, period)
    if counts is not None:
        good = counts[repeats.start : repeats.stop] > 0
        clean = good[2 * period :] & good[period:-period] & good[: -2 * period]
        blocks = blocks[clean[: blocks.size].reshape(-1, period).all(axis=1)]
        if not len(blocks):
            return []
    spread = blocks.std(axis=1)
    settled = int(np.argmax(spread <= 1.2 * np.median(spread)))
    return list(blocks[settled:] - blocks[settled:].mean())


def _from_static(recording: Recording, counts: np.ndarray | None) -> list[np.ndarray]:
    """Rests without the actuator's slow relaxation: a parabola and logarithms of time taken off.

    Those with samples of weight 0 are left out."""
    stretches = []
    for start, stop in recording.static_stretches(_REST_SECONDS):
        begin = start + (stop - start) // 10
        if counts is not None and not np.all(counts[begin:stop]):
            continue
        y = recording.response[begin:stop]
        x = np.linspace(0, 1, y.size)
        slow = np.stack([np.ones_like(x), x, x**2, np.log(x + 0.02), np.log(x + 0.2)], axis=1)
        stretches.append(y - slow @ np.linalg.lstsq(slow, y, rcond=None)[0])
    return stretches


def measured_noise(
    recording: Recording,
    repeat: Recording | None = None,
    specification: float | None = None,
    counts: np.ndarray | None = None,
) -> Noise | None:
    """Noise from repeated periods, a repeat recording, a rest, or the sensor's specification.

    Periods and rests where the weights `counts` (N,) are 0 are not looked at.  None where the
    recording offers no source; then only the residual of a fit is left.
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
    if series := _from_repeats(recording, counts):
        return _noise(series, unit, "repeats", _SHARED)
    if series := _from_static(recording, counts):
        return _noise(series, unit, "static")
    if specification is not None:
        return Noise(specification, unit, "specification", np.ones(1), specification)
    return None


def residual_noise(residual: np.ndarray, unit: str) -> Noise:
    """The last resort: what a fit left over, taken as noise, mismatch and all."""
    return _noise([residual - residual.mean()], unit, "residual")
