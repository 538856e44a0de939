"""How a recording began: which of two pasts its fits make likelier."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from .._prepare import autoregression
from .._solve import Solved

_BEYOND_DOUBT = 10.0


def is_likelier(other: Solved, solved: Solved) -> bool:
    """Whether recordings rather began as the other fit has it than from a constant past.

    Of a drive that comes again it is asked what one cycle changes to the next, for there nothing
    shows that a law misses in every cycle: steady cycles change by no more than noise, in its own
    colour, and a constant past must foretell the changes better beyond doubt.  Else the mean square
    residual decides, of a jump that of the settling samples too.
    """
    left, changes = [], []
    for take, taken, *simulations in zip(
        solved.preparation.takes,
        other.preparation.takes,
        solved.simulations,
        other.simulations,
        strict=True,
    ):
        # Of steady cycles whole ones.
        response = take.recording.response[: len(taken.recording)]
        both = [response - simulation[: response.size] for simulation in simulations]
        steady = taken.history == "periodic"
        left.append([one[take.settling if steady else 0 :] for one in both])
        if steady and take.period is not None:
            changes.append([one[take.period :] - one[: -take.period] for one in both])
    if not changes:
        errors = [np.mean(np.concatenate(of_one) ** 2) for of_one in zip(*left, strict=True)]
        return bool(errors[1] < errors[0])
    taps = autoregression([constant for constant, _ in changes])[0]
    known = slice(taps.size - 1, None)
    constant, steadily = (
        np.concatenate([np.asarray(lfilter(taps, 1.0, change))[known] for change in of_one])
        for of_one in zip(*changes, strict=True)
    )
    return constant.size * float(np.sum(steadily**2) / np.sum(constant**2) - 1) < _BEYOND_DOUBT
