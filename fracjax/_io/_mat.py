"""MAT files: versions 4 to 7.2 by SciPy, 7.3 by h5py, both through pymatreader."""

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import ArrayTable, array_table, gathered
from fracjax._io._files import reading, writing
from fracjax._recording import InputError

_KIND = "a MAT file"
_PLAIN = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS, _SPARSE, _OPAQUE = range(4, 16), 5, 17
"""Type codes of elements and classes of arrays: "MAT-File Format", MathWorks, version 5."""
_NAME = re.compile(r"[A-Za-z]\w{0,62}", re.ASCII)


def read_mat(path: str | PathLike[str]) -> ArrayTable:
    """The arrays of a MAT file: variables, fields of structures as `run1/voltage`, cells by index.

    **Raises:** `InputError` for a file that is no whole MAT file, or without pymatreader or h5py.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from pymatreader import read_mat as load

        _check(source)
        content = load(source, ignore_fields=["#subsystem#"])
        arrays, facts = gathered(content)
    if isinstance(content.get("__header__"), bytes):
        return array_table(source, arrays, facts)
    # Version 7.3 comes in the order of a set; HDF5's own order is that of the names.
    return array_table(source, dict(sorted(arrays.items())), facts)


def write_mat(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as variables of a MAT file of version 5.

    **Raises:** `InputError` for a name that MATLAB does not take, or where the file cannot be
    written.
    """
    for name in columns:
        if not _NAME.fullmatch(name):
            raise InputError.at(
                fspath(path), "names of MATLAB variables", f'"{name}"', "rename it or write a .h5"
            )
    with writing(path, _KIND) as part:
        from scipy.io import savemat

        with part.open("wb") as file:
            savemat(file, dict(columns), long_field_names=True, oned_as="column")


def _check(source: str) -> None:
    """Raise `ValueError` or `struct.error` unless a file of version 5 is built as it should be.

    SciPy looks up the type code of what it takes for numbers without a check, which ends the
    process where the file is damaged (scipy/scipy#25349).
    """
    with open(source, "rb") as file:
        head = file.read(128)
        # As SciPy tells version and byte order, also where the head is damaged.
        if len(head) < 128 or 0 in head[:4] or head[125 if head[126] == ord("I") else 124] != 1:
            return
        order = "<" if head[126:] == b"IM" else ">"
        for code, inside in _elements(memoryview(file.read()), order):
            if code == _COMPRESSED:
                ((code, inside),) = _elements(memoryview(zlib.decompress(inside)), order)
            if code != _MATRIX:
                raise ValueError(f"element {code} for a variable")
            _check_matrix(inside, order)


def _check_matrix(data: memoryview, order: str) -> None:
    """Check flags, dimensions and name of a matrix, and the real and imaginary part of numbers."""
    elements = list(_elements(data, order))
    if not elements or len(elements[0][1]) != 8:
        raise ValueError("a matrix without its flags")
    (flags,) = struct.unpack_from(f"{order}I", elements[0][1])
    kind, is_complex = flags & 0xFF, flags >> 11 & 1
    plain = 1 if kind == _OPAQUE else 3
    if kind in _NUMBERS:
        plain += 1 + is_complex + 2 * (kind == _SPARSE)
    codes = [code for code, _ in elements]
    if len(codes) < plain or not _PLAIN.issuperset(codes[:plain]):
        raise ValueError(f"elements {codes} for an array of class {kind}")
    for code, inside in elements[plain:]:
        if code == _MATRIX and inside:
            _check_matrix(inside, order)
        elif code not in _PLAIN | {_MATRIX}:
            raise ValueError(f"element {code} within an array")


def _elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """The type codes and data of a sequence of elements, each with a tag of one or two words."""
    at = 0
    while at < len(data):
        code, length = struct.unpack_from(f"{order}II", data, at)
        start, after = at + 8, at + 8 + length + (-length % 8 if code != _COMPRESSED else 0)
        if code >> 16:
            code, length, start, after = code & 0xFFFF, code >> 16, at + 4, at + 8
        if start + length > len(data):
            raise ValueError(f"{length} bytes at {start}")
        yield code, data[start : start + length]
        at = after
