"""MAT files: versions 4 to 7.2 by SciPy, 7.3 by h5py, both through pymatreader."""

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from os import PathLike, fspath

import numpy as np

from fracjax._io._arrays import Array, array_table, gathered
from fracjax._io._files import reading, writing
from fracjax._io._table import Table
from fracjax._recording import InputError

_KIND = "a MAT file"
_PLAIN = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS, _SPARSE, _OPAQUE = range(4, 16), 5, 17
"""Type codes of elements and classes of arrays: "MAT-File Format", MathWorks, version 5."""
_NAME = re.compile(r"[A-Za-z]\w{0,62}", re.ASCII)


def read_mat(path: str | PathLike[str]) -> Table:
    """The arrays of a MAT file: variables, fields of structures as `run1/voltage`, cells by index.

    Raises InputError for a file that is no whole MAT file, or without pymatreader or h5py.
    """
    source = fspath(path)
    with reading(source, _KIND):
        from pymatreader import read_mat as load

        objects = _check(source)
        # What stands for objects is read as something else, or not at all.
        content = load(source, ignore_fields=["#subsystem#", "#refs#"])
        if not isinstance(content.get("__header__"), bytes):
            objects = _objects_of_hdf5(source)
        for name in ("None", *objects):
            content.pop(name, None)
        arrays, facts = gathered(content)
    if not isinstance(content.get("__header__"), bytes):
        # Version 7.3 comes in the order of a set; HDF5's own order is that of the names.
        arrays = dict(sorted(arrays.items()))
    for name in objects:
        arrays[name] = Array((0,), np.dtype(object), lambda: np.empty(0, object))
    faults = {name: _fault(name, kind) for name, kind in objects.items()}
    ordered = isinstance(content.get("__header__"), bytes)
    return array_table(source, arrays, facts, faults, is_ordered=ordered)


def write_mat(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns, each of shape (N,), as variables of a MAT file of version 5.

    Raises InputError for a name that MATLAB does not take, or where the file cannot be
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


def _fault(name: str, kind: str) -> tuple[str, str]:
    """The message on a MATLAB object: what it is, and how its samples are saved."""
    samples = f"t = {name}.Time; y = {name}.Data"
    if kind == "timetable":
        samples = f"t = seconds({name}.Time); y = {name}{{:,1}}"
    elif kind == "table":
        samples = f"y = {name}{{:,:}}"
    elif kind == "iddata":
        samples = f"u = {name}.u; y = {name}.y; Ts = {name}.Ts"
    elif kind != "timeseries":
        samples = "t and y as arrays"
    return (
        f"a MATLAB object ({kind}), which only MATLAB reads",
        f"save its samples there as plain arrays ({samples})",
    )


def _objects_of_hdf5(source: str) -> dict[str, str]:
    """The variables of a file of version 7.3 that are objects, and their classes."""
    import h5py

    classes = {}
    with h5py.File(source, "r") as file:
        for name, node in file.items():
            if "MATLAB_object_decode" in node.attrs and not name.startswith("#"):
                classes[name] = bytes(node.attrs.get("MATLAB_class", b"object")).decode(
                    "ascii", "replace"
                )
    return classes


def _check(source: str) -> dict[str, str]:
    """The variables that are objects, and their classes, of a file of version 5; raise
    `ValueError` or `struct.error` unless it is built as it should be.

    SciPy looks up the type code of what it takes for numbers without a check, which ends the
    process where the file is damaged (scipy/scipy#25349).
    """
    with open(source, "rb") as file:
        head = file.read(128)
        # As SciPy reads version and byte order, also where the head is damaged.
        if len(head) < 128 or 0 in head[:4] or head[125 if head[126] == ord("I") else 124] != 1:
            return {}
        order = "<" if head[126:] == b"IM" else ">"
        objects = {}
        for code, inside in _elements(memoryview(file.read()), order):
            if code == _COMPRESSED:
                ((code, inside),) = _elements(memoryview(zlib.decompress(inside)), order)
            if code != _MATRIX:
                raise ValueError(f"element {code} for a variable")
            _check_matrix(inside, order)
            objects |= _object(inside, order)
    return objects


def _object(data: memoryview, order: str) -> dict[str, str]:
    """The name and the class of a variable that is an object; nothing of another."""
    elements = list(_elements(data, order))
    (flags,) = struct.unpack_from(f"{order}I", elements[0][1])
    if flags & 0xFF != _OPAQUE or len(elements) < 4:
        return {}
    name, _, kind = (bytes(inside).decode("ascii", "replace") for _, inside in elements[1:4])
    return {name: kind} if name else {}


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
