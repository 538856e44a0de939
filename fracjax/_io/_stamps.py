"""Dates and clock times as seconds.

Pandas, which takes long to import, is imported where there are any.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

_BASIC = r"\d{8}T\d{6}(?:[.,]\d{1,9})?"
_CLOCK = r"\d{1,4}:\d{1,2}(?::\d{1,2})?(?:[.,:]\d{1,9})?(?:\s?[AaPp]\.?[Mm]\.?)?"
_DATE = (
    r"(?:\d{4}[-/.年]\d{1,2}[-/.月]\d{1,2}日?|\d{1,2}[-/.]\d{1,2}[-/.](?:\d{4}|\d{2})"
    r"|\d{1,2}[-\s][A-Za-z]{3,9}\.?[-\s,]+\d{2,4}|[A-Za-z]{3,9}\.?\s\d{1,2},?\s\d{4})"
)
_ZONE = r"(?:Z|\s?(?:UTC|GMT)|\s?[-+]\d{2}:?\d{2})?"
_STAMP = re.compile(rf"{_DATE}(?:(?:T|\s|,\s?|_|-)\s*{_CLOCK}{_ZONE})?|{_CLOCK}|{_BASIC}{_ZONE}")
_BARE_CLOCK = re.compile(_CLOCK)
_DAY = 86400.0


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date, a clock time, or both."""
    return _STAMP.fullmatch(cell) is not None


def seconds_of(cells: Sequence[str]) -> tuple[np.ndarray, int | None]:
    """Stamps (N,) as seconds, NaN where one is none, and when their zero is [ns since 1970].

    That is midnight of the first day; of clock times alone None, and midnight adds a day to what
    follows.
    """
    import pandas as pd

    texts = pd.Series([cell.strip() for cell in cells], dtype="object")
    first = next((text for text in texts if text), "")
    if _BARE_CLOCK.fullmatch(first):
        return _unwrapped(_of_clocks(texts)), None
    times = _of_dates(texts)
    if times is None:
        return np.full(len(texts), np.nan), None
    return relative(times)


def relative(times: np.ndarray) -> tuple[np.ndarray, int | None]:
    """Moments (N,) of type datetime64 as seconds from midnight of the first day, and that midnight
    [ns since 1970]."""
    moments = times.astype("datetime64[ns]")
    sound = moments[~np.isnat(moments)]
    if not sound.size:
        return np.full(len(moments), np.nan), None
    midnight = sound[0].astype("datetime64[D]")
    seconds = (moments - midnight).astype(np.float64) / 1e9
    seconds[np.isnat(moments)] = np.nan
    return seconds, int(midnight.astype("datetime64[ns]").astype(np.int64))


def _of_clocks(texts: pd.Series) -> np.ndarray:
    """Clock times as seconds of the day: h:m:s, h:m:s with thousandths behind a third colon, m:s.f
    or h:m."""
    import pandas as pd

    plain = texts.str.replace(",", ".", regex=False)
    plain = plain.str.replace(r"^(\d+:\d+:\d+):(\d+)$", r"\1.\2", regex=True)
    half = plain.str.extract(r"([AaPp])\.?[Mm]\.?$")[0].str.lower()
    parts = plain.str.extract(r"^(\d+):(\d+)(?::(\d+))?(\.\d+)?")
    figures = parts.apply(pd.to_numeric, errors="coerce").to_numpy(np.float64)
    big, middle, small, rest = figures.T
    rest = np.nan_to_num(rest)
    short = np.isnan(small)
    # Of two figures and a fraction the first are minutes.
    minutes_first = short & bool((short & (rest > 0)).any())
    hours = np.where(minutes_first, 0.0, big)
    minutes = np.where(minutes_first, big, middle)
    seconds = np.where(minutes_first, middle, np.nan_to_num(small))
    hours = np.where(half == "p", hours % 12 + 12, np.where(half == "a", hours % 12, hours))
    return 3600 * hours + 60 * minutes + seconds + rest


def _unwrapped(seconds: np.ndarray) -> np.ndarray:
    """Clock times that go on after midnight."""
    steps = np.diff(seconds)
    return seconds + _DAY * np.concatenate([[0], np.cumsum(steps < -_DAY / 2)])


def _of_dates(texts: pd.Series) -> np.ndarray | None:
    """Dates with or without clock times; None where day and month cannot be distinguished and it
    matters."""
    plain = texts.str.replace(r"[年月]", "-", regex=True).str.replace("日", " ", regex=False)
    plain = plain.str.replace(r"(\d:\d{1,2}:\d{1,2})[,:](\d)", r"\1.\2", regex=True)
    plain = plain.str.replace(r"\s+", " ", regex=True).str.strip()
    plain = plain.str.replace(r"^(\d+[-/.]\w+[-/.]\d+)[,_-](?=\s?\d+:)", r"\1 ", regex=True)
    if re.match(r"\d{4}[-/.]|\d{8}T", str(plain.iloc[0])):
        iso = plain.str.replace(r"^(\d{4})[/.](\d{1,2})[/.](\d{1,2})", r"\1-\2-\3", regex=True)
        iso = iso.str.replace(r"^(\d{4})-(\d)-", r"\1-0\2-", regex=True)
        iso = iso.str.replace(r"^(\d{4}-\d{2})-(\d)(?!\d)", r"\1-0\2", regex=True)
        iso = iso.str.replace(r" (\d):", r" 0\1:", regex=True)
        return _parsed(iso, format="ISO8601")
    ways = [_parsed(plain, format="mixed", dayfirst=day_first) for day_first in (True, False)]
    sound = [way for way in ways if way is not None and not np.isnat(way).any()]
    if len(sound) == 2 and not np.array_equal(*(way - way[0] for way in sound)):
        dots = "." in str(plain.iloc[0]).split(" ")[0]
        return sound[0] if dots else None
    return sound[0] if sound else ways[0]


def _parsed(texts: pd.Series, **how) -> np.ndarray | None:
    import pandas as pd

    try:
        moments = pd.to_datetime(texts, errors="coerce", utc=True, **how)
    except (ValueError, TypeError, OverflowError):
        return None
    return moments.dt.tz_localize(None).to_numpy("datetime64[ns]")
