"""fracjax: what a simulation of a piezoelectric actuator left out, and by how much."""

from . import _blocks as blocks
from ._blocks import EFFECTS as EFFECTS
from ._blocks import AbstractBlock as AbstractBlock
from ._blocks import AbstractLinearBlock as AbstractLinearBlock
from ._blocks import Effect as Effect
from ._diagnose import Diagnosis as Diagnosis
from ._diagnose import diagnose as diagnose
from ._fit import Estimate as Estimate
from ._fit import Fit as Fit
from ._fit import Noise as Noise
from ._fit import fit as fit
from ._fit import load_model as load_model
from ._io import read as read
from ._models import MODELS as MODELS
from ._models import Model as Model
from ._models import parse_model as parse_model
from ._operators import Grid as Grid
from ._operators import derivative as derivative
from ._parameters import Parameter as Parameter
from ._recording import InputError as InputError
from ._recording import Recording as Recording
from ._report import write_report as write_report

__version__ = "0.1.0"

__all__ = [
    "EFFECTS",
    "MODELS",
    "AbstractBlock",
    "AbstractLinearBlock",
    "Diagnosis",
    "Effect",
    "Estimate",
    "Fit",
    "Grid",
    "InputError",
    "Model",
    "Noise",
    "Parameter",
    "Recording",
    "blocks",
    "derivative",
    "diagnose",
    "fit",
    "load_model",
    "parse_model",
    "read",
    "write_report",
]
