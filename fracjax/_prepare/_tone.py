"""A tone in what was taken for noise: interference or a vibration that no drive causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.stats import gamma

_SURELY = 1e-7
_WORTH_TELLING = 0.2
_SLOWEST = 6.0
"""Periods within the longest stretch: what is slower is drift."""
_LEAST_NEIGHBOURS = 8


@dataclass(frozen=True)
class Tone:
    """About at `frequency` [1/sample], of about `rms` in the response's unit."""

    frequency: float
    rms: float


def tone_in(
    whitened: Sequence[np.ndarray], taps: np.ndarray, sigma: float, shared: float
) -> Tone | None:
    """The strongest tone of whitened stretches (n,), `taps` being the filter that whitened them;
    None where noise might well show as much, or it is less than a fifth of the noise's `sigma`.

    By the periodogram of all stretches together (Fisher, Proc. R. Soc. A 125, 1929): noise gives
    each frequency a gamma distribution.  `shared`: how many samples hold the same noise.
    """
    sizes = np.array([w.size for w in whitened])
    longest = 2 * int(sizes.max())
    # Stretch by stretch, for phases from one to the next are not known.
    power = sum(np.abs(np.fft.rfft(w, longest)) ** 2 for w in whitened) / sizes.sum()
    frequencies = np.fft.rfftfreq(longest)
    freedom = sizes.sum() ** 2 / np.sum(sizes**2) / shared
    # Beside its neighbours, for a filter of few taps does not whiten a steep slope wholly.
    width = 2 * max(power.size // 40, _LEAST_NEIGHBOURS) + 1
    middle = median_filter(power, width, mode="nearest")
    levels = middle * freedom / gamma.median(freedom)
    asked = (frequencies * sizes.max() >= _SLOWEST) & (levels > 0)
    standing_out = np.divide(power, levels, out=np.zeros_like(power), where=asked)
    top = int(np.argmax(standing_out))
    level = levels[top]
    chance = longest / 2 * gamma.sf(standing_out[top] * freedom, freedom)
    phases = 2j * np.pi * frequencies[top] * np.arange(taps.size)
    response = np.abs(taps @ np.exp(-phases))
    variance = 2 * max(power[top] - level, 0.0) * sizes.sum() / np.sum(sizes**2)
    rms = float(np.sqrt(variance) / response)
    if chance > _SURELY or rms < _WORTH_TELLING * sigma:
        return None
    return Tone(float(frequencies[top]), rms)
