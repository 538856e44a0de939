"""Samples that are no numbers: where they are allowed, and how they are marked."""

import re
from collections.abc import Sequence

import numpy as np

from fracjax._io._table import Table, column_label
from fracjax._recording import InputError, parse_quantity, spikes

Mask = str | Sequence[str | tuple[float, float]] | None
"""Times [s] from the first sample that are left out, or "bad" for whatever is no number."""
BAD = "bad"


def is_bad_masked(mask: Mask) -> bool:
    """Whether all bad samples are to be left out."""
    return BAD in ([mask] if isinstance(mask, str) else mask or [])


def spans_of(mask: Mask) -> list[tuple[float, float]]:
    """The times [s] of a mask.  Raises InputError where one is none."""
    spans = []
    for one in [mask] if isinstance(mask, str) else mask or []:
        if one == BAD:
            continue
        if not isinstance(one, str):
            spans.append((float(one[0]), float(one[1])))
            continue
        ends = re.split(r"\.\.", one)
        if len(ends) != 2:
            raise InputError.at("--mask", 'a time such as "3 s..4 s"', f'"{one}"', "correct it")
        first, last = (parse_quantity(end, "s", "--mask") for end in ends)
        spans.append((first, last))
    return spans


def within(mask: Mask, times: np.ndarray, step: float) -> np.ndarray:
    """Which of the times (N,), from the first sample on, a mask leaves out for being bad."""
    if is_bad_masked(mask):
        return np.ones(len(times), bool)
    inside = np.zeros(len(times), bool)
    for start, stop in spans_of(mask):
        inside |= (times >= start - 1e-6 * step) & (times <= stop + 1e-6 * step)
    return inside


def require_masked(
    table: Table,
    column: int,
    rows: slice,
    values: np.ndarray,
    allowed: np.ndarray,
    times: np.ndarray,
) -> None:
    """Raise `InputError` at the first sample of a stretch that is no number and not masked."""
    bad = ~np.isfinite(values)
    open_ = bad & ~allowed
    if not open_.any():
        return
    row = int(open_.argmax())
    beyond = np.isinf(values[row])
    count = int(np.count_nonzero(np.isinf(values) if beyond else np.isnan(values)))
    shown = table.about(column).shown((rows.start or 0) + row)
    kind = "a number" if not beyond and not _is_code(shown) else "a finite number"
    last = int(np.flatnonzero(bad)[-1])
    description = shown
    if count > 1:
        what = "beyond the range, clipped" if beyond else "no numbers"
        description += (
            f", one of {count} that are {what} from {times[row]:.4g} to {times[last]:.4g} s"
        )
    elif beyond:
        description += ", beyond the range"
    raise InputError.at(
        table.about(column).place((rows.start or 0) + row),
        kind,
        description,
        "correct it, or give --mask bad to leave such samples out",
    )


def _is_code(shown: str) -> bool:
    from fracjax._io._numbers import code_of

    inner = shown.strip('"')
    return bool(inner) and code_of(inner) is not None


def note_on(table: Table, role: str, column: int, lost: np.ndarray, times: np.ndarray) -> str:
    """The note on samples that are left out, of which there are some."""
    at = times[int(lost.argmax())]
    label = f"{table.source}, {column_label(table.names, column)}"
    note = f"{label}: {int(lost.sum())} samples are left out, the first at {at:.6g} s."
    if role == "input":
        note += (
            " The drive was bridged by straight lines there: what the actuator remembers of "
            "it is not known."
        )
    return note


def with_spikes(mask: Mask, response: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """The bad samples, with the spikes of a response (N,) where all bad ones are left out."""
    if not is_bad_masked(mask):
        return bad
    return bad | spikes(np.where(np.isfinite(response), response, np.nan))
