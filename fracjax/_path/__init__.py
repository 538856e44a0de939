"""Path curves: the dynamics of a recording whatever its law of hysteresis, without JAX."""

from ._drive import denoised as denoised
from ._dynamics import Columns as Columns
from ._dynamics import Motion as Motion
from ._law import Inner as Inner
from ._law import Prior as Prior
from ._law import Whitening as Whitening
from ._law import log_likelihood as log_likelihood
from ._posterior import DIRECTIONS as DIRECTIONS
from ._posterior import Hypothesis as Hypothesis
from ._posterior import Kind as Kind
from ._posterior import Law as Law
from ._posterior import Posterior as Posterior
from ._posterior import evidence as evidence
from ._posterior import misfit as misfit
from ._posterior import search as search
from ._posterior import select as select
from ._show import Visible as Visible
from ._show import can_show as can_show
from ._view import PATH as PATH
from ._view import PathView as PathView
from ._view import Signal as Signal
from ._view import apart as apart
from ._view import family_of as family_of
from ._view import kinds_of as kinds_of
from ._view import scanned_modes as scanned_modes
from ._view import view_of as view_of
