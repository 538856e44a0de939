"""Compiled programs are forgotten before a process runs out of memory maps."""

from __future__ import annotations

import time
from functools import lru_cache
from pathlib import Path

import jax

_MAPS, _LIMIT = Path("/proc/self/maps"), Path("/proc/sys/vm/max_map_count")


def make_room() -> None:
    """Forget compiled programs once they fill half of what Linux grants a process.

    XLA maps every compiled program into memory some fifty times; past the limit its compiler ends
    the process.  A diagnosis takes about 10,000 of the usual 65,530 maps.  Looked at once a second
    at most: to look takes as long as a simulation.
    """
    _look(int(time.monotonic()))


@lru_cache(maxsize=1)
def _look(second: int) -> None:
    if not (_MAPS.exists() and _LIMIT.exists()):
        return
    used = _MAPS.read_bytes().count(b"\n")
    if used > int(_LIMIT.read_text()) // 2:
        jax.clear_caches()
