"""The border to files and to the libraries that know them: whatever fails is one sentence."""

import logging
import re
import secrets
import tomllib
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from fracjax._recording import InputError

EXPORT = "export the recording as CSV"
_INSTALL = 'run pip install "fracjax[io]"'
_HEAD = 512
_COMPOUND = rb"\xd0\xcf\x11\xe0"

_KINDS = tomllib.loads(Path(__file__).with_name("signatures.toml").read_text(encoding="utf-8"))
_SIGNED = re.compile(
    b"|".join(
        b"(?P<at%d>%s)" % (at, each["mark"].encode("latin-1"))
        for at, each in enumerate(_KINDS["signature"])
    ),
    re.DOTALL,
)
"""All of them, each a group called by its index."""
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


def _entry(head: bytes) -> dict | None:
    signed = _SIGNED.match(head)
    if signed is None or signed.lastgroup is None:
        return None
    return _KINDS["signature"][int(signed.lastgroup.removeprefix("at"))]


def text_signature(head: bytes) -> tuple[str, str] | None:
    """What text is that holds no table, and the remedy."""
    entry = _entry(head)
    return (entry["kind"], entry["remedy"]) if entry and entry.get("text") else None


def signature_of(head: bytes, source: str) -> tuple[str, str] | None:
    """What a file is by its first bytes, or by its suffix where these are those of many kinds, and
    the remedy; None where they tell nothing."""
    suffix = Path(source).suffix.lower()
    if re.match(_COMPOUND, head) and suffix in _KINDS["compound"]:
        return tuple(_KINDS["compound"][suffix])
    entry = _entry(head)
    if entry is not None:
        return entry["kind"], entry["remedy"]
    return tuple(_KINDS["suffix"][suffix]) if suffix in _KINDS["suffix"] else None


@contextmanager
def opened(source: str) -> Iterator[None]:
    """Within this, what the system says against reading a file becomes an `InputError`."""
    try:
        yield
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError.at(
            source, "a file that can be read", _reason(error), "check the path"
        ) from None


@contextmanager
def reading(source: str, kind: str) -> Iterator[None]:
    """Within this, a library reads a file of a kind, such as "an HDF5 file", silently.

    Raises InputError where the library is missing, or the file is missing, empty, of another
    kind or damaged: libraries raise nearly anything over a damaged file.
    """
    with opened(source), open(source, "rb") as file:
        head = file.read(_HEAD)
    if not head:
        raise InputError.at(source, kind, "an empty file", EXPORT)
    try:
        with _silence():
            yield
    except InputError:
        raise
    except ImportError as error:
        raise _missing(source, f"a library that reads {kind}", error) from None
    except Exception as error:
        raise InputError.at(source, kind, *_instead(head, kind, source)) from error


@contextmanager
def whole(path: str | PathLike[str]) -> Iterator[Path]:
    """Within this, the file given is written; it becomes `path` whole or not at all.

    Raises InputError where it cannot be written.
    """
    target = Path(path)
    part = target.parent / f".{target.name}.{secrets.token_hex(4)}"
    try:
        yield part
        part.replace(target)
    except OSError as error:
        raise InputError.at(
            str(target), "a file that can be written", _reason(error), "choose another place"
        ) from None
    finally:
        with suppress(OSError):
            part.unlink()


@contextmanager
def writing(path: str | PathLike[str], kind: str) -> Iterator[Path]:
    """Within this, a library writes a file of a kind, silently, whole or not at all.

    Raises InputError where the library is missing, cannot hold the columns, or the file
    cannot be written.
    """
    with whole(path) as part, _silence():
        try:
            yield part
        except (InputError, OSError):
            raise
        except ImportError as error:
            raise _missing(str(path), f"a library that writes {kind}", error) from None
        except Exception as error:
            raise InputError.at(
                str(path), f"columns for {kind}", _reason(error), "choose another suffix"
            ) from error


def plain(text: str) -> str:
    """A name or unit from a file as one printable line."""
    text = text.encode("utf-8", "replace").decode()
    return "".join(c if c.isprintable() else " " for c in text).strip()


@contextmanager
def _silence() -> Iterator[None]:
    """Within this, libraries neither warn nor log: what matters is raised."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _instead(head: bytes, kind: str, source: str) -> tuple[str, str]:
    """What a file is that was no readable one of its kind, and the remedy."""
    signed = signature_of(head, source)
    if signed is None and not _NO_TEXT.search(head):
        signed = "text", "rename it to .txt"
    if signed is None:
        return "unknown or damaged data", EXPORT
    if signed[0] == kind:
        return "one that is damaged or cut short", "copy or export it again"
    return signed


def _missing(place: str, wanted: str, error: ImportError) -> InputError:
    """The refusal where an optional library is not installed."""
    return InputError.at(place, wanted, f"no {error.name or 'such library'}", _INSTALL)


def _reason(error: Exception) -> str:
    """What the system or a library says, in small letters on one line."""
    return plain(str(getattr(error, "strerror", None) or error))[:200].lower().rstrip(".")
