"""The laws that run sample by sample, each in its file, which registers it for its blocks.

A new law is one file and one line here.
"""

from . import bouc_wen, curves, delay, drifts, linear, plays, rate_term  # noqa: F401
from ._section import Sampling as Sampling
from ._section import Section as Section
from ._section import State as State
from ._section import section_of as section_of
from ._section import weighed as weighed
from .delay import LEAD as LEAD
from .delay import lead as lead
from .linear import FAST as FAST
from .linear import Linear as Linear
from .linear import static_gain as static_gain
