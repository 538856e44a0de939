"""Tests of a sample's distribution, as `scipy.stats` has them, which takes longer to import than a
fit takes.

Sources: D'Agostino & Pearson, Biometrika 60 (1973) 613; D'Agostino, Biometrika 57 (1970) 679;
    Anscombe & Glynn, Biometrika 70 (1983) 227; Brown & Forsythe, J. Am. Stat. Assoc. 69 (1974) 364.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import chdtrc, fdtrc


def skewness(sample: np.ndarray) -> float:
    """The third central moment of a sample (n,) over the cube of its standard deviation."""
    centred = sample - sample.mean()
    return float(np.mean(centred**3) / np.mean(centred**2) ** 1.5)


def excess_kurtosis(sample: np.ndarray) -> float:
    """The fourth central moment of a sample (n,) over its squared variance, less 3."""
    centred = sample - sample.mean()
    return float(np.mean(centred**4) / np.mean(centred**2) ** 2 - 3)


def p_of_normality(sample: np.ndarray) -> float:
    """The p-value of a sample (n,) being normal, by its skewness and kurtosis."""
    squares = _of_skewness(sample) ** 2 + _of_kurtosis(sample) ** 2
    return float(chdtrc(2, squares))


def _of_skewness(sample: np.ndarray) -> float:
    """The skewness, transformed so that it is standard normal for a normal sample."""
    n = float(sample.size)
    y = skewness(sample) * np.sqrt((n + 1) * (n + 3) / (6 * (n - 2)))
    beta = 3 * (n**2 + 27 * n - 70) * (n + 1) * (n + 3) / ((n - 2) * (n + 5) * (n + 7) * (n + 9))
    w_squared = np.sqrt(2 * (beta - 1)) - 1
    return float(np.arcsinh(y * np.sqrt((w_squared - 1) / 2)) / np.sqrt(np.log(w_squared) / 2))


def _of_kurtosis(sample: np.ndarray) -> float:
    """The kurtosis, transformed so that it is standard normal for a normal sample."""
    n = float(sample.size)
    variance = 24 * n * (n - 2) * (n - 3) / ((n + 1) ** 2 * (n + 3) * (n + 5))
    x = (excess_kurtosis(sample) + 6 / (n + 1)) / np.sqrt(variance)
    root_beta = 6 * (n**2 - 5 * n + 2) / ((n + 7) * (n + 9))
    root_beta *= np.sqrt(6 * (n + 3) * (n + 5) / (n * (n - 2) * (n - 3)))
    a = 6 + 8 / root_beta * (2 / root_beta + np.sqrt(1 + 4 / root_beta**2))
    cube = (1 - 2 / a) / (1 + x * np.sqrt(2 / (a - 4)))
    return float((1 - 2 / (9 * a) - np.cbrt(cube)) / np.sqrt(2 / (9 * a)))


def p_of_equal_spread(samples: Sequence[np.ndarray]) -> float:
    """The p-value of samples having one spread: the analysis of variance of the distances from
    their medians."""
    distances = [np.abs(sample - np.median(sample)) for sample in samples]
    everywhere = np.concatenate(distances)
    among, within = len(samples) - 1, everywhere.size - len(samples)
    between = sum(d.size * (d.mean() - everywhere.mean()) ** 2 for d in distances)
    inside = sum(np.sum((d - d.mean()) ** 2) for d in distances)
    return float(fdtrc(among, within, (between / among) / (inside / within)))
