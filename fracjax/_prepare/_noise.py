"""The noise floor of a recording and its colour."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from .._recording import quantiles
from ._tone import Tone, tone_in

Method = Literal["repeats", "static", "specification", "residual"]
_BARELY_MORE = 1.25
"""Ratio of variances up to which a residual counts as little more than the specified noise, so that
its colour is the noise's.  Chosen by judgement."""
_LAGS = 4096
"""Length of the transform by which an autocorrelation is summed: the memories of noise end well
within it."""
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""
NONE = np.zeros(0), np.zeros(0)
"""No lines, or no profile over time."""


def level_from_differences(differences: np.ndarray) -> Any:
    """The standard deviation (…) of normal noise with such differences (…, n), from their median.

    The median ignores outliers and oscillations at the beginning of a rest.  What is no number does
    not count.
    """
    return quantiles(np.abs(differences), 0.5)[0] / (_NORMAL_MEDIAN * np.sqrt(2))


def kurtosis_of(samples: np.ndarray) -> float:
    """The kurtosis of samples (n,), dimensionless, 3 where they are normal."""
    squares = (samples - samples.mean()) ** 2
    with np.errstate(invalid="ignore"):  # NaN where they are constant
        return float(np.mean(squares**2) / np.mean(squares) ** 2)


@dataclass(frozen=True)
class Whitened:
    """The samples that a noise was read from, whitened; what they show is computed once asked for.

    Attributes:
        stretches: per stretch (n,), of unit variance.
        slow: per stretch, the number of its slowest lines that fitted terms have removed.
        taps: (p+1,) the filter that whitened them [1/unit].
        sigma: the rms of the noise, in its unit.
        shared: how many of the samples hold the same noise.
    """

    stretches: tuple[np.ndarray, ...]
    slow: tuple[int, ...]
    taps: np.ndarray
    sigma: float
    shared: float

    @cached_property
    def kurtosis(self) -> float:
        """The kurtosis, dimensionless, at least the 3 of normal noise."""
        return max(kurtosis_of(np.concatenate(self.stretches)), 3.0)

    @cached_property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [1/sample] (n,) and power (n,), without the slowest."""
        spectra = [
            (np.fft.rfftfreq(w.size)[k:], np.abs(np.fft.rfft(w))[k:] ** 2 / w.size)
            for w, k in zip(self.stretches, self.slow, strict=True)
        ]
        frequencies, power = (np.concatenate(parts) for parts in zip(*spectra, strict=True))
        return frequencies, power

    @cached_property
    def crest(self) -> float:
        """The rms divided by the estimate from the median of the differences."""
        white = np.concatenate(self.stretches)
        # The median is 0 where most samples have the code of their neighbour.
        level = level_from_differences(np.diff(white))
        return float(np.sqrt(np.mean(white**2))) / level if level else 1.0

    @cached_property
    def tone(self) -> Tone | None:
        """The strongest tone, None where none is significant."""
        return tone_in(self.stretches, self.taps, self.sigma, self.shared)


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: Σ_k filter[k] e_{t-k} = innovation · white, filter[0] = 1.

    The filter does not model lines of the mains, so that they count as mismatch and can be named.
    A noise floor read from a short rest, or from noise with heavy tails, is less certain than the
    recording's length suggests: `effective` and `kurtosis` describe this.

    Attributes:
        sigma: the rms of all that does not repeat and is no tone, in `unit`, slow terms that were
            fitted to it included.
        unit: the response's unit.
        method: where the noise was read: "repeats", "static" (a rest), "specification" or
            "residual".
        filter: (p+1,) coefficients of the autoregression, dimensionless.
        innovation: the standard deviation of the autoregression's white input, in `unit`.
        effective: the number of independent samples that it was read from.
        shared: how many of the samples hold the same noise, 1 where all are independent.
        is_leftover: whether it was read from a fit's residual, so that a better fit improves it;
            with a specified level this concerns only its colour.
        course: the level's profile over time: sample numbers (n,) and the level there relative to
            its average (n,); empty where no change is significant.
        whitened: the samples that it was read from, None where there are none.
        removed_tone: the strongest of the tones that were taken out, else None.
    """

    sigma: float
    unit: str
    method: Method
    filter: np.ndarray
    innovation: float
    effective: float = np.inf
    shared: float = 1.0
    is_leftover: bool = False
    course: tuple[np.ndarray, np.ndarray] = NONE
    whitened: Whitened | None = field(default=None, repr=False)
    removed_tone: Tone | None = None

    @property
    def is_residual(self) -> bool:
        """Whether it is all of a fit's residual, whose colour it then has."""
        return self.method == "residual" and self.whitened is not None

    @property
    def kurtosis(self) -> float:
        """The kurtosis of the whitened noise, dimensionless, 3 for normal noise."""
        return self.whitened.kurtosis if self.whitened else 3.0

    @property
    def lines(self) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies [1/sample] (n,) and power (n,) of the whitened noise, 1 where the filter
        fits, each with 2/`shared` degrees of freedom.
        """
        return self.whitened.lines if self.whitened else NONE

    @property
    def crest(self) -> float:
        """The rms divided by the estimate from the median of the differences, dimensionless, 1 for
        normal noise.
        """
        return self.whitened.crest if self.whitened else 1.0

    @property
    def tone(self) -> Tone | None:
        """A tone that is clearly present (see `_tone`), else None."""
        return self.removed_tone or (self.whitened.tone if self.whitened else None)

    def coloured_as(self, other: Noise) -> Noise:
        """A noise of this level and origin with the colour of another.

        Args:
            other: the noise whose colour is used.

        Returns:
            That noise at this level; this noise unchanged where the other is clearly larger, for
            then the other contains more than noise.
        """
        if other.sigma**2 > _BARELY_MORE * self.sigma**2:
            return self
        innovation = other.innovation * self.sigma / other.sigma
        return replace(other, sigma=self.sigma, method=self.method, innovation=innovation)

    def size_at(self, samples: int) -> np.ndarray | None:
        """The level of the noise at each sample (N,), dimensionless, 1 on average.

        Args:
            samples: the number N of samples.

        Returns:
            The relative levels (N,), None where the level does not vary.
        """
        where, size = self.course
        if not where.size:
            return None
        # Before the first and after the last measurement the level is at least the average.
        ends = {"left": max(size[0], 1.0), "right": max(size[-1], 1.0)}
        return np.interp(np.arange(samples), where, size, **ends)

    def samples_to_average(self, error: float) -> float:
        """How many successive samples determine a constant to a given standard error.

        The variance of their mean tends to (innovation / Σ_k filter[k])² / n, the spectrum at
        frequency zero: where neighbouring samples are alike, noise averages out more slowly.

        Args:
            error: the standard error as a share of `sigma`, dimensionless.

        Returns:
            The number of samples n.
        """
        slow = self.innovation / (self.sigma * max(abs(float(np.sum(self.filter))), 1e-12))
        return (slow / error) ** 2

    def doubt(self, kurtosis: float = 3.0) -> float:
        """The relative standard error of the variance, dimensionless.

        Args:
            kurtosis: another estimate of the kurtosis; the larger of both is used.

        Returns:
            √((kurtosis - 1)/effective).
        """
        return float(np.sqrt((max(kurtosis, self.kurtosis) - 1) / self.effective))

    def uncoloured(self) -> Noise:
        """White noise of the same level and origin.

        Returns:
            The noise without filter, measured lines and profile over time.
        """
        white = white_noise(self.sigma, self.unit, self.method)
        return replace(white, effective=self.effective, is_leftover=self.is_leftover)

    @property
    def relative_error(self) -> float | None:
        """The relative standard error of `sigma`, dimensionless, None where it was not measured.

        σ̂² of n samples with the autocorrelation ρ has the variance (κ - 1) Σ_k ρ_k² σ⁴/n, with κ
        the kurtosis.

        Source: Bartlett, J. R. Stat. Soc. Suppl. 8 (1946) 27.
        """
        if self.method in ("specification", "residual"):
            return None
        spectrum = np.abs(np.fft.rfft(self.filter, _LAGS)) ** -2
        alike = float(np.mean(spectrum**2) / np.mean(spectrum) ** 2)
        return float(np.sqrt((self.kurtosis - 1) * alike / self.effective) / 2)

    def to_dict(self) -> dict:
        """The level as plain data.

        Returns:
            Level, unit, method and the level's relative error by name.
        """
        return {
            "sigma": self.sigma,
            "unit": self.unit,
            "method": self.method,
            "relative_error": self.relative_error,
        }

    @property
    def whitened_square(self) -> float:
        """The mean square of the whitened noise, dimensionless.

        It is 1, or more where the noise holds a line that the filter leaves out.
        """
        power = self.lines[1]
        return float(power.mean()) if power.size else 1.0

    @property
    def whitening(self) -> np.ndarray:
        """The filter (p+1,) [1/unit] that turns this noise into white noise of unit variance."""
        return self.filter / self.innovation


def white_noise(sigma: float, unit: str, method: Method) -> Noise:
    """White noise of a level [unit, rms]."""
    return Noise(sigma, unit, method, np.ones(1), sigma)
