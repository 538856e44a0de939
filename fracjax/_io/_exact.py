"""Stamps of more digits than a float64 holds, as differences that lose none."""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pyarrow as pa

from fracjax._io._table import Exact

_SAFE = 2**53
_PLACES = 12


def exact_of(counts: np.ndarray) -> Exact | None:
    """Whole numbers (N,) as their differences from the first; None where float64 holds them."""
    if not counts.size or max(abs(int(counts.min())), abs(int(counts.max()))) < _SAFE // 1024:
        return None
    first = int(counts[0])
    if counts.dtype.kind == "u":
        ahead = counts >= counts[0]
        rest = np.where(ahead, counts - counts[0], counts[0] - counts).astype(np.float64)
        return Exact(np.where(ahead, rest, -rest), Fraction(first))
    return Exact((counts - counts.dtype.type(first)).astype(np.float64), Fraction(first))


def exact_of_text(cells: Sequence[str] | pa.ChunkedArray, decimal: str) -> Exact | None:
    """Cells of plain decimals (N,) as their differences from the first; None where there are
    others."""
    from pyarrow import compute

    texts: pa.ChunkedArray = (
        cells if isinstance(cells, pa.ChunkedArray) else pa.chunked_array([pa.array(cells)])
    )
    try:
        if decimal != ".":
            options = compute.ReplaceSubstringOptions(decimal, ".")
            texts = compute.call_function("replace_substring", [texts], options)
        numbers = texts.cast(pa.decimal128(36, _PLACES))
    except pa.ArrowInvalid:
        return None
    first = numbers[0]
    rest = compute.call_function("subtract", [numbers, first]).cast(pa.float64())
    return Exact(rest.to_numpy(), Fraction(first.as_py()))
