"""The signals that span the responses of a stack's rows to their drives."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import iadd

import jax
import numpy as np
from scipy.linalg import get_lapack_funcs

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import named_parameters
from .._prepare import Problem, layout_of
from ._chains import chains_of
from ._compressed import Part, parts_of
from ._interpolation import SPANNED
from ._lockstep import Stack
from ._span import ChainSignals, span_of_drives
from ._transformed import AT_ONCE

_SPANNED = 1e-9
"""The shapes of a stack end where all others are in the span to this share of their size: far
enough below any sensor's noise, in fewer shapes than to rounding.  Where a block has several shapes
they end at rounding, and the circle is a long one: its signals are many and nearly alike, and their
combinations raised errors by two to four orders of magnitude, measured on LFDH."""
_ROUGHLY_SPANNED = 1e-6
"""The same where the signals only serve a search, whose end is the start of a descent on the full
model: less than a standard error, in half the shapes.  Chosen by judgement."""
LARGEST = 2**21
"""Most numbers in all that drives the chains of a stack, which limits memory.  Chosen by
judgement."""
_PANEL = 8
"""Columns that a QR takes at once, which of thirty takes two thirds of LAPACK's usual time."""
_KEPT = 4
"""Spans that are kept: those of two histories, and of two finer grids."""


@dataclass(frozen=True, eq=False)
class DriveSignals:
    """The n signals of each of d drives.

    Attributes:
        key: equal for equal blocks and grids.
        places: the index of each drive, by its content.
        parts: per chain, with matrices (1, J, n) from its coefficients to factors of the signals.
        chains: per chain, its signals.
        whole: the signals (n, L) of a drive that several rows share, by its index.
    """

    key: tuple
    places: dict[bytes, int]
    parts: tuple[Part, ...]
    chains: tuple[ChainSignals, ...]
    whole: dict[int, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Signals:
    """The n signals of each of R rows.

    Attributes:
        of_drives: those of all drives.
        drives: (R,) the index of each row's drive.
    """

    of_drives: DriveSignals
    drives: np.ndarray

    @property
    def parts(self) -> tuple[Part, ...]:
        """Per chain, with matrices (1, J, n) from its coefficients to factors of the signals."""
        return self.of_drives.parts

    @property
    def chains(self) -> tuple[ChainSignals, ...]:
        """Per chain, its signals."""
        return self.of_drives.chains

    @property
    def total(self) -> int:
        """The number n of signals of all chains."""
        return sum(chain.total for chain in self.chains)

    @property
    def shared(self) -> bool:
        """Whether all of several rows have the same signals."""
        return len(self.drives) > 1 and not np.any(self.drives != self.drives[0])

    def fill(self, row: int, signals: np.ndarray) -> None:
        """Write the signals (n, L) of a row."""
        if self.shared:
            signals[:] = self._of_all
        else:
            self._compute(row, signals)

    def _compute(self, row: int, signals: np.ndarray) -> None:
        """Compute the signals (n, L) of a row."""
        place = 0
        for chain in self.chains:
            chain.fill(int(self.drives[row]), signals[place : place + chain.total])
            place += chain.total

    @property
    def _of_all(self) -> np.ndarray:
        """The signals (n, L) that all rows share, computed once."""
        drive, whole = int(self.drives[0]), self.of_drives.whole
        if drive not in whole:
            signals = np.empty((self.total, self.chains[0].samples))
            self._compute(0, signals)
            whole[drive] = signals
        return whole[drive]

    def mix(self, rows: slice, factors: np.ndarray) -> np.ndarray:
        """Sums (r, m, L) of the signals of r rows, by factors (r, m, n)."""
        if self.shared:
            return factors @ self._of_all
        ends, drives = np.cumsum([chain.total for chain in self.chains])[:-1], self.drives[rows]
        pieces = zip(np.split(factors, ends, axis=-1), self.chains, strict=True)
        return reduce(iadd, (chain.mix(drives, piece) for piece, chain in pieces))

    def respond(self, factors: np.ndarray) -> np.ndarray:
        """The responses (R, L) of all rows, by factors (R, n) of their signals."""
        parts = [slice(at, at + AT_ONCE) for at in range(0, len(factors), AT_ONCE)]
        return np.concatenate([self.mix(part, factors[part, None])[:, 0] for part in parts])


_spans: deque[DriveSignals] = deque(maxlen=_KEPT)


def signals_of(
    block: AbstractBlock, problems: Sequence[Problem], roughly: bool = False
) -> Signals | None:
    """The signals of a stack's rows, that only a search needs or not; None where too many would be
    needed.

    Those of the last few stacks are kept: of their rows some are solved again under another noise,
    or on a grid on which they were compared, and the next stack may have the same drive.
    """
    like, contents = problems[0], [np.asarray(problem.drive).tobytes() for problem in problems]
    key = (*kind_of(block), roughly, like.grid.history, float(like.grid.step), like.oversampling)
    sizes = like.drive.size, like.response.size
    for kept in tuple(_spans):
        if kept.key == (*key, *sizes) and kept.places.keys() >= set(contents):
            return Signals(kept, np.array([kept.places[content] for content in contents]))
    places = {content: at for at, content in enumerate(dict.fromkeys(contents))}
    chains = chains_of(block)
    assert chains is not None  # can_stack has checked it
    drives = np.stack([np.frombuffer(content) for content in places])
    blocks = [each for chain in chains for each in (chain.before, chain.after) if each is not None]
    few = all(len(layout_of(each).shapes) < 2 for each in blocks)
    spanned = _ROUGHLY_SPANNED if roughly else _SPANNED if few else SPANNED
    span = span_of_drives(chains, drives.T, like, spanned, short=few or roughly)
    if span is None:
        return None
    chosen, signals = span
    factors = parts_of(chosen, np.eye(sum(chain.total for chain in signals)))
    parts = (Part(part.before, part.after, np.asarray(part.matrix)[None]) for part in factors)
    of_drives = DriveSignals((*key, *sizes), places, tuple(parts), tuple(signals))
    if drives.size <= LARGEST:
        _spans.append(of_drives)
    return Signals(of_drives, np.array([places[content] for content in contents]))


def kind_of(block: AbstractBlock) -> tuple:
    """Equal for blocks of one structure, with the same bounds and fixed parameters."""
    fixed = []
    for parameter in named_parameters(block).values():
        fixed += [parameter.lower, parameter.upper, *([parameter.value] * parameter.fixed)]
    return jax.tree_util.tree_structure(block), tuple(map(float, fixed))


def triangles_of(problems: Sequence[Problem], signals: Signals) -> np.ndarray:
    """The triangles (R, K, K) of whitened own terms, signals and response of each row.

    Rows that share drive and whitening share one QR, followed by a projection each.
    """
    (geqrt,) = get_lapack_funcs(("geqrt",), dtype=np.float64)
    groups: dict[tuple, list[int]] = {}
    for row, problem in enumerate(problems):
        filters = (np.asarray(problem.weights).tobytes(), np.asarray(problem.whitening).tobytes())
        groups.setdefault(filters if signals.shared else (row,), []).append(row)
    first = problems[0]
    count = first.own.shape[1] + signals.total + 1
    triangles = np.zeros((len(problems), count, count))
    for rows in groups.values():
        problem = problems[rows[0]]
        own = problem.own.shape[1]
        terms = np.empty((own + signals.total + len(rows), len(problem.response)))
        terms[:own] = np.asarray(problem.own).T
        signals.fill(rows[0], terms[own : own + signals.total])
        for response, row in zip(terms[own + signals.total :], rows, strict=True):
            response[:] = problems[row].response
        columns = problem.whiten(terms.T)
        if len(rows) == 1:
            panel = min(_PANEL, *columns.shape)
            upper = np.triu(geqrt(panel, columns, overwrite_a=1)[0][:count])
            triangles[rows[0], : len(upper)] = upper  # fewer rows where samples are fewer
            continue
        basis, triangle = np.linalg.qr(columns[:, : count - 1])
        along = basis.T @ columns[:, count - 1 :]
        outside = np.linalg.norm(columns[:, count - 1 :] - basis @ along, axis=0)
        size = len(triangle)
        triangles[rows, :size, : count - 1] = triangle
        triangles[rows, :size, -1], triangles[rows, -1, -1] = along.T, outside
    return triangles


def stack_of(signals: Signals, triangles: np.ndarray, own: int, grid: Grid) -> Stack:
    """The rows' problems from their triangles (R, K, K), of which `own` columns are own terms."""
    columns = triangles[:, own:, own:-1].swapaxes(1, 2)  # (R, n, m)
    parts = (Part(p.before, p.after, p.matrix @ columns) for p in signals.parts)
    return Stack(tuple(parts), triangles[:, own:, -1], grid)
