"""The tests of a fit's residual."""

from __future__ import annotations

from .._recording import require_kind
from ._result import Fit
from ._whiteness import ResidualAnalysis, analyses_of


def analyse_residuals(fit: Fit) -> tuple[ResidualAnalysis, ...]:
    """The tests for each of a fit's recordings, over the samples that count.

    They use the residual whitened by the noise, which is dimensionless: 1 is one standard
    deviation.

    Args:
        fit: the fit.

    Returns:
        One analysis per recording.

    Raises:
        InputError: where `fit` is no fit.

    Source: Ljung, System Identification (1999) section 16.6.
    """
    require_kind(fit, Fit, "fit", "fit a model first")
    return analyses_of(fit.preparation, fit.residuals)
