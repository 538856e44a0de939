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
_COMPOUND = rb"\xd0\xcf\x11\xe0"

# What a file is by its first bytes, and what to do about one of the wrong suffix.
_SIGNATURES = (
    (rb"\x89HDF\r\n\x1a\n", "an HDF5 file", "rename it to .h5"),
    (rb"CDF[\x01\x02\x05]", "a NetCDF file", "rename it to .nc"),
    (rb"MATLAB [57]\.", "a MAT file", "rename it to .mat"),
    (rb"TDSm", "a TDMS file", "rename it to .tdms"),
    (rb"PAR1", "a Parquet file", "rename it to .parquet"),
    (rb"ARROW1", "a Feather file", "rename it to .feather"),
    (rb"\x93NUMPY", "an NPY file", "rename it to .npy"),
    (rb"PK\x03\x04.{26}mimetypeapplication/vnd\.oasis", "an OpenDocument file", "save it as .xlsx"),
    (rb"PK\x03\x04.{26}(\[Content_Types\]|_rels/|docProps/|xl/)", "an XLSX file", "name it .xlsx"),
    (rb"PK\x03\x04.{26}.{0,250}?\.npy", "an NPZ file", "rename it to .npz"),
    (rb"PK\x03\x04", "a ZIP archive", "unpack it"),
    (rb"\x1f\x8b", "a gzip archive", "unpack it"),
    (
        rb"(MDF     |UnFinMF )",
        "an MDF file",
        "rename it to .mf4",
    ),
    (
        rb"\s{0,4}-1\s*[\r\n]+\s*(15|55|58|58b|151|164)\b",
        "a universal file (UFF, of Polytec, LMS or Simcenter)",
        "export the channels as ASCII or MAT, one column each",
    ),
    (
        rb"IGOR[\r\n]",
        "an Igor text file",
        "save the waves as delimited text in Igor (Data > Save Waves)",
    ),
    (rb"(.{0,40})WAVEDESC", "a LeCroy waveform", "save it as ASCII on the instrument"),
    (
        rb":\d{6}WFM#|WFM#|.{2}:WFM#|\x0f\x0f",
        "a Tektronix waveform",
        "save it as CSV on the instrument",
    ),
    (rb"\s*:?(WFMP|CURV)", "a Tektronix ISF waveform", "save it as CSV on the instrument"),
    (rb"AG\d\d", "a Keysight binary waveform", "save it as CSV on the instrument"),
    (rb"CPYU?A", "an Origin project", "export the worksheet as ASCII (File > Export)"),
    (rb"GWY[OP]", "a Gwyddion file", "export the graph as text"),
    (rb"SQLite format 3", "an SQLite database", "export the table as CSV"),
    (rb"RIFF.{4}WAVE", "a WAV sound file", "export the channels as CSV with their units"),
    (rb"ABF[ 2]", "an Axon file", "export it as text"),
    (rb"%PDF", "a PDF", EXPORT),
    (rb"\x89PNG|\xff\xd8\xff|GIF8", "a picture", EXPORT),
    (
        rb"\x80[\x02-\x05].{1,9}[\x8c\x95c}\]]",
        "a Python pickle, which may run anything",
        "export its arrays with numpy.savez",
    ),
    (
        rb"(\xef\xbb\xbf)?\s*(<!DOCTYPE|<html|<table|<meta)",
        "an HTML page",
        "open it in a spreadsheet and save it as .xlsx or CSV",
    ),
    (rb"(\xef\xbb\xbf)?\s*<\?xml", "an XML file", EXPORT),
    (rb"(\xef\xbb\xbf)?\s*\{\s*(\"|\})", "JSON", "save its arrays as the columns of a CSV"),
    (rb"\{\\rtf", "a text of a word processor", "save it as plain text"),
    (_COMPOUND, "an Excel file of before 2007", "save it as .xlsx"),
)
_SIGNED = re.compile(
    b"|".join(b"(?P<at%d>%s)" % (at, pattern) for at, (pattern, _, _) in enumerate(_SIGNATURES)),
    re.DOTALL,
)
"""All of them, each a group called by its index."""
_TEXTS = ("a universal file", "an Igor text", "an HTML", "an XML", "JSON", "a text of a word")
"""Which of these are text, though no table."""
_OF_COMPOUND = {
    ".svd": ("a Polytec scanning file", "export it as ASCII or MAT from the scanning software"),
    ".pvd": ("a Polytec vibrometer file", "export it as ASCII from the vibrometer software"),
    ".doc": ("a document of Word", EXPORT),
    ".opju": ("an Origin project", "export the worksheet as ASCII (File > Export)"),
}
_BY_SUFFIX = {
    ".pxp": ("an Igor experiment", "save the waves as delimited text in Igor (Data > Save Waves)"),
    ".trc": ("a LeCroy waveform", "save it as ASCII on the instrument"),
    ".wfm": ("an oscilloscope's waveform", "save it as CSV on the instrument"),
    ".psdata": ("a PicoScope file", "save it as CSV or MAT in PicoScope"),
    ".wdf": ("a Yokogawa waveform", "save it as CSV on the instrument"),
    ".wvf": ("a Yokogawa waveform", "save it as CSV on the instrument"),
    ".mem": ("a Hioki waveform", "save it as CSV on the instrument"),
    ".gbd": ("a Graphtec file", "save it as CSV in the logger's software"),
    ".bin": ("an instrument's own binary", "save it as CSV on the instrument"),
}
"""What binaries without a mark of their own are by their suffix."""
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f\x7f]")


def signature(head: bytes) -> tuple[str, str] | None:
    """What a file is by its first bytes, and the remedy; None where they tell nothing."""
    signed = _SIGNED.match(head)
    if signed is None or signed.lastgroup is None:
        return None
    _, kind, remedy = _SIGNATURES[int(signed.lastgroup.removeprefix("at"))]
    return kind, remedy


def text_signature(head: bytes) -> tuple[str, str] | None:
    """What text is that holds no table, and the remedy."""
    signed = signature(head)
    return signed if signed is not None and signed[0].startswith(_TEXTS) else None


def signature_of(head: bytes, source: str) -> tuple[str, str] | None:
    """The same of a file whose suffix helps where its first bytes are those of many kinds."""
    suffix = Path(source).suffix.lower()
    if re.match(_COMPOUND, head) and suffix in _OF_COMPOUND:
        return _OF_COMPOUND[suffix]
    return signature(head) or _BY_SUFFIX.get(suffix)


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
