"""Which physics a machine's model leaves out inside its dynamics."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._columns import Columns as Columns
    from ._columns import columns_of as columns_of
    from ._inquire import inquire_inside as inquire_inside
    from ._posterior import About as About
    from ._posterior import Worth as Worth
    from ._predict import error_on as error_on
    from ._result import Candidate as Candidate
    from ._result import Inside as Inside

__getattr__, __dir__ = attach(__name__)
