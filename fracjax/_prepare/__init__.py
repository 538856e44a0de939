"""Recordings prepared for a fit: noise, weights, history, and conditions on parameters."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._autoregression import autoregression as autoregression
    from ._border import history_of as history_of
    from ._border import model_of as model_of
    from ._border import recordings_of as recordings_of
    from ._border import require_recording as require_recording
    from ._border import require_whole_number as require_whole_number
    from ._conditions import Conditions as Conditions
    from ._conditions import FreeParameter as FreeParameter
    from ._conditions import FreeParameters as FreeParameters
    from ._conditions import free_parameters_of as free_parameters_of
    from ._conditions import prior_rows as prior_rows
    from ._keywords import FitOptions as FitOptions
    from ._keywords import ModelOptions as ModelOptions
    from ._keywords import SearchOptions as SearchOptions
    from ._keywords import apply_options as apply_options
    from ._layout import Layout as Layout
    from ._layout import layout_of as layout_of
    from ._layout import own_columns as own_columns
    from ._layout import position_of as position_of
    from ._layout import values_by_name as values_by_name
    from ._layout import with_gains as with_gains
    from ._layout import with_shapes_at as with_shapes_at
    from ._noise import Noise as Noise
    from ._noise import kurtosis_of as kurtosis_of
    from ._noise_sources import MOST_SPENT as MOST_SPENT
    from ._noise_sources import Residual as Residual
    from ._noise_sources import levels_of_residuals as levels_of_residuals
    from ._noise_sources import measured_noise as measured_noise
    from ._noise_sources import noises_below as noises_below
    from ._noise_sources import read_from_residuals as read_from_residuals
    from ._noise_sources import refine_noise as refine_noise
    from ._noise_sources import residual_noises as residual_noises
    from ._normal import ROOT_TWO_PI as ROOT_TWO_PI
    from ._normal import AbstractPrior as AbstractPrior
    from ._normal import Normal as Normal
    from ._normal import float64_array as float64_array
    from ._preparation import Preparation as Preparation
    from ._prepare import prepare as prepare
    from ._prepare import prepare_fit as prepare_fit
    from ._problem import AbstractProblem as AbstractProblem
    from ._problem import Problem as Problem
    from ._setting import setting_of as setting_of
    from ._setting import top_frequency as top_frequency
    from ._spelling import options_for as options_for
    from ._spelling import options_of as options_of
    from ._take import HistoryOption as HistoryOption
    from ._take import Take as Take
    from ._take import alternative_history as alternative_history
    from ._take import begins_in_motion as begins_in_motion
    from ._take import settling_samples as settling_samples
    from ._take import steady_of as steady_of
    from ._take import take_of as take_of
    from ._weights import Mask as Mask

__getattr__, __dir__ = attach(__name__)
