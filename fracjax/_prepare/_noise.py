"""The noise floor of a recording and its colour."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ._tone import Tone

Method = Literal["repeats", "static", "specification", "residual"]
_BARELY_MORE = 1.25
NONE = np.zeros(0), np.zeros(0)
"""No frequencies and no power, no samples and no sizes."""


@dataclass(frozen=True)
class Noise:
    """Autoregressive noise: Σ_k filter[k] e_{t-k} = innovation · white, filter[0] = 1.

    `sigma` is the rms of all that does not repeat, in `unit`, and of what went with slow terms that
    were fitted to it; `method` says where it was read.  The
    filter leaves lines of the mains out, so that they count as mismatch and can be named.
    It was read from `effective` independent samples, of this `kurtosis`: a floor read from a short
    rest, or from noise with heavy tails, is known less well than the recording's length suggests.
    `lines`: frequencies [1/sample] and power (n,) of the whitened noise, 1 where the filter fits,
    each as good as 2/`shared` degrees of freedom.
    `is_leftover`: it was read from what a fit left over, so that a better fit tells it better; of
    one that is specified, as a number, its colour.
    `course`: sample numbers and the noise's size there (n,), of which it is 1 on average; none
    where the noise is as large everywhere as far as can be seen.  `crest`: its rms over what the
    median of its differences says, 1 for normal noise.  `tone`: one
    that it surely holds.
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
        """A noise of this size and origin with the colour of another; itself where that is clearly
        larger, for then more than noise is in it."""
        if other.sigma**2 > _BARELY_MORE * self.sigma**2:
            return self
        innovation = other.innovation * self.sigma / other.sigma
        return replace(other, sigma=self.sigma, method=self.method, innovation=innovation)

    def size_at(self, samples: int) -> np.ndarray | None:
        """How large the noise is at each sample (N,), 1 on average; None where it does not vary."""
        where, size = self.course
        if not where.size:
            return None
        # Where none was seen, at either end, it is not taken for smaller than elsewhere.
        ends = {"left": max(size[0], 1.0), "right": max(size[-1], 1.0)}
        return np.interp(np.arange(samples), where, size, **ends)

    def samples_to_average(self, error: float) -> float:
        """How many samples in a row know a constant with a standard error of that share of sigma.

        The variance of their mean tends to (innovation / Σ_k filter[k])² / n, the spectrum at
        frequency zero: where neighbours are alike, noise averages out more slowly.
        """
        slow = self.innovation / (self.sigma * max(abs(float(np.sum(self.filter))), 1e-12))
        return (slow / error) ** 2

    def doubt(self, kurtosis: float = 3.0) -> float:
        """The relative standard error of the variance, with the heavier of both tails."""
        return float(np.sqrt((max(kurtosis, self.kurtosis) - 1) / self.effective))

    def without_lines(self) -> Noise:
        """The same noise, with no more in any band than its filter says."""
        return replace(self, lines=NONE)

    @property
    def whitened_square(self) -> float:
        """The mean square of what it was read from, whitened: 1, unless that holds a line that the
        filter leaves out."""
        power = self.lines[1]
        return float(power.mean()) if power.size else 1.0

    @property
    def whitening(self) -> np.ndarray:
        """The filter that turns this noise into white noise of unit variance."""
        return self.filter / self.innovation
