"""The colour of noise: an autoregression of stretches that slow terms were fitted to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.fft import next_fast_len
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter

_LARGEST_ORDER = 12
_LEAST_PER_ORDER = 20
_PASSES = 8
_SETTLED = 0.01
# A response to an impulse has died out after this many times the longest memory that is told.
_LASTING = 8
_LEAST_SHARE = 1e-3

Autoregression = tuple[np.ndarray, float]


def autoregression(
    series: Sequence[np.ndarray], terms: Sequence[np.ndarray] | None = None
) -> Autoregression:
    """AR(p) filter (p+1,) and innovation sd of one or more stretches (n,), p by BIC (Yule–Walker).

    `terms` (n, k), orthonormal, are what has been fitted to each stretch and taken off.  The
    spectrum is smoothed by a running median, so that lines of the mains, which are no noise but
    interference, do not count; and it is smoothed in units of what the autoregression of the pass
    before lets expect of such a stretch, without which a median cuts off a peak at low frequency
    and the terms that were taken off pass for noise that is not there (Worsley et al., NeuroImage
    15, 2002, mend the same bias in the same way).  No memory is told to be longer than a stretch.
    """
    sizes = [s.size for s in series]
    count, shortest = sum(sizes), min(sizes)
    largest = min(_LARGEST_ORDER, shortest // _LEAST_PER_ORDER)
    if terms is None:
        terms = [np.zeros((s.size, 0)) for s in series]
    periodograms = [np.abs(np.fft.rfft(s)) ** 2 / s.size for s in series]
    found: Autoregression = np.ones(1), 1.0
    before = np.zeros(largest + 1)
    for _ in range(_PASSES):
        pairs = zip(periodograms, terms, strict=True)
        parts = [_autocovariance(power, t, found, largest) for power, t in pairs]
        autocovariance = np.average(parts, axis=0, weights=sizes)
        found = _yule_walker(autocovariance, count, np.exp(-1 / shortest))
        if np.allclose(autocovariance, before, rtol=0, atol=_SETTLED * autocovariance[0]):
            break
        before = autocovariance
    return found


def _yule_walker(autocovariance: np.ndarray, count: int, forgets: float) -> Autoregression:
    """The autoregression of least BIC with this autocovariance (lags+1,) over `count` samples; what
    came k samples before counts `forgets`^k less than it says."""
    best = np.ones(1), float(np.sqrt(autocovariance[0]))
    least = count * np.log(autocovariance[0])
    for order in range(1, autocovariance.size):
        coefficients = solve_toeplitz(autocovariance[:order], autocovariance[1 : order + 1])
        variance = autocovariance[0] - coefficients @ autocovariance[1 : order + 1]
        score = count * np.log(variance) + order * np.log(count)
        if score < least:
            taps = np.concatenate([[1.0], -coefficients]) * forgets ** np.arange(order + 1)
            best, least = (taps, float(np.sqrt(variance))), score
    return best


def _autocovariance(
    power: np.ndarray, terms: np.ndarray, told: Autoregression, lags: int
) -> np.ndarray:
    """Autocovariance (lags+1,) of the noise in a stretch without its terms (n, k), from its
    periodogram (n//2+1,) in units of what is `told` of it, smoothed."""
    expected, spectrum = _expected_power(told, terms)
    relative = power / np.maximum(expected, _LEAST_SHARE * spectrum)
    relative[0] = relative[1]
    width = min(2 * max(power.size // 40, 5) + 1, power.size)
    # Periodogram values are exponentially distributed: their median is ln 2 of their mean.
    smooth = median_filter(relative, width, mode="nearest") / np.log(2)
    return np.fft.irfft(smooth * spectrum, len(terms))[: lags + 1]


def _expected_power(told: Autoregression, terms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The expected periodogram (n//2+1,) of a stretch (n,) of this noise less what `terms` (n, k)
    fit of it, and the noise's spectrum at the same frequencies."""
    (taps, innovation), size = told, len(terms)
    covariance = _covariance(told, size)
    of_lag = covariance * (1 - np.arange(size) / size) - _taken(covariance, terms) / size
    # At the periodogram's frequencies a lag of -k is one of n - k.
    of_lag[1:] += of_lag[:0:-1]
    return np.fft.rfft(of_lag).real, innovation**2 / np.abs(np.fft.rfft(taps, size)) ** 2


def _covariance(told: Autoregression, size: int) -> np.ndarray:
    """The covariance (n,) of noise at the lags below n = `size`."""
    taps, innovation = told
    length = next_fast_len(_LASTING * size, real=True)
    return np.fft.irfft(innovation**2 / np.abs(np.fft.rfft(taps, length)) ** 2, length)[:size]


def taken_power(told: Autoregression, terms: np.ndarray) -> float:
    """How much of the sum of squares of noise that is `told` orthonormal terms (n, k) take off."""
    return float(_taken(_covariance(told, len(terms)), terms)[0])


def _taken(covariance: np.ndarray, terms: np.ndarray) -> np.ndarray:
    """What of the sums Σ_t E[e_t e_{t+k}] (n,) goes with the terms Q (n, k): of C - MCM at each
    lag, M = 1 - QQᵀ."""
    size = len(terms)
    if not terms.size:
        return np.zeros(size)

    def transformed(columns: np.ndarray) -> np.ndarray:
        return np.fft.rfft(columns, 2 * size, axis=0)

    circulant = np.concatenate([covariance, [0.0], covariance[:0:-1]])
    product = np.fft.irfft(transformed(circulant)[:, None] * transformed(terms), axis=0)[:size]
    # C - MCM = QBᵀ + BQᵀ - Q(QᵀB)Qᵀ with B = CQ: pairs of columns, correlated.
    of_terms, of_product = transformed(terms), transformed(product - terms @ (terms.T @ product))
    crossed = of_terms.conj() * transformed(product) + of_product.conj() * of_terms
    return np.fft.irfft(crossed.sum(axis=1), 2 * size)[:size]
