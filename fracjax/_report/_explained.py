r"""How much of a residual each candidate would explain: a curve beside it.

With r the residual of the base model at θ̂, J its derivatives and d_k the change of the response by
an effect at one of its typical values,

    r ≈ J b + a d_k

is solved by least squares over the samples that count, and J b + a d_k is the curve, at the value
that explains most.  The base model's parameters are thus moved along, to first order.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._computing import computing
from .._diagnose import Candidate, Diagnosis, entry_of
from .._fit import Fit

MOST_CANDIDATES = 4
"""Candidates whose curves are drawn."""
_STEP = 1e-4
"""Step of the derivatives, as a share of a parameter: their error is of that order."""


def drawn_candidates(diagnosis: Diagnosis) -> list[Candidate]:
    """The candidates to draw: the named effects with their look-alikes, then those of the highest
    score."""
    named = [n for e in diagnosis.effects for n in (e.name, *e.confusable_with)]
    ranks = {name: rank for rank, name in reversed(list(enumerate(named)))}
    ordered = sorted(diagnosis.candidates, key=lambda c: (ranks.get(c.name, len(named)), -c.score))
    return ordered[:MOST_CANDIDATES]


def explained_by(fit: Fit, index: int, names: Sequence[str]) -> list[np.ndarray]:
    """For each effect the part (N,) of one recording's residual that it would explain."""
    take = fit.preparation.takes[index]
    model = fit.models[index] if fit.models else fit.model
    used, residual = take.used, fit.residuals[index]
    with computing():
        problem = fit.preparation.problems()[index]
        drive = np.asarray(problem.drive)

        def sampled(fine: np.ndarray) -> np.ndarray:
            return np.asarray(fine)[:: problem.oversampling][: residual.size]

        fine = np.asarray(model.block.respond(drive, problem.grid))
        columns = [np.ones(residual.size)]
        for name, parameter in model.parameters.items():
            value = np.asarray(parameter.value)
            if value.ndim == 0 and value != 0:
                moved = model.with_values({name: value * (1 + _STEP)})
                change = np.asarray(moved.block.respond(drive, problem.grid)) - fine
                columns.append(sampled(change))
        curves = []
        for name in names:
            effect = entry_of(name)
            trials = effect.trials(fit.preparation.setting)
            changed = [effect.respond(model.block, t, drive, fine, problem.grid) for t in trials]
            changes = [np.nan_to_num(sampled(response - fine)) for response in changed]
            candidates = [_nearest(residual, [*columns, change], used) for change in changes]
            curves.append(min(candidates, key=lambda c: float(np.sum((residual - c)[used] ** 2))))
    return curves


def _nearest(residual: np.ndarray, columns: Sequence[np.ndarray], used: np.ndarray) -> np.ndarray:
    """The combination (N,) of columns that is nearest to a residual (N,) where samples count."""
    matrix = np.stack(columns, axis=1)
    matrix = matrix / np.maximum(np.linalg.norm(matrix[used], axis=0), np.finfo(float).tiny)
    weights = np.linalg.lstsq(matrix[used], residual[used], rcond=1e-10)[0]
    return matrix @ weights
