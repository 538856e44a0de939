"""fracjax: which physical effects a simulation of a piezoelectric actuator left out, and how large.

- `read` returns a `Recording`: drive and response in uniform time steps, with their units.
- `fit` fits a `Model` to it, by its name (`MODELS`, `parse_model`) or composed of `blocks`.
- `diagnose` states whether, where and why the two differ, and which of the `EFFECTS` explains it.
- `protocol` designs a drive that shows which dynamics an actuator has, to be recorded first.
- `sample_posterior` samples the posterior of the parameters; `compensate` computes the drive for a
  desired motion.
- `fit_batch` fits many recordings; `write_report` writes any result as one HTML file.
- `fetch_recording` downloads real recordings (`RECORDINGS`); `operators` holds fractional calculus.

All computations use float64, which the functions enable for themselves.  Invalid input raises an
`InputError` of one sentence: where, what was expected, what was found, and the remedy.
"""

from typing import TYPE_CHECKING

from ._lazy import attach

if TYPE_CHECKING:
    from . import _blocks as blocks
    from . import _operators as operators
    from ._batch import fit_batch as fit_batch
    from ._blocks import EFFECTS as EFFECTS
    from ._blocks import AbstractBlock as AbstractBlock
    from ._blocks import AbstractLinearBlock as AbstractLinearBlock
    from ._blocks import Effect as Effect
    from ._blocks import bode as bode
    from ._blocks import frequency_response as frequency_response
    from ._blocks import poles as poles
    from ._blocks import step_response as step_response
    from ._compensate import Compensation as Compensation
    from ._compensate import Trajectory as Trajectory
    from ._compensate import compensate as compensate
    from ._compensate import load_compensation as load_compensation
    from ._crosscheck import Crosscheck as Crosscheck
    from ._crosscheck import crosscheck as crosscheck
    from ._diagnose import Diagnosis as Diagnosis
    from ._diagnose import diagnose as diagnose
    from ._fit import Combination as Combination
    from ._fit import Comparison as Comparison
    from ._fit import Estimate as Estimate
    from ._fit import Fit as Fit
    from ._fit import LinearSystem as LinearSystem
    from ._fit import Profile as Profile
    from ._fit import ResidualAnalysis as ResidualAnalysis
    from ._fit import analyse_residuals as analyse_residuals
    from ._fit import compare as compare
    from ._fit import fit as fit
    from ._fit import load_model as load_model
    from ._fit import profile as profile
    from ._fit import with_profiles as with_profiles
    from ._frequency import AmplitudeRatios as AmplitudeRatios
    from ._frequency import CreepIdentification as CreepIdentification
    from ._frequency import FrequencyFit as FrequencyFit
    from ._frequency import FrequencyTable as FrequencyTable
    from ._frequency import LinearApproximation as LinearApproximation
    from ._frequency import amplitude_ratios as amplitude_ratios
    from ._frequency import best_linear_approximations as best_linear_approximations
    from ._frequency import fit_frequency_response as fit_frequency_response
    from ._frequency import frequency_table as frequency_table
    from ._frequency import ofocim as ofocim
    from ._frequency import read_frequency_table as read_frequency_table
    from ._frequency import tfocim as tfocim
    from ._io import read as read
    from ._io import write as write
    from ._models import MODELS as MODELS
    from ._models import Model as Model
    from ._models import parse_model as parse_model
    from ._operators import Grid as Grid
    from ._operators import derivative as derivative
    from ._parameters import Parameter as Parameter
    from ._posterior import ARNoise as ARNoise
    from ._posterior import MeasuredNoise as MeasuredNoise
    from ._posterior import Posterior as Posterior
    from ._posterior import PosteriorPrediction as PosteriorPrediction
    from ._posterior import StudentNoise as StudentNoise
    from ._posterior import WhiteNoise as WhiteNoise
    from ._posterior import load_posterior as load_posterior
    from ._posterior import sample_posterior as sample_posterior
    from ._prepare import Noise as Noise
    from ._prepare import Normal as Normal
    from ._protocol import Protocol as Protocol
    from ._protocol import protocol as protocol
    from ._recording import InputError as InputError
    from ._recording import Recording as Recording
    from ._recording import joined as joined
    from ._registry import RECORDINGS as RECORDINGS
    from ._registry import fetch_recording as fetch_recording
    from ._report import write_report as write_report
    from ._simulate import Simulation as Simulation
    from ._simulate import simulate as simulate
    from ._streaming import Adaptation as Adaptation
    from ._streaming import Promise as Promise
    from ._streaming import Promised as Promised
    from ._streaming import StreamingInverse as StreamingInverse
    from ._streaming import StreamingModel as StreamingModel
    from ._streaming import streaming_inverse as streaming_inverse
    from ._streaming import streaming_model as streaming_model

__version__ = "0.1.0"

__all__ = [
    "EFFECTS",
    "MODELS",
    "RECORDINGS",
    "ARNoise",
    "AbstractBlock",
    "AbstractLinearBlock",
    "Adaptation",
    "AmplitudeRatios",
    "Combination",
    "Comparison",
    "Compensation",
    "CreepIdentification",
    "Crosscheck",
    "Diagnosis",
    "Effect",
    "Estimate",
    "Fit",
    "FrequencyFit",
    "FrequencyTable",
    "Grid",
    "InputError",
    "LinearApproximation",
    "LinearSystem",
    "MeasuredNoise",
    "Model",
    "Noise",
    "Normal",
    "Parameter",
    "Posterior",
    "PosteriorPrediction",
    "Profile",
    "Promise",
    "Promised",
    "Protocol",
    "Recording",
    "ResidualAnalysis",
    "Simulation",
    "StreamingInverse",
    "StreamingModel",
    "StudentNoise",
    "Trajectory",
    "WhiteNoise",
    "amplitude_ratios",
    "analyse_residuals",
    "best_linear_approximations",
    "blocks",
    "bode",
    "compare",
    "compensate",
    "crosscheck",
    "derivative",
    "diagnose",
    "fetch_recording",
    "fit",
    "fit_batch",
    "fit_frequency_response",
    "frequency_response",
    "frequency_table",
    "joined",
    "load_compensation",
    "load_model",
    "load_posterior",
    "ofocim",
    "operators",
    "parse_model",
    "poles",
    "profile",
    "protocol",
    "read",
    "read_frequency_table",
    "sample_posterior",
    "simulate",
    "step_response",
    "streaming_inverse",
    "streaming_model",
    "tfocim",
    "with_profiles",
    "write",
    "write_report",
]


__getattr__, __dir__ = attach(__name__)
