"""Many signals at once: those of one length as the rows of an array."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

_LARGEST = 2**15
"""Samples that are handled at once: with more, arrays leave the processor's cache, and time is lost
again.  Chosen by measurement."""


def in_rows(function: Callable[..., Any], *signals: Sequence[np.ndarray]) -> list[Any]:
    """What a function of rows (R, N), one array per argument, returns of each signal (N,).

    The arguments are lists of signals of any lengths; those of one length are handled together.
    """
    by_length: dict[int, list[int]] = {}
    for at, signal in enumerate(signals[0]):
        by_length.setdefault(signal.size, []).append(at)
    results: list[Any] = [None] * len(signals[0])
    for length, alike in by_length.items():
        count = max(1, _LARGEST // length)
        for start in range(0, len(alike), count):
            members = alike[start : start + count]
            rows = function(*(np.stack([one[at] for at in members]) for one in signals))
            for at, result in zip(members, rows, strict=True):
                results[at] = result
    return results


def quantiles(values: np.ndarray, *shares: float) -> tuple[Any, ...]:
    """Quantiles (…) of the numbers in rows (…, n), one for each share, NaN where there are none.

    What is no number is passed over.  NumPy's own functions do this row by row.
    """
    ordered = np.sort(values, axis=-1).reshape(-1, values.shape[-1])
    last = ordered.shape[1] - 1 - np.count_nonzero(np.isnan(ordered), axis=1)
    row = np.arange(last.size)

    def quantile(share: float) -> Any:
        """The value at a share of the way, on the line between its neighbours."""
        place = share * last
        lower = np.floor(place).astype(int)
        low, high = ordered[row, lower], ordered[row, np.ceil(place).astype(int)]
        return (low + (place - lower) * (high - low)).reshape(values.shape[:-1])[()]

    return tuple(quantile(share) for share in shares)
