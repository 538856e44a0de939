"""A tone in what counts as noise: interference, or a vibration that the drive does not cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import gammaincc, gammaincinv

_SIGNIFICANT = 1e-7
"""Largest p-value of a tone, all frequencies counted.  Chosen by judgement."""
_LEAST_SHARE = 0.2
"""Least rms of a tone that is reported, as a share of the noise's.  Chosen by judgement."""
_SLOWEST = 6.0
"""Fewest periods within the longest stretch: what is slower is drift."""
_LEAST_NEIGHBOURS = 8
"""Fewest frequencies on either side that a frequency is compared with.  Chosen by judgement."""


@dataclass(frozen=True)
class Tone:
    """A tone.

    Attributes:
        frequency: [1/sample].
        rms: in the response's unit.
    """

    frequency: float
    rms: float


def tone_in(
    whitened: Sequence[np.ndarray], taps: np.ndarray, sigma: float, shared: float
) -> Tone | None:
    """The strongest tone of whitened stretches (n,), None where none is significant.

    `taps` (p+1,) is the filter that whitened them.  A tone is None where noise alone shows as much
    with a chance above `_SIGNIFICANT`, or where it is less than a fifth of the noise's `sigma`.
    `shared` says how many samples hold the same noise.

    The test uses the periodogram of all stretches together, in which noise gives each frequency a
    gamma distribution.

    Source: Fisher, Proc. R. Soc. A 125 (1929) 54.
    """
    sizes = np.array([w.size for w in whitened])
    longest = 2 * int(sizes.max())
    # Stretch by stretch, because the phase from one to the next is unknown.
    power = sum(np.abs(np.fft.rfft(w, longest)) ** 2 for w in whitened) / sizes.sum()
    frequencies = np.fft.rfftfreq(longest)
    freedom = sizes.sum() ** 2 / np.sum(sizes**2) / shared
    # Compared with the neighbours, because a short filter does not fully whiten a steep slope.
    width = 2 * max(power.size // 40, _LEAST_NEIGHBOURS) + 1
    neighbours = median_filter(power, width, mode="mirror")
    levels = neighbours * freedom / gammaincinv(freedom, 0.5)
    eligible = (frequencies * sizes.max() >= _SLOWEST) & (levels > 0)
    ratio = np.divide(power, levels, out=np.zeros_like(power), where=eligible)
    top = int(np.argmax(ratio))
    level = levels[top]
    if longest / 2 * gammaincc(freedom, ratio[top] * freedom) > _SIGNIFICANT:
        return None
    frequency = _refined(whitened, float(frequencies[top]), 1 / longest)
    phases = 2j * np.pi * frequency * np.arange(taps.size)
    response = np.abs(taps @ np.exp(-phases))
    variance = 2 * max(power[top] - level, 0.0) * sizes.sum() / np.sum(sizes**2)
    rms = float(np.sqrt(variance) / response)
    return Tone(frequency, rms) if rms >= _LEAST_SHARE * sigma else None


def _refined(whitened: Sequence[np.ndarray], frequency: float, width: float) -> float:
    """The frequency [1/sample] within a `width` of this one at which the stretches have most power,
    by stretches, because the phase from one to the next is unknown.
    """

    from scipy.optimize import minimize_scalar  # tones are rare, and it takes long to import

    def power(candidate: float) -> float:
        wave = np.exp(-2j * np.pi * candidate * np.arange(max(w.size for w in whitened)))
        return -float(sum(abs(w @ wave[: w.size]) ** 2 / w.size for w in whitened))

    low, high = max(frequency - width, 0.0), min(frequency + width, 0.5)
    best = minimize_scalar(power, bounds=(low, high), options={"xatol": 1e-4 * width})
    return float(best.x)
