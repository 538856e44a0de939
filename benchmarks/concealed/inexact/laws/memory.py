"""Return-point memory: laws whose branches all follow one function of two turning points.

    f = f_1 + E(x, x_1) rising from a turning point (x_1, f_1),  f = f_1 - E(x_1, x) falling

A branch that passes the turning point before last closes that minor loop, which is wiped out, and
goes on along the branch that the loop had interrupted (Madelung's rules).  Minor loops between the
same two drives are congruent.  Source: E. Madelung, Annalen der Physik 322 (1905) 861; I. D.
Mayergoyz, Mathematical Models of Hysteresis (1991), chapter 1.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ...drives import Array
from ...truth.branches import branches
from .law import FURTHEST

Everett = Callable[[Array, Array], Array]  # of the higher and the lower drive


def along(x: Array, everett: Everett) -> Array:
    """Output along a path that rose from -FURTHEST, where it was 0, to its first value.

    Args:
        x: Path of the drive, within -FURTHEST to FURTHEST.
        everett: Change of the output between a turning point and a drive, both as arrays.

    Returns:
        Output at every point of the path.
    """
    ends, ways = branches(x)
    out = np.empty_like(x)
    open_turns = [(-FURTHEST, 0.0)]
    out[0] = everett(x[:1], np.full(1, -FURTHEST))[0]
    way = 1.0
    for (first, last), turn in zip(pairwise(ends.tolist()), ways, strict=True):
        if turn == 0:
            out[first + 1 : last + 1] = out[first]
            continue
        if turn != way:
            open_turns.append((float(x[first]), float(out[first])))
            way = turn
        at = first + 1
        while at <= last:
            x1, f1 = open_turns[-1]
            bound = open_turns[-2][0] if len(open_turns) > 1 else way * np.inf
            rest = x[at : last + 1]
            n = int(np.searchsorted(way * rest, way * bound, side="right"))
            here, turns = rest[:n], np.full(n, x1)
            change = everett(here, turns) if way > 0 else everett(turns, here)
            out[at : at + n] = f1 + way * change
            at += n
            if at <= last:
                del open_turns[-2:]
    return out
