"""How results show themselves: numbers, short texts, tables in a notebook, and pictures.

It is the lowest package, so that every result can draw itself: a picture of a fit is beside the
fit, one of a posterior beside the posterior, and the report takes them from there.  `drawing` needs
matplotlib and is imported only where something is drawn.
"""

from ._colours import CANDIDATES as CANDIDATES
from ._colours import COLOURS as COLOURS
from ._forecast import Forecast as Forecast
from ._numbers import figure as figure
from ._numbers import p_value as p_value
from ._numbers import percent as percent
from ._numbers import percentage as percentage
from ._numbers import pretty_unit as pretty_unit
from ._numbers import quantity as quantity
from ._numbers import rounded as rounded
from ._numbers import rounded_edges as rounded_edges
from ._view import Shown as Shown
from ._view import Table as Table
from ._view import Text as Text
from ._view import View as View
from ._view import view_of_tuple as view_of_tuple
