"""Compiled programs are discarded before a process runs out of memory maps."""

from __future__ import annotations

import ctypes
import time
from functools import lru_cache
from pathlib import Path

from .._computing import forget_programs

_MAPS, _LIMIT = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")
"""The memory maps of this process, and the largest number that Linux allows."""
_SHARE = 4
"""Programs may fill one in so many of the maps: a process that diagnoses recording after recording
then stays below 2 GB, where one in two took 4."""


def limit_compiled_programs() -> None:
    """Discard compiled programs once they fill a share of the memory maps that Linux grants a
    process.

    XLA maps each compiled program into memory about fifty times; above the limit its compiler ends
    the process.  A diagnosis takes 3,000 to 10,000 of the usual 65,530 maps.  The maps are counted
    at most once a second, because counting takes as long as a simulation.
    """
    _clear_when_full(int(time.monotonic()))


@lru_cache(maxsize=1)
def _clear_when_full(second: int) -> None:
    """Discard compiled programs if they fill their share; computed once per `second`."""
    if not (_MAPS.exists() and _LIMIT.exists()):
        return
    used = _MAPS.read_bytes().count(b"\n")
    if used > int(_LIMIT.read_text()) // _SHARE:
        forget_programs()
        # glibc keeps what is freed, which is most of it, unless told to return it.
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
