r"""What a fit leaves over, put to the tests of MATLAB's `resid` and of PINTS' checklist.

All tests are on the residual whitened by the noise model, e, in units of the noise:

    white       autocorrelation r_e(k), 99 % bands ±2.58/√n; Q = n (n+2) Σ r_e(k)²/(n-k) ~ χ²_K
    of the drive    r_ue(k) = Σ u_t e_{t+k} / (n σ_u σ_e), k = -K … K, 99 % bands
                2.58 √(Σ_j r_u(j) r_e(j) / n); χ² of what the drives of K samples before and after
                explain
    normal      skewness and kurtosis (D'Agostino & Pearson)
    even        standard deviation in 20 stretches of time (Brown & Forsythe)

Sources: Ljung & Box, Biometrika 65 (1978) 297; Ljung, System Identification (1999) section 16.6;
D'Agostino & Pearson, Biometrika 60 (1973) 613; Brown & Forsythe, J. Am. Stat. Assoc. 69 (1974) 364.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2, kurtosis, levene, normaltest, skew

from .._computing import computing
from .._recording import require_kind
from ._fit import Fit

SCHEMA = "fracjax.residuals/1"
LAGS = 25
_BAND = 2.5758
_STRETCHES = 20
_LEVEL = 0.01
_RANK = 1e-6


@dataclass(frozen=True)
class ResidualAnalysis:
    """The whitened residual of one recording, of unit variance where the noise is all there is.

    `residual` (n,) at `times` [s]; `autocorrelation` (K,) at lags 1 … K [samples], within ± `band`
    99 % of the time where it is white; `cross_correlation` (2K+1,) with the drive at lags -K … K,
    its band `cross_band`; positive lags: the residual follows the drive.  `spreads` (20,) are
    standard deviations in stretches that end at `edges` (21,) [s].  The p-values are the chances of
    as much from noise alone.
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
        """What was found, a plain sentence for each test."""

        def told(p: float, good: str, bad: str) -> str:
            return (
                f"{good if p >= _LEVEL else bad} ({'p < 1e-12' if p < 1e-12 else f'p = {p:.2g}'})"
            )

        rms = float(np.sqrt(np.mean(self.residual**2)))
        return (
            f"The residual is {rms:.3g} times the noise",
            told(self.p_white, "It is white", "It is not white: neighbouring samples are alike"),
            told(
                self.p_drive,
                "It has nothing in common with the drive",
                "It goes with the drive: the model leaves out a part of the response",
            ),
            told(
                self.p_normal,
                "Its distribution is normal",
                f"Its distribution is not normal, of skewness {self.skewness:.2g} and excess "
                f"kurtosis {self.excess_kurtosis:.2g}",
            ),
            told(self.p_even, "It is even in time", "It is larger at some times than at others"),
        )

    def to_dict(self) -> dict:
        """Plain data, without the residual itself."""
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


def analyse_residuals(fit: Fit) -> tuple[ResidualAnalysis, ...]:
    """The tests for each of a fit's recordings, over the samples that count.

    They see the residual whitened by the noise, dimensionless: 1 is one standard deviation.
    """
    require_kind(fit, Fit, "fit", "fit a model first")
    with computing():
        problems = fit.preparation.problems()
        found = []
        for take, problem, residual in zip(
            fit.preparation.takes, problems, fit.residuals, strict=True
        ):
            padded = np.pad(residual, (0, len(problem.response) - len(residual)))
            size = len(take.recording)
            whitened = np.asarray(problem.whiten(padded))[:size]
            counted = np.asarray(problem.weights)[:size] > 0
            found.append(
                analysed(
                    whitened, counted, take.recording.drive, take.recording.dt,
                    take.recording.source,
                )
            )  # fmt: skip
    return tuple(found)


def analysed(
    whitened: np.ndarray, counted: np.ndarray, drive: np.ndarray, dt: float, source: str
) -> ResidualAnalysis:
    """The tests on a whitened residual (N,) where `counted` (N,), beside its drive (N,)."""
    used = whitened[counted]
    times = dt * np.flatnonzero(counted)
    lags = min(LAGS, used.size // 4)
    e = np.where(counted, whitened - used.mean(), 0.0)
    u = np.where(counted, drive - drive[counted].mean(), 0.0)
    autocorrelation = _correlation(e, e, lags)[lags + 1 :]
    n = used.size
    q = n * (n + 2) * np.sum(autocorrelation**2 / (n - np.arange(1, lags + 1)))
    wide = min(n // 4, 10 * lags)
    common = _correlation(u, u, wide) * _correlation(e, e, wide)
    edges = np.linspace(times[0], times[-1] + dt, _STRETCHES + 1)
    stretches = np.split(used, np.searchsorted(times + dt / 2, edges[1:-1]))
    return ResidualAnalysis(
        source=source,
        times=times,
        residual=used,
        autocorrelation=autocorrelation,
        band=float(_BAND / np.sqrt(n)),
        p_white=float(chi2.sf(q, lags)),
        cross_correlation=_correlation(u, e, lags),
        cross_band=float(_BAND * np.sqrt(max(common.sum(), 1e-3) / n)),
        p_drive=_explained(e, u, counted, lags),
        skewness=float(skew(used)),
        excess_kurtosis=float(kurtosis(used)),
        p_normal=float(normaltest(used).pvalue),
        edges=edges,
        spreads=np.array([part.std() if part.size else np.nan for part in stretches]),
        p_even=float(levene(*[p for p in stretches if p.size > 1], center="median").pvalue),
    )


def _correlation(a: np.ndarray, b: np.ndarray, lags: int) -> np.ndarray:
    """Σ a_t b_{t+k} / ‖a‖ ‖b‖ (2K+1,), k = -K … K."""
    size = 1 << int(np.ceil(np.log2(len(a) + lags + 1)))
    products = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    found = np.concatenate([products[-lags:], products[: lags + 1]])
    return found / (np.linalg.norm(a) * np.linalg.norm(b) + 1e-300)


def _explained(e: np.ndarray, u: np.ndarray, counted: np.ndarray, lags: int) -> float:
    """The chance of as much common to e and the drives around it, were e white.

    Of the drives shifted by -K … K samples, most of which are nearly alike, the directions that
    carry more than a millionth of the power of the first.
    """
    shifted = np.stack([np.roll(u, k) for k in range(-lags, lags + 1)], axis=1)
    shifted[~counted] = 0.0
    shifted[:lags] = shifted[len(u) - lags :] = 0.0  # what rolled in from the other end
    powers, directions = np.linalg.eigh(shifted.T @ shifted)
    strong = powers > _RANK * powers[-1]
    inside = counted.copy()
    inside[:lags] = inside[len(u) - lags :] = False
    share = directions[:, strong].T @ (shifted.T @ np.where(inside, e, 0.0))
    q = np.sum(share**2 / powers[strong]) / np.var(e[inside])
    return float(chi2.sf(q, np.count_nonzero(strong)))
