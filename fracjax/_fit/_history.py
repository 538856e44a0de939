"""The start of a recording: which of two prior histories its fits support."""

from __future__ import annotations

import numpy as np

from .._filters import moving_sum
from .._prepare import autoregression
from .._solve import Solved

_SIGNIFICANT = 10.0
"""Increase of n times the relative mean square that is significant: as a rise of χ² by 10, which is
a likelihood ratio of e^5.  Chosen by judgement."""


def prefers_other_history(other: Solved, solved: Solved) -> bool:
    """Whether the other fit's history is more likely than the fit's constant one.

    If the drive repeats, the comparison uses the change of the residual from one cycle to the next,
    from which a model error that is equal in every cycle cancels.  Steady cycles change only by
    noise, in its own colour.  The constant history must predict the changes significantly better,
    by more than `_SIGNIFICANT` in the normalised squares, to be kept.  Otherwise the mean square
    residual decides; if the other history is a jump at the start, the settling samples count too.
    """
    residuals, changes = [], []
    for take, other_take, *simulations in zip(
        solved.preparation.takes,
        other.preparation.takes,
        solved.simulations,
        other.simulations,
        strict=True,
    ):
        # Steady cycles are cut to whole periods.
        response = take.recording.response[: len(other_take.recording)]
        both = [response - simulation[: response.size] for simulation in simulations]
        steady = other_take.history == "periodic"
        residuals.append([error[take.settling if steady else 0 :] for error in both])
        if steady and take.period is not None:
            changes.append([error[take.period :] - error[: -take.period] for error in both])
    if not changes:
        errors = [
            np.mean(np.concatenate(errors_of_one) ** 2)
            for errors_of_one in zip(*residuals, strict=True)
        ]
        return bool(errors[1] < errors[0])
    taps = autoregression([constant for constant, _ in changes])[0]
    filtered = slice(taps.size - 1, None)
    constant, periodic = (
        np.concatenate([moving_sum(taps, change)[filtered] for change in changes_of_one])
        for changes_of_one in zip(*changes, strict=True)
    )
    return constant.size * float(np.sum(periodic**2) / np.sum(constant**2) - 1) < _SIGNIFICANT
