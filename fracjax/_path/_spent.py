"""The noise that path curves take up, by its frequency."""

from __future__ import annotations

import numpy as np

from .._filters import averaged
from ._law import Settled


def spent_of(settled: Settled, ends: np.ndarray) -> list[np.ndarray]:
    r"""The share (N//2+1,) of white noise that curves take up at each frequency, of recordings that
    end at `ends`:

        s(f) = Re Σ e*(f) t(f) / Σ |e(f)|²

    of the transforms e of probes and t of what is taken out of them.  Curves follow what is slow
    along the path: they take nearly all slow noise, and of the fast nearly none.
    """
    whitening = settled.law.whitening
    lost = whitening.lost / whitening.count
    shares = []
    for probes, taken in zip(*(np.split(part, ends) for part in settled.probed), strict=True):
        noise, caught = np.fft.rfft(probes, axis=0), np.fft.rfft(taken, axis=0)
        power, common = (
            averaged(np.sum(np.real(noise.conj() * other), axis=1)) for other in (noise, caught)
        )
        share = common / np.where(power > 0, power, 1.0)  # a recording of which no sample counts
        shares.append(np.clip(share + lost, 0.0, 1.0))
    return shares
