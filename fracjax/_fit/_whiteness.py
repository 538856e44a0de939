"""Tests of a fit's residual, as in MATLAB's `resid` and PINTS' checklist.

All tests are on the residual whitened by the noise model, e, in units of the noise:

    white       autocorrelation r_e(k), 99 % bands ±2.58/√n; Q = n (n+2) Σ r_e(k)²/(n-k) ~ χ²_K
    drive       r_ue(k) = Σ u_t e_{t+k} / (n σ_u σ_e), k = -K … K, 99 % bands
                2.58 √(Σ_j r_u(j) r_e(j) / n); χ² of the part that the drives of K samples before
                and after explain
    normal      skewness and kurtosis (D'Agostino & Pearson)
    even        standard deviation in 20 stretches of time (Brown & Forsythe)

Sources: Ljung & Box, Biometrika 65 (1978) 297; Ljung, System Identification (1999) section 16.6;
    D'Agostino & Pearson, Biometrika 60 (1973) 613; Brown & Forsythe, J. Am. Stat. Assoc. 69 (1974)
    364.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtrc

from .._computing import computing
from .._prepare import Preparation
from .._show import Shown, View
from ._distribution import excess_kurtosis, p_of_equal_spread, p_of_normality, skewness

if TYPE_CHECKING:
    from .._show.drawing import Drawing

SCHEMA = "fracjax.residuals/1"
LAGS = 25
"""Largest lag K [samples], as in MATLAB's `resid`."""
_BINS = 41
"""Edges of the histogram's bins."""
_WIDEST = 5.0
"""The histogram ends at most at so many standard deviations, or at 4 if that is more."""
_BAND = 2.5758
"""99 % of a standard normal variable are within ± this."""
_STRETCHES = 20
"""Stretches of time.  Chosen by judgement."""
_SIGNIFICANCE = 0.01
"""p-value below which a test fails, as the 99 % bands."""
_LEAST_POWER = 1e-6
"""Least power of a direction of the shifted drives, as a share of the largest."""


@dataclass(frozen=True, repr=False)
class ResidualAnalysis(Shown):
    """The tests of one recording's whitened residual, of unit variance where it is noise only.

    A p-value is the probability that noise alone deviates as much.

    Attributes:
        source: the recording's name.
        times: (n,) [s].
        residual: (n,) in units of the noise.
        autocorrelation: (K,) at lags 1 … K [samples], dimensionless.
        band: the autocorrelation of white noise is within ± band with 99 % probability.
        p_white: p-value of whiteness.
        cross_correlation: (2K+1,) with the drive at lags -K … K, dimensionless; at positive lags
            the residual follows the drive.
        cross_band: the same for the cross-correlation.
        p_drive: p-value of independence of the drive.
        skewness: dimensionless, 0 for normal noise.
        excess_kurtosis: dimensionless, 0 for normal noise.
        p_normal: p-value of a normal distribution.
        edges: (21,) the limits of the stretches [s].
        spreads: (20,) standard deviations in the stretches, in units of the noise.
        p_even: p-value of equal standard deviations.

    Sources: Ljung & Box, Biometrika 65 (1978) 297; Ljung, System Identification (1999) section
        16.6; D'Agostino & Pearson, Biometrika 60 (1973) 613; Brown & Forsythe, J. Am. Stat. Assoc.
        69 (1974) 364.
    """

    source: str
    times: np.ndarray
    residual: np.ndarray
    autocorrelation: np.ndarray
    band: float
    p_white: float
    cross_correlation: np.ndarray
    cross_band: float
    p_drive: float
    skewness: float
    excess_kurtosis: float
    p_normal: float
    edges: np.ndarray
    spreads: np.ndarray
    p_even: float

    @property
    def findings(self) -> tuple[str, ...]:
        """The result of each test, as a sentence."""

        def sentence(p: float, good: str, bad: str) -> str:
            chance = "p < 1e-12" if p < 1e-12 else f"p = {p:.2g}"
            return f"{good if p >= _SIGNIFICANCE else bad} ({chance})"

        # How large it is beside the noise is said of the fit.
        return (
            sentence(
                self.p_white,
                "The residual is white",
                "The residual is not white: neighbouring samples are correlated",
            ),
            sentence(
                self.p_drive,
                "It is not correlated with the drive",
                "It is correlated with the drive: the model misses a part of the response",
            ),
            sentence(
                self.p_normal,
                "Its distribution is normal",
                f"Its distribution is not normal: its skewness is {self.skewness:.2g} and its "
                f"excess kurtosis {self.excess_kurtosis:.2g}",
            ),
            sentence(
                self.p_even,
                "Its standard deviation is constant",
                "Its standard deviation varies with time",
            ),
        )

    def _view(self) -> View:
        sentences = ". ".join(self.findings)
        return View(f"Residual of {self.source}, {self.residual.size} samples: {sentences}.")

    def plot(self) -> Drawing:
        """Draw the tests: histogram, both correlations, and the level over time.

        Returns:
            A matplotlib figure, the residual in units of the noise.
        """
        from ._pictures import draw_residual_tests

        return draw_residual_tests(
            self.histogram(),
            (self.autocorrelation, self.band),
            (self.cross_correlation, self.cross_band),
            (self.spreads, self.edges, self.spread_band()),
        )

    def histogram(self) -> tuple[np.ndarray, np.ndarray]:
        """The residual's distribution.

        Returns:
            The edges (K+1,) of bins, in units of the noise, and the densities (K,) in them; what
            lies beyond the ends is in the outermost bins.
        """
        deviation = self.residual.std()
        width = float(np.clip(np.abs(self.residual).max(), 4, _WIDEST * deviation))
        edges = np.linspace(-width, width, _BINS)
        clipped = np.clip(self.residual, -width, width)
        return edges, np.histogram(clipped, edges, density=True)[0]

    def spread_band(self) -> tuple[float, float]:
        """Where the standard deviations in the stretches are with 99 % probability.

        Returns:
            Both ends of the band, in units of the noise.
        """
        level = float(np.sqrt(np.mean(self.residual**2)))
        reach = level * _BAND / float(np.sqrt(2 * self.residual.size / self.spreads.size))
        return level - reach, level + reach

    def to_dict(self) -> dict:
        """The tests as plain data, without the residual itself.

        Returns:
            The attributes by name, and the findings.
        """
        return {
            "schema": SCHEMA,
            "source": self.source,
            "samples": self.residual.size,
            "rms_over_noise": float(np.sqrt(np.mean(self.residual**2))),
            "autocorrelation": self.autocorrelation.tolist(),
            "band": self.band,
            "p_white": self.p_white,
            "cross_correlation": self.cross_correlation.tolist(),
            "cross_band": self.cross_band,
            "p_drive": self.p_drive,
            "skewness": self.skewness,
            "excess_kurtosis": self.excess_kurtosis,
            "p_normal": self.p_normal,
            "edges_s": self.edges.tolist(),
            "spreads": self.spreads.tolist(),
            "p_even": self.p_even,
            "findings": list(self.findings),
        }


def analyses_of(
    preparation: Preparation, residuals: Sequence[np.ndarray]
) -> tuple[ResidualAnalysis, ...]:
    """The tests of the residual (N,) [response unit] of each recording, whitened by its noise."""
    with computing():
        problems = preparation.problems()
        analyses = []
        for take, problem, residual in zip(preparation.takes, problems, residuals, strict=True):
            padded = np.pad(residual, (0, len(problem.response) - len(residual)))
            recording = take.recording
            size = len(recording)
            whitened = np.asarray(problem.whiten(padded))[:size]
            counted = np.asarray(problem.weights)[:size] > 0
            analyses.append(
                analyse_whitened(whitened, counted, recording.drive, recording.dt, recording.source)
            )
    return tuple(analyses)


def analyse_whitened(
    whitened: np.ndarray, counted: np.ndarray, drive: np.ndarray, dt: float, source: str
) -> ResidualAnalysis:
    """The tests on a whitened residual (N,) where `counted` (N,) is true, and its drive (N,)."""
    used = whitened[counted]
    times = dt * np.flatnonzero(counted)
    lags = min(LAGS, used.size // 4)
    e = np.where(counted, whitened - used.mean(), 0.0)
    u = np.where(counted, drive - drive[counted].mean(), 0.0)
    autocorrelation = _correlation(e, e, lags)[lags + 1 :]
    n = used.size
    q = n * (n + 2) * np.sum(autocorrelation**2 / (n - np.arange(1, lags + 1)))
    band_lags = min(n // 4, 10 * lags)
    products = _correlation(u, u, band_lags) * _correlation(e, e, band_lags)
    edges = np.linspace(times[0], times[-1] + dt, _STRETCHES + 1)
    stretches = np.split(used, np.searchsorted(times + dt / 2, edges[1:-1]))
    return ResidualAnalysis(
        source=source,
        times=times,
        residual=used,
        autocorrelation=autocorrelation,
        band=float(_BAND / np.sqrt(n)),
        p_white=float(chdtrc(lags, q)),
        cross_correlation=_correlation(u, e, lags),
        cross_band=float(_BAND * np.sqrt(max(products.sum(), 1e-3) / n)),
        p_drive=_explained(e, u, counted, lags),
        skewness=skewness(used),
        excess_kurtosis=excess_kurtosis(used),
        p_normal=p_of_normality(used),
        edges=edges,
        spreads=np.array([part.std() if part.size else np.nan for part in stretches]),
        p_even=p_of_equal_spread([part for part in stretches if part.size > 1]),
    )


def _correlation(a: np.ndarray, b: np.ndarray, lags: int) -> np.ndarray:
    """Σ a_t b_{t+k} / ‖a‖ ‖b‖ (2K+1,), k = -K … K."""
    size = 1 << int(np.ceil(np.log2(len(a) + lags + 1)))
    products = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    sums = np.concatenate([products[-lags:], products[: lags + 1]])
    return sums / (np.linalg.norm(a) * np.linalg.norm(b) + 1e-300)


def _explained(e: np.ndarray, u: np.ndarray, counted: np.ndarray, lags: int) -> float:
    """The probability that white e has as much in common with the drives around it.

    The drives shifted by -K … K samples are nearly alike, so that only directions with more than a
    millionth of the largest power count.
    """
    shifted = np.stack([np.roll(u, k) for k in range(-lags, lags + 1)], axis=1)
    shifted[~counted] = 0.0
    shifted[:lags] = shifted[len(u) - lags :] = 0.0  # samples from the other end
    powers, directions = np.linalg.eigh(shifted.T @ shifted)
    strong = powers > _LEAST_POWER * powers[-1]
    inside = counted.copy()
    inside[:lags] = inside[len(u) - lags :] = False
    share = directions[:, strong].T @ (shifted.T @ np.where(inside, e, 0.0))
    q = np.sum(share**2 / powers[strong]) / np.var(e[inside])
    return float(chdtrc(np.count_nonzero(strong), q))
