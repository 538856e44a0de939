"""The colour of noise: an autoregression of stretches from which slow terms were removed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import median_filter

from .._filters import moving_sum, solve_recursion

_LARGEST_ORDER = 12
"""Largest order: the whitening filter of a problem has 13 taps."""
_LEAST_PER_ORDER = 20
"""Samples of the shortest stretch per order, chosen by judgement."""
_PASSES = 8
"""At most so many passes of smoothing, chosen by judgement; most noises converge earlier."""
_CONVERGED = 0.01
"""The passes end when the autocovariance changes by less than this share of the variance."""
_WHITE_SHARE = 1e-9
"""White noise that is added to every noise, as a share of its variance.  The autocovariance of
smooth signals is singular without it.  It is the rounding error of the sums, with a margin.
Source: Markel & Gray, Linear Prediction of Speech (1976) section 8.4."""
_LEAST_SHARE = 1e-3
"""Floor of the expected periodogram, as a share of the noise's spectrum: it avoids a division by
nearly zero where the removed terms hold all the power.  Chosen by judgement."""

Autoregression = tuple[np.ndarray, float]


def autoregression(
    series: Sequence[np.ndarray], terms: Sequence[np.ndarray] | None = None
) -> Autoregression:
    """The AR(p) filter (p+1,) and the innovation's standard deviation of stretches (n,) of noise.

    The coefficients solve the Yule–Walker equations, and the order p has the least BIC.  `terms`
    (n, k), orthonormal, were fitted to each stretch and subtracted.

    The spectrum is smoothed by a running median, so that lines of the mains, which are interference
    and not noise, do not count.  Before smoothing, the periodogram is divided by the one that the
    previous pass expects of such a stretch.  Without this division the median would cut off a peak
    at low frequency, and the removed terms would appear as missing noise (Worsley et al.,
    NeuroImage 15, 2002, correct the same bias in the same way).  The memory is never longer than
    the shortest stretch.
    """
    return autoregressions([series], None if terms is None else [terms])[0]


def autoregressions(
    noises: Sequence[Sequence[np.ndarray]], terms: Sequence[Sequence[np.ndarray]] | None = None
) -> list[Autoregression]:
    """The `autoregression` of each of many noises, which takes less time together."""
    if terms is None:
        terms = [[np.zeros((s.size, 0)) for s in series] for series in noises]
    counts = np.array([sum(s.size for s in series) for series in noises])
    shortest = np.array([min(s.size for s in series) for series in noises])
    largest = np.minimum(_LARGEST_ORDER, shortest // _LEAST_PER_ORDER)
    periodograms = [[_squared(np.fft.rfft(s)) / s.size for s in series] for series in noises]
    estimates: list[Autoregression] = [(np.ones(1), 1.0)] * len(noises)
    previous = np.zeros((len(noises), _LARGEST_ORDER + 1))

    def autocovariance(at: int) -> np.ndarray:
        """That of one noise (13,), from all of its stretches, 0 beyond its largest order."""
        pairs, lags = zip(periodograms[at], terms[at], strict=True), int(largest[at])
        parts = (len(t) * _autocovariance(power, t, estimates[at], lags) for power, t in pairs)
        padded = np.zeros(_LARGEST_ORDER + 1)
        padded[: lags + 1] = sum(parts) / counts[at]
        return padded

    pending = list(range(len(noises)))
    for _ in range(_PASSES):
        if not pending:
            break
        present = np.array([autocovariance(at) for at in pending])
        changes = np.abs(present - previous[pending]).max(axis=1)
        previous[pending] = present
        dampings = np.exp(-1 / shortest[pending])
        solved = _yule_walker(present, largest[pending], counts[pending], dampings)
        remaining = []
        for at, estimate, change in zip(pending, solved, changes, strict=True):
            # A flat expectation gives the same again, whatever its level.
            flat = estimates[at][0].size == estimate[0].size == 1
            flat = flat and not any(t.size for t in terms[at])
            estimates[at] = estimate
            if not (flat or change <= _CONVERGED * previous[at, 0]):
                remaining.append(at)
        pending = remaining
    return estimates


def _yule_walker(
    autocovariances: np.ndarray, largest: np.ndarray, counts: np.ndarray, dampings: np.ndarray
) -> list[Autoregression]:
    """The autoregressions of least BIC with these autocovariances (R, lags+1).

    Each is over its count (R,) of samples and at most of its largest order (R,).  The coefficient
    of the sample k steps back is multiplied by its damping (R,)^k.

    Source: Durbin, Rev. Int. Stat. Inst. 28 (1960) 233.
    """
    rows, size = autocovariances.shape
    silent = ~(autocovariances[:, 0] > 0)
    autocovariances = np.where(silent[:, None], np.eye(1, size), autocovariances)
    autocovariances[:, 0] *= 1 + _WHITE_SHARE
    taps, variances = np.zeros((size, rows, size)), np.empty((size, rows))
    taps[0, :, 0], variances[0] = 1.0, autocovariances[:, 0]
    for order in range(1, size):
        # Levinson's recursion: one more coefficient from the autoregression of one order less.
        before = taps[order - 1, :, : order + 1]
        forward = np.sum(before[:, :-1] * autocovariances[:, order:0:-1], axis=1)
        reflection = np.where(order <= largest, -forward / variances[order - 1], 0.0)
        taps[order, :, : order + 1] = before + reflection[:, None] * before[:, ::-1]
        variances[order] = variances[order - 1] * (1 - reflection**2)
    orders, row = np.arange(size), np.arange(rows)
    best = np.argmin(counts * np.log(variances) + orders[:, None] * np.log(counts), axis=0)
    innovations = np.where(silent, 0.0, np.sqrt(variances[best, row]))
    damped = taps[best, row] * dampings[:, None] ** orders
    return [
        (coefficients[: order + 1], float(innovation))
        for coefficients, order, innovation in zip(damped, best, innovations, strict=True)
    ]


def _autocovariance(
    power: np.ndarray, terms: np.ndarray, noise: Autoregression, lags: int
) -> np.ndarray:
    """Autocovariance (lags+1,) of the noise in a stretch whose terms (n, k) were removed.

    The periodogram (n//2+1,) is smoothed in units of the one that the current estimate `noise`
    expects.
    """
    expected, spectrum = _expected_power(noise, terms)
    relative = power / np.maximum(expected, _LEAST_SHARE * spectrum)
    relative[0] = relative[1]
    width = min(2 * max(power.size // 40, 5) + 1, power.size)
    # Periodogram values are exponentially distributed: their median is ln 2 of their mean.
    smooth = median_filter(relative, width, mode="mirror") / np.log(2)
    return np.fft.irfft(smooth * spectrum, len(terms))[: lags + 1]


def _expected_power(noise: Autoregression, terms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The expected periodogram (n//2+1,) of noise minus its fitted terms, and the noise's spectrum.

    The `terms` (n, k) were fitted to a stretch (n,) and subtracted.  The spectrum is at the same
    frequencies.
    """
    (taps, innovation), size = noise, len(terms)
    if taps.size == 1 and not terms.size:
        flat = np.full(size // 2 + 1, innovation**2)
        return flat, flat
    covariance = _covariance(noise, size)
    of_lag = covariance * (1 - np.arange(size) / size) - _removed(covariance, terms) / size
    # At the periodogram's frequencies a lag of -k equals one of n - k.
    of_lag[1:] += of_lag[:0:-1]
    return np.fft.rfft(of_lag).real, innovation**2 / _squared(np.fft.rfft(taps, size))


def _squared(values: np.ndarray) -> np.ndarray:
    """The squared absolute values of complex numbers, without the root that `abs` takes."""
    return np.real(values) ** 2 + np.imag(values) ** 2


def _covariance(noise: Autoregression, size: int) -> np.ndarray:
    """The covariance c (n,) of the noise at the lags below n = `size`, from Σ_j a_j c_|k-j| = 0.

    At k = 0 the sum is the variance of the innovation.
    """
    taps, innovation = noise
    order = taps.size - 1
    lags = np.arange(order + 1)
    equations = np.zeros((order + 1, order + 1))
    np.add.at(equations, (lags[:, None], np.abs(lags[:, None] - lags)), taps)
    first = np.linalg.solve(equations, innovation**2 * (lags == 0))
    covariance = np.zeros(size)
    covariance[: order + 1] = first[:size]
    if 0 < order < size - 1:
        # The first ones are a start's own: what drives the recursion to them, and nothing later.
        covariance[: order + 1] = moving_sum(taps, first)
        covariance = solve_recursion(taps, covariance)
    return covariance


def removed_power(noise: Autoregression, terms: np.ndarray) -> float:
    """The part of the noise's sum of squares that fitting orthonormal terms (n, k) removes."""
    return float(_removed(_covariance(noise, len(terms)), terms)[0]) if terms.size else 0.0


def _removed(covariance: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """The part of the sums Σ_t E[e_t e_{t+k}] (n,) that fitting the terms Q (n, k) removes.

    It is that of C - MCM at each lag, with M = 1 - QQᵀ.
    """
    size = len(terms)
    if not terms.size:
        return np.zeros(size)

    def transformed(columns: np.ndarray) -> np.ndarray:
        """The Fourier transform of columns (n, k), zero-padded to 2n samples."""
        return np.fft.rfft(columns, 2 * size, axis=0)

    circulant = np.concatenate([covariance, [0.0], covariance[:0:-1]])
    product = np.fft.irfft(transformed(circulant)[:, None] * transformed(terms), axis=0)[:size]
    # C - MCM = QBᵀ + BQᵀ - Q(QᵀB)Qᵀ with B = CQ: pairs of columns, correlated.
    of_terms, of_product = transformed(terms), transformed(product - terms @ (terms.T @ product))
    crossed = of_terms.conj() * transformed(product) + of_product.conj() * of_terms
    return np.fft.irfft(crossed.sum(axis=1), 2 * size)[:size]
