"""The noise floor of a recording and its colour."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ._tone import Tone

Method = Literal["repeats", "static", "specification", "residual"]
_BARELY_MORE = 1.25
"""Ratio of variances up to which a residual counts as little more than the specified noise, so that
its colour is the noise's.  Chosen by judgement."""
_LAGS = 4096
"""Length of the transform by which an autocorrelation is summed: the memories of noise end well
within it."""
NONE = np.zeros(0), np.zeros(0)
"""No lines, or no profile over time."""


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
        kurtosis: of the whitened noise, dimensionless, 3 for normal noise.
        lines: frequencies [1/sample] (n,) and power (n,) of the whitened noise, 1 where the filter
            fits, each with 2/`shared` degrees of freedom.
        shared: how many of the samples hold the same noise, 1 where all are independent.
        is_leftover: whether it was read from a fit's residual, so that a better fit improves it;
            with a specified level this concerns only its colour.
        course: the level's profile over time: sample numbers (n,) and the level there relative to
            its average (n,); empty where no change is significant.
        crest: the rms divided by the estimate from the median of the differences, dimensionless, 1
            for normal noise.
        tone: a tone that is clearly present (see `_tone`), else None.
    """

    sigma: float
    unit: str
    method: Method
    filter: np.ndarray
    innovation: float
    effective: float = np.inf
    kurtosis: float = 3.0
    lines: tuple[np.ndarray, np.ndarray] = field(default=NONE, repr=False)
    shared: float = 1.0
    is_leftover: bool = False
    course: tuple[np.ndarray, np.ndarray] = NONE
    crest: float = 1.0
    tone: Tone | None = None

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
