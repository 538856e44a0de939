"""Posteriors: the model's and the noise's parameters sampled by an ensemble of walkers."""

from ._laplace import Laplace as Laplace
from ._laplace import laplace as laplace
from ._likelihood import FullPrediction as FullPrediction
from ._likelihood import Target as Target
from ._likelihood import log_posteriors as log_posteriors
from ._likelihood import physical as physical
from ._likelihood import target_of as target_of
from ._noise_models import AbstractNoiseModel as AbstractNoiseModel
from ._noise_models import ARNoise as ARNoise
from ._noise_models import MeasuredNoise as MeasuredNoise
from ._noise_models import StudentNoise as StudentNoise
from ._noise_models import Term as Term
from ._noise_models import WhiteNoise as WhiteNoise
from ._noise_models import ar_noise_of as ar_noise_of
from ._posterior import sample_posterior as sample_posterior
from ._prior import AbstractPrior as AbstractPrior
from ._prior import Logarithmic as Logarithmic
from ._prior import Normal as Normal
from ._prior import TruncatedNormal as TruncatedNormal
from ._prior import Uniform as Uniform
from ._prior import prior_of as prior_of
from ._result import Band as Band
from ._result import Posterior as Posterior
from ._result import Row as Row
from ._result import load_posterior as load_posterior
from ._sample import split_r_hat as split_r_hat
