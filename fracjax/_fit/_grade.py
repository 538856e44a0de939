"""How far a fit describes its recordings, in words that depend on what was found."""

from __future__ import annotations

from collections.abc import Sequence

FAR_ABOVE_NOISE = 3.0
"""Noise floors from which on an error is mostly mismatch, nine parts of ten of its square."""
_LEAST_SHARE = 0.5
"""Least share of the response's variance that a model explains which describes it."""


def shortcomings_of(
    rmse: float, noise: float, r_squared: float, at_bound: Sequence[str]
) -> tuple[str, ...]:
    """Why a model does not describe what it was fitted to, as clauses; empty where it does.

    Args:
        rmse: the error of the fit, in the response's unit.
        noise: the noise floor, in the same unit.
        r_squared: the share of the response's variance that the model explains.
        at_bound: names of the parameters that ended on a bound.

    Returns:
        The clauses, the gravest first.
    """
    clauses = []
    if r_squared <= 0:
        clauses.append("it is no closer to the response than a constant")
    elif is_useless(r_squared):
        clauses.append(f"it explains only {100 * r_squared:.2g} % of the response's variance")
    if rmse > FAR_ABOVE_NOISE * noise:
        clauses.append(f"its error is {rmse / noise:.3g} times the noise floor")
    if at_bound:
        clauses.append(
            f"{' and '.join(at_bound)} ended on {'its' if len(at_bound) == 1 else 'a'} bound"
        )
    return tuple(clauses)


def is_useless(r_squared: float) -> bool:
    """Whether a model explains less than half of the response's variance."""
    return r_squared < _LEAST_SHARE
