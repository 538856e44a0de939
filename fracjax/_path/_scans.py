"""Modes and lines of the mains that a response shows: their frequencies are scanned."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .._recording import maxima_of
from ._chain import Line
from ._dynamics import MAINS, MODE, Columns, Family, beside_mode, columns_of, modes_of
from ._filters import Shape, highest_of
from ._law import Curve
from ._motion import Motion
from ._signal import ends_of

TWO_MODES = "second_mode"
"""Two modes in parallel, of which one may be too stiff to be seen."""
_PEAKS, _LINES = 6, 3
"""Peaks of a scan for modes that become columns, of each damping, and lines of the mains."""


def lone_mode(line: Line) -> tuple[int, Shape] | None:
    """The place in a chain of its only mode, and the mode's shape: of two of which the other is too
    stiff to be seen, the one that is."""
    highest = min(highest_of(signal.step) for signal in line.signals)
    for k, (effect, shape) in enumerate(line.chain):
        is_stiff = effect == TWO_MODES and shape["frequency"] * shape["ratio"] > highest
        if effect == MODE.effect or is_stiff:
            return k, {name: shape[name] for name in ("frequency", "damping")}
    return None


Whitened = Callable[[np.ndarray], np.ndarray]
"""Signals (ΣN, …) of unit variance."""


def scanned_modes(
    motions: Sequence[Motion], whitened: Whitened, scanned: np.ndarray, family: Family = MODE
) -> list[Columns]:
    """The modes that explain most of a whitened response times the inverse covariance of all that
    is beside them (ΣN,)."""
    chosen = []
    for modes in modes_of(motions, family):
        falls = _falls(modes, whitened, scanned)
        peaks = maxima_of(np.pad(falls, 1)) - 1
        chosen += [modes[k] for k in peaks[np.argsort(-falls[peaks])[:_PEAKS]]]
    return chosen


def modes_behind(
    line: Line, motions: Sequence[Motion], curve: Curve, scanned: np.ndarray
) -> list[Columns]:
    """The modes that explain most behind a chain: behind one mode, another in parallel to it."""
    family, lone = MODE, lone_mode(line)
    if lone is not None:
        before = np.split(curve.before, ends_of(line.signals))
        motions = [m.with_response(own) for m, own in zip(motions, before, strict=True)]
        family = beside_mode(lone[1])
    return scanned_modes(motions, line.prior.whitening, scanned, family)


def scanned_lines(
    motions: Sequence[Motion], whitened: Whitened, scanned: np.ndarray
) -> list[Columns]:
    """The lines of the mains that explain most of it."""
    lines = columns_of(MAINS, motions)
    return [lines[k] for k in np.argsort(-_falls(lines, whitened, scanned))[:_LINES]]


def _falls(shapes: Sequence[Columns], whitened: Whitened, scanned: np.ndarray) -> np.ndarray:
    """About how much of χ² each shape explains: what curves absorb of it, which hardly depends on
    its frequency, is not computed but for the few that are chosen."""
    falls = np.zeros(len(shapes))
    for k, one in enumerate(shapes):
        columns = whitened(one.values)
        along, squares = columns.T @ scanned, np.einsum("nk,nk->k", columns, columns)
        if one.one_sided:
            along = np.maximum(along, 0.0)
        falls[k] = float(np.sum(along**2 / np.maximum(squares, 1e-12)))
    return falls
