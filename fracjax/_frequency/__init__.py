"""Frequency responses: tables, fits of linear models to them, and creep from amplitude ratios."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._amplitude_ratios import AmplitudeRatios as AmplitudeRatios
    from ._amplitude_ratios import amplitude_ratios as amplitude_ratios
    from ._best_linear import LinearApproximation as LinearApproximation
    from ._best_linear import best_linear_approximations as best_linear_approximations
    from ._creep_estimates import CreepEstimate as CreepEstimate
    from ._creep_identification import CreepIdentification as CreepIdentification
    from ._creep_identification import ofocim as ofocim
    from ._creep_identification import tfocim as tfocim
    from ._fit import FrequencyFit as FrequencyFit
    from ._fit import fit_frequency_response as fit_frequency_response
    from ._table import FrequencyTable as FrequencyTable
    from ._table import frequency_table as frequency_table
    from ._table import read_frequency_table as read_frequency_table

__getattr__, __dir__ = attach(__name__)
