"""Of the columns of effects, what path curves do not take for their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from ._chain import IN_SERIES
from ._dynamics import Columns
from ._posterior import Kind

_LEAST = 0.004
"""The least share of an effect that curves leave for it to be one.  Of what was named in 104
development cases and, of the wrong names, in 156 others, all that was there had .43 % and more; of
seven that were not there but for what curves leave six had .31 % and less."""
_CLEAR = 1e-4
"""The smallest singular value of a shape's columns that counts, over the largest."""


def unabsorbed(
    columns: Sequence[Columns], white: np.ndarray, inner: np.ndarray
) -> tuple[list[Columns], np.ndarray]:
    """Shapes without what curves absorb all but a small part of, and the matrix (K, K) that turns
    their columns into that; given the whitened columns (ΣN, K) and their inner products.

    What no knot resolves curves leave of an effect and of the law itself, so that they are alike.
    """
    turns, seen = [], []
    for one, kind in zip(columns, kinds_of(columns), strict=True):
        own = slice(kind.start, kind.stop)
        turn = np.eye(kind.stop - kind.start)
        if one.effect not in IN_SERIES:
            squares, along = np.linalg.eigh(white[:, own].T @ white[:, own])
            clear = squares > _CLEAR**2 * squares.max()
            of_one = along[:, clear] / np.sqrt(squares[clear])
            shares, mixed = np.linalg.eigh(of_one.T @ inner[own, own] @ of_one)
            # Of a single column Q is 1, so that what has one sign keeps it.
            kept = np.linalg.qr(of_one @ mixed[:, shares > _LEAST**2])[0]
            turn = np.pad(kept, ((0, 0), (0, len(turn) - kept.shape[1])))
        turns.append(turn)
        seen.append(one._replace(values=one.values @ turn))
    return seen, np.asarray(block_diag(*turns))


def kinds_of(columns: Sequence[Columns]) -> list[Kind]:
    """The range of each effect's columns in their matrix."""
    kinds, at = [], 0
    for one in columns:
        width = one.values.shape[1]
        kinds.append(Kind(one.effect, at, at + width, one.one_sided))
        at += width
    return kinds
