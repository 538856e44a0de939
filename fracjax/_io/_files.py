"""The border to files and to the libraries that know them: whatever fails is one sentence."""

import logging
import re
import secrets
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from os import PathLike
from pathlib import Path

from fracjax._recording import InputError

EXPORT = "export the recording as CSV"
_INSTALL = 'run pip install "fracjax[io]"'
_HEAD = 512

# What a file is by its first bytes, and what to do about one of the wrong suffix.
_SIGNATURES = (
    (rb"\x89HDF\r\n\x1a\n", "an HDF5 file", "rename it to .h5"),
    (rb"MATLAB [57]\.", "a MAT file", "rename it to .mat"),
    (rb"TDSm", "a TDMS file", "rename it to .tdms"),
    (rb"PAR1", "a Parquet file", "rename it to .parquet"),
    (rb"\x93NUMPY", "an NPY file", "rename it to .npy"),
    (rb"PK\x03\x04.{26}mimetypeapplication/vnd\.oasis", "an OpenDocument file", "save it as .xlsx"),
    (rb"PK\x03\x04.{26}(\[Content_Types\]|_rels/|docProps/|xl/)", "an XLSX file", "name it .xlsx"),
    (rb"PK\x03\x04.{26}.{0,250}?\.npy", "an NPZ file", "rename it to .npz"),
    (rb"PK\x03\x04", "a ZIP archive", "unpack it"),
    (rb"\x1f\x8b", "a gzip archive", "unpack it"),
    (rb"\xd0\xcf\x11\xe0", "an Excel file of before 2007", "save it as .xlsx"),
)
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


def signature(head: bytes) -> tuple[str, str] | None:
    """What a file is by its first bytes, and the remedy; None where they tell nothing."""
    for pattern, kind, remedy in _SIGNATURES:
        if re.match(pattern, head, re.DOTALL):
            return kind, remedy
    return None


@contextmanager
def opened(source: str) -> Iterator[None]:
    """Within this, what the system says against reading a file becomes an `InputError`."""
    try:
        yield
    except (OSError, ValueError) as error:
        raise InputError.at(
            source, "a file that can be read", _reason(error), "check the path"
        ) from None


@contextmanager
def reading(source: str, kind: str) -> Iterator[None]:
    """Within this, a library reads a file of a kind, such as "an HDF5 file", silently.

    **Raises:** `InputError` where the library is missing, or the file is missing, empty, of another
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
        raise InputError.at(source, kind, *_instead(head, kind)) from error


@contextmanager
def whole(path: str | PathLike[str]) -> Iterator[Path]:
    """Within this, the file given is written; it becomes `path` whole or not at all.

    **Raises:** `InputError` where it cannot be written.
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

    **Raises:** `InputError` where the library is missing, cannot hold the columns, or the file
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


def _instead(head: bytes, kind: str) -> tuple[str, str]:
    """What a file is that was no readable one of its kind, and the remedy."""
    known = signature(head)
    if known is None and not _NO_TEXT.search(head):
        known = "text", "rename it to .txt"
    if known is None:
        return "unknown or damaged data", EXPORT
    if known[0] == kind:
        return "one that is damaged or cut short", "copy or export it again"
    return known


def _missing(place: str, wanted: str, error: ImportError) -> InputError:
    """The refusal where an optional library is not installed."""
    return InputError.at(place, wanted, f"no {error.name or 'such library'}", _INSTALL)


def _reason(error: Exception) -> str:
    """What the system or a library says, in small letters on one line."""
    return plain(str(getattr(error, "strerror", None) or error))[:200].lower().rstrip(".")
