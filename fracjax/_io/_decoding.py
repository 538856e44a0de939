"""The text in the bytes of a file."""

import codecs
import re
import shlex
from pathlib import Path

from fracjax._io._files import EXPORT, opened, signature_of
from fracjax._io._units import FOREIGN_UNITS
from fracjax._io._words import FOREIGN_WORDS as _WORDS
from fracjax._recording import InputError

_NO_TEXT = bytes([*range(0x09), 0x0B, *range(0x0E, 0x20), 0x7F])
_FOREIGN = ("gb18030", "shift_jis", "big5", "euc_kr", "euc_jp", "cp1251", "cp1250", "cp850")
_WESTERN = "cp1252"
_SAMPLE = 20_000
_LARGEST = 1_500_000_000
"""Bytes of text that are read: the table takes about four times as much memory."""
FOREIGN_WORDS = sorted({*_WORDS, *FOREIGN_UNITS, "µm", "µs", "µv", "µn", "°", "²", "ω", "√"})


class Text:
    """The bytes of a text file, lines ended by newlines, and how they are to be read."""

    def __init__(self, raw: bytes, encoding: str) -> None:
        self.raw = raw
        self.encoding = encoding

    def decoded(self, stop: int | None = None) -> str:
        """The text, or the whole lines of it before byte `stop`."""
        end = (
            len(self.raw)
            if stop is None or stop >= len(self.raw)
            else self.raw.rfind(b"\n", 0, stop) + 1
        )
        return self.raw[: end or len(self.raw)].decode(self.encoding, "replace")


def text_of(source: str) -> Text:
    """The text of a file: UTF-8, UTF-16 with or without its mark, or one of the encodings of a
    country.

    Raises InputError for a file that cannot be read, or is no text.
    """
    with opened(source), Path(source).open("rb", buffering=0) as file:
        _require_size(source, file.seek(0, 2))
        file.seek(0)
        raw = file.read()  # all at once, which needs no buffer
    head = raw[:_SAMPLE]
    wide = _wide(raw)
    if wide:
        try:
            raw, encoding = raw.decode(wide).removeprefix("\ufeff").encode(), "utf-8"
        except UnicodeDecodeError:
            raise _no_text(source, head) from None
    else:
        raw = raw.removeprefix(codecs.BOM_UTF8)
        encoding = _encoding(raw)
    if b"\r" in raw:
        raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    # A form feed, the end mark of DOS, and what a logger without power has not overwritten.
    raw = raw.replace(b"\x0c", b"") if b"\x0c" in raw else raw
    raw = raw.rstrip(b"\x1a\x00")
    if any(code in raw for code in _NO_TEXT):
        raise _no_text(source, head)
    return Text(raw, encoding)


def _require_size(source: str, size: int) -> None:
    """Raise `InputError` for a text that is too large to be read at once."""
    if size > _LARGEST:
        part = f"head -n 10000000 {shlex.quote(source)} > part.csv"
        raise InputError.at(
            source,
            f"at most {_LARGEST / 1e9:g} GB of text",
            f"{size / 1e9:.3g} GB",
            f"take a part of it, such as {part}, or write it as Parquet",
        )


def _no_text(source: str, raw: bytes) -> InputError:
    signature = signature_of(raw, source)
    kind, remedy = signature or ("", EXPORT)
    return InputError.at(source, "text", f"binary data ({kind})" if kind else "binary data", remedy)


def _wide(raw: bytes) -> str:
    """UTF-16 by its mark, or by a zero in every other byte; else nothing."""
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    head = raw[:2000]
    even, odd = head[::2], head[1::2]
    if len(head) >= 40 and odd.count(0) > 0.8 * len(odd) and even.count(0) == 0:
        return "utf-16-le"
    if len(head) >= 40 and even.count(0) > 0.8 * len(even) and odd.count(0) == 0:
        return "utf-16-be"
    return ""


def _encoding(raw: bytes) -> str:
    """The encoding of text without wide characters: the one that makes words and units of it which
    a recording would hold; where none does, the likeliest by its characters."""
    if raw.isascii():
        return "utf-8"
    try:
        raw.decode("utf-8")
        return "utf-8"
    except UnicodeDecodeError:
        pass
    whole = raw[: raw.rfind(b"\n", 0, _SAMPLE) + 1] if len(raw) > _SAMPLE else raw
    lines = [line for line in whole.splitlines() if not line.isascii()]
    sample = b"\n".join(lines or [line for line in raw.splitlines() if not line.isascii()][:50])
    hits = {encoding: _hits(sample, encoding) for encoding in (_WESTERN, *_FOREIGN)}
    most = max(hits, key=hits.__getitem__)
    if hits[most]:
        return most
    from charset_normalizer import from_bytes

    best = from_bytes(sample, cp_isolation=[_WESTERN, *_FOREIGN]).best()
    return best.encoding if best is not None and _is_of_pairs(sample) else _WESTERN


def _hits(sample: bytes, encoding: str) -> int:
    """How many characters of what a recording would hold an encoding finds."""
    try:
        text = sample.decode(encoding).casefold()
    except UnicodeDecodeError:
        return 0
    return sum(len(word) * text.count(word) for word in FOREIGN_WORDS)


def _is_of_pairs(sample: bytes) -> bool:
    """Whether characters beyond ASCII come in runs, as those of other scripts do, or alone, as the
    accents and signs of Western languages."""
    runs = re.findall(rb"[\x80-\xff]+", sample)
    long = sum(len(run) for run in runs if len(run) > 1)
    return long > 0.6 * sum(map(len, runs))
