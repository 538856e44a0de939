"""How a recording began: which of two pasts its fits make likelier."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from ._autoregression import autoregression
from ._preparation import Preparation
from ._solve import Solved

_BEYOND_DOUBT = 10.0


class _Left(NamedTuple):
    """What two fits leave of a recording (N,), one from a constant past, one from another; and how
    either changes from cycle to cycle, where the other past is that of steady cycles."""

    constant: np.ndarray
    other: np.ndarray
    changes: tuple[np.ndarray, np.ndarray] | None


def is_likelier(
    other: Solved, alternative: Preparation, solved: Solved, preparation: Preparation
) -> bool:
    """Whether recordings rather began as the alternative has it than from a constant past.

    Of a drive that comes again it is asked what one cycle changes to the next, for there nothing
    shows that a law misses in every cycle: steady cycles change by no more than noise, in its own
    colour, and a constant past must foretell the changes better beyond doubt.  Else the mean square
    residual decides, of a jump that of the settling samples too.
    """
    left = _left(other, alternative, solved, preparation)
    changes = [one.changes for one in left if one.changes is not None]
    if not changes:
        constant, other_ = (
            float(np.mean(np.concatenate(parts) ** 2))
            for parts in ([one.constant for one in left], [one.other for one in left])
        )
        return other_ < constant
    taps = autoregression([constant for constant, _ in changes])[0]
    lost = taps.size - 1
    constant, steady = (
        np.concatenate([np.asarray(lfilter(taps, 1.0, change))[lost:] for change in of_one])
        for of_one in zip(*changes, strict=True)
    )
    return constant.size * float(np.sum(steady**2) / np.sum(constant**2) - 1) < _BEYOND_DOUBT


def _left(
    other: Solved, alternative: Preparation, solved: Solved, preparation: Preparation
) -> list[_Left]:
    """Of each recording, where both pasts are put to the test: of steady cycles whole ones, and
    without the one that a constant past leaves out."""
    found = []
    for take, taken, *simulations in zip(
        preparation.takes, alternative.takes, solved.simulations, other.simulations, strict=True
    ):
        response = take.recording.response[: len(taken.recording)]
        constant, changed = (response - s[: response.size] for s in simulations)
        steady = taken.history == "periodic" and taken is not take
        period = take.period if steady else None
        start = take.settling if steady else 0
        changes = (
            None
            if period is None
            else (constant[period:] - constant[:-period], changed[period:] - changed[:-period])
        )
        found.append(_Left(constant[start:], changed[start:], changes))
    return found
