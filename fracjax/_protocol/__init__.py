"""A drive that can tell: designed within limits, whatever the law of hysteresis."""

from typing import TYPE_CHECKING

from .._lazy import attach

if TYPE_CHECKING:
    from ._drive import Drive as Drive
    from ._drive import Part as Part
    from ._drive import corners_rounded as corners_rounded
    from ._limits import Limits as Limits
    from ._limits import parse_limits as parse_limits
    from ._limits import recorded_limits as recorded_limits
    from ._protocol import ASKED as ASKED
    from ._protocol import completed as completed
    from ._protocol import protocol as protocol
    from ._reading import Reading as Reading
    from ._reading import readings_of as readings_of
    from ._result import Protocol as Protocol
    from ._signals import MOST as MOST
    from ._signals import as_read as as_read
    from ._signals import recorded_signal as recorded_signal

__getattr__, __dir__ = attach(__name__)
