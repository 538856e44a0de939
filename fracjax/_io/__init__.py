"""Recordings from and to files: one module per format, one line here for each."""

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import NamedTuple, TypedDict, Unpack

import numpy as np

from fracjax._io._arrow import (
    read_feather,
    read_json_lines,
    read_parquet,
    write_feather,
    write_parquet,
)
from fracjax._io._assigned_units import scale_of
from fracjax._io._description import read_description, write_description
from fracjax._io._facts import speaks
from fracjax._io._hdf5 import read_hdf5, write_hdf5
from fracjax._io._igor import read_ibw
from fracjax._io._mat import read_mat, write_mat
from fracjax._io._mdf import read_mdf
from fracjax._io._missing import Mask
from fracjax._io._netcdf import read_netcdf
from fracjax._io._numpy import read_npy, read_npz, write_npy, write_npz
from fracjax._io._signals import Request, recordings_of, signals_of, the_one
from fracjax._io._table import NO_HINTS, SIGNALS, Hints, Stated, Table
from fracjax._io._tdms import read_tdms, write_tdms
from fracjax._io._text import read_text, write_text
from fracjax._io._xlsx import read_xlsx, write_xlsx
from fracjax._recording import UNSTATED, InputError, Recording, closest

__all__ = [
    "SUFFIXES",
    "Options",
    "Taken",
    "column_name",
    "read",
    "read_drive",
    "read_response",
    "read_segments",
    "read_table",
    "write",
    "write_description",
    "write_text",
]


class _Format(NamedTuple):
    read: Callable[..., Table]
    write: Callable[[str | PathLike[str], Mapping[str, np.ndarray]], None]
    takes_hints: bool = False


_TEXT = _Format(read_text, write_text, True)
_FORMATS: dict[str, _Format] = {
    **dict.fromkeys((".csv", ".tsv", ".txt", ".dat", ".asc"), _TEXT),
    **dict.fromkeys((".h5", ".hdf5"), _Format(read_hdf5, write_hdf5)),
    ".mat": _Format(read_mat, write_mat),
    ".npy": _Format(read_npy, write_npy),
    ".npz": _Format(read_npz, write_npz),
    ".feather": _Format(read_feather, write_feather),
    ".parquet": _Format(read_parquet, write_parquet),
    ".tdms": _Format(read_tdms, write_tdms),
    ".xlsx": _Format(read_xlsx, write_xlsx, True),
}
"""By suffix; any other suffix is tried as text."""
_ONLY_READ = {
    **dict.fromkeys((".nc", ".nc4", ".cdf"), _Format(read_netcdf, write_hdf5)),
    ".xlsm": _FORMATS[".xlsx"],
    ".arrow": _FORMATS[".feather"],
    **dict.fromkeys((".jsonl", ".ndjson"), _Format(read_json_lines, write_text)),
    ".lvm": _TEXT,
    ".ibw": _Format(read_ibw, write_text),
    **dict.fromkeys((".mf4", ".mdf"), _Format(read_mdf, write_text)),
}
SUFFIXES = tuple(_FORMATS)
_OPENINGS = {"V": "voltage", "A": "current", "m": "displacement", "N": "force"}
_NAME = re.compile(r"(?!(nan|inf|infinity)$)[^\W\d_](.*\S)?", re.IGNORECASE)


class Options(TypedDict, total=False):
    """How a file is read; see `read`."""

    time: str | int | None
    input: str | int | None
    output: str | int | None
    rate: str | float | None
    input_unit: str | None
    output_unit: str | None
    time_unit: str | None
    input_scale: str | None
    output_scale: str | None
    wrap: str | int | None
    resample: str | float | None
    mask: Mask
    segment: int | None
    skip_rows: int | None
    names_row: int | None
    units_row: int | None
    description: str | PathLike[str] | None


_OF_SHELL = {
    "clock": "time_unit",
    "unit": "input_unit or output_unit",
    "scale": "input_scale or output_scale",
}
"""Options that are called otherwise in the shell."""


class Taken(NamedTuple):
    """A recording, and how it was taken from its file."""

    recording: Recording
    columns: dict[str, str | int]
    """Of "time", if any, "input" and "output": name, or index from 0."""
    unused: tuple[str, ...]
    """What the file states of units, factors, rates and starts that was not used."""


def read(
    path: str | PathLike[str],
    *,
    response: str | PathLike[str] | None = None,
    **options: Unpack[Options],
) -> Recording:
    """The recording in a file: text, Parquet, Feather, lines of JSON, MAT, HDF5, NetCDF, NPZ, NPY,
    TDMS, MDF, Igor's binary waves or XLSX by its suffix.

    In a container, each vector of numbers is a column, called by its path, such as `run1/voltage`,
    or by the end of it; of an array with more axes, each index across its longest axis, which is
    that of the samples, such as `data.3` or `u.0.2`.

    Args:
        path: The file, or that of the drive alone where `response` is given.
        response: The file of the response, each file with its own clock.
        **options: `time`, `input` and `output`, the name of a column or its index from 0, where
            the names in the file do not say it.
            `rate`, samples per second ("200Hz", or a number [Hz]), needed where there is neither a
            time column nor a rate or step in the file.
            `input_unit` and `output_unit`, the units of the result, to which the file's own are
            converted; `time_unit`, the unit in which a time column counts.
            `input_scale` and `output_scale`, such as "counts*0.0305 mV", of counts; `wrap`, after
            how many bits or which time ("60 s") a time column begins anew, or "none".
            `resample`, the rate to interpolate to where the times are not uniform, or drive and
            response have clocks of their own.
            `mask`, times [s] such as `[(3, 4)]` or `["3 s..4 s"]` in which samples may be missing,
            or "bad" for all samples that are no number, clipped or a spike; no fit counts them.
            `segment`, which one, from 1, of a file with several.
            `skip_rows`, the number of lines of a text or sheet to pass over; `names_row` and
            `units_row`, the lines, from 1, of names and units.
            `description`, a file that says the same as these options, which count more.

    Returns:
        Drive (N,) and response (N,) in the file's own units, unless given, and the step [s]; where
        neither states one, in "drive units" and "response units". What had to be assumed stands in
        `Recording.warnings`.

    Raises:
        InputError: The file cannot be used; with file, place and column.
    """
    options = _described(options)
    signals = signals_of(_tables(path, response, options), _request(options))
    return recordings_of([the_one(*signals[:3], fspath(path))])[0]


def read_segments(
    path: str | PathLike[str],
    *,
    response: str | PathLike[str] | None = None,
    **options: Unpack[Options],
) -> list[Taken]:
    """As `read`, of every segment of a file: stretches between gaps and restarts."""
    options = _described(options)
    segments = signals_of(_tables(path, response, options), _request(options))
    recordings = recordings_of(segments.signals)
    return [
        Taken(recording, signals.columns, segments.unused)
        for recording, signals in zip(recordings, segments.signals, strict=True)
    ]


def read_drive(
    path: str | PathLike[str], **options: Unpack[Options]
) -> tuple[np.ndarray, float, str]:
    """The drive in a file, its step [s] and its unit; there need be no response.

    Options and errors are those of `read`.
    """
    return _alone(path, "input", options)


def read_response(
    path: str | PathLike[str], **options: Unpack[Options]
) -> tuple[np.ndarray, float, str]:
    """The response in a file, its step [s] and its unit; there need be no drive.

    Options and errors are those of `read`.
    """
    return _alone(path, "output", options)


def read_table(path: str | PathLike[str]) -> Table:
    """The columns of a file, whatever they are."""
    return _table(path, NO_HINTS)


def column_name(role: str, unit: str) -> str:
    """A column's name that says its unit, if any: voltage_V, displacement_um, or drive [V/um]."""
    if unit == UNSTATED.get(role):
        return role
    plain = re.fullmatch(r"[numkµμ]?([VAmN])", unit)
    return f"{_OPENINGS[plain[1]]}_{unit}" if plain else f"{role} [{unit}]"


def write(path: str | PathLike[str], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns to a file of the format that its suffix names; `read` gives the same numbers.

    The file appears whole or not at all.

    Args:
        path: The file to write.
        columns: Real numbers (N,) by name, such as "voltage_V", which `read` finds by name and
            unit.

    Raises:
        InputError: The columns are no such numbers, a name does not begin with a letter, the suffix
            is of no known format, or the file cannot be written.
    """
    target = fspath(path)
    form = _FORMATS.get(Path(target).suffix.lower())
    if form is None:
        suffixes = " ".join(_FORMATS)
        raise InputError.at(
            target, f"one of the suffixes {suffixes}", "another", "choose one of them"
        )
    form.write(target, _checked(target, columns))


def _described(options: Options) -> Options:
    """The options with those of the description that they name.

    Where types are not checked one that there is not would be passed over.
    """
    names = Options.__annotations__
    for name in options.keys() - names.keys():
        here = _OF_SHELL.get(name)
        remedy = f"give {here} for it" if here else f"take it out{closest(name, names)}"
        raise InputError.at("read", f"options {', '.join(names)}", f'"{name}"', remedy)
    path = options.get("description")
    if path is None:
        return options
    given = {name: value for name, value in options.items() if value is not None}
    return read_description(path) | given  # type: ignore[return-value]


def _request(options: Options) -> Request:
    roles = ("time", "input", "output")
    scales = {
        role: scale_of(text, f"--scale {SIGNALS[role]}")
        for role in roles[1:]
        if (text := options.get(f"{role}_scale"))
    }
    wrap = options.get("wrap")
    return Request(
        {role: options.get(role) for role in roles},
        options.get("rate"),
        {role: options.get(f"{role}_unit") for role in roles},
        options.get("resample"),
        options.get("mask"),
        options.get("segment"),
        scales,
        None if wrap is None else f"{wrap}",
    )


def _hints(options: Options) -> Hints:
    return Hints(options.get("skip_rows") or 0, options.get("names_row"), options.get("units_row"))


def _tables(
    path: str | PathLike[str], response: str | PathLike[str] | None, options: Options
) -> dict[str, Table]:
    """The tables of drive and response."""
    hints = _hints(options)
    drive = _table(path, hints)
    if response is None:
        return {"input": drive, "output": drive}
    return {"input": drive, "output": _table(response, hints)}


def _alone(path: str | PathLike[str], role: str, options: Options) -> tuple[np.ndarray, float, str]:
    """One signal of a file, its step and its unit."""
    options = _described(options)
    request = _request(options)
    signals = signals_of({role: _table(path, _hints(options))}, request.of(role))
    one = the_one(*signals[:3], fspath(path))
    if one.masked is not None:
        raise InputError.at(
            fspath(path), "a signal without gaps", "samples left out", "give one without --mask"
        )
    return one.samples[role], one.step, one.units[role]


def _table(path: str | PathLike[str], hints: Hints) -> Table:
    suffix = Path(path).suffix.lower()
    form = _FORMATS.get(suffix) or _ONLY_READ.get(suffix) or _TEXT
    if form.takes_hints:
        return _with_neighbours(form.read(path, hints))
    if hints != NO_HINTS:
        raise InputError.at(
            fspath(path), "rows to skip only in text or XLSX", f"a {suffix} file", "leave them out"
        )
    return _with_neighbours(form.read(path))


_NEIGHBOURS = (".json", ".yaml", ".yml", ".ini", ".meta", ".hdr", "-metadata.json")
"""What follows the name of a file, or its stem, in that of one that describes it."""
_LARGEST_NEIGHBOUR = 65_536


def _with_neighbours(table: Table) -> Table:
    """A table with what small files of its name, such as loop.json beside loop.csv, say of units
    and rates: it is listed, since they may be of anything."""
    path = Path(table.source)
    said = []
    for stem in dict.fromkeys((path, path.with_suffix(""))):
        for ending in _NEIGHBOURS:
            beside = stem.with_name(stem.name + ending)
            if beside == path or not beside.is_file():
                continue
            if beside.stat().st_size <= _LARGEST_NEIGHBOUR:
                text = beside.read_text("utf-8", "replace")
                lines = [] if '"fracjax.' in text else text.splitlines()  # our own results
                said += [Stated(line.strip(), beside.name) for line in lines if speaks(line)]
    return replace(table, unused=(*table.unused, *dict.fromkeys(said))) if said else table


def _checked(target: str, columns: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The columns as float64, once any format can hold them."""
    if not columns:
        raise InputError.at(target, "columns to write", "none", "give some")
    arrays = {}
    for name, column in columns.items():
        if not (_NAME.fullmatch(name) and name.isprintable()):
            raise InputError.at(
                target, "names that begin with a letter, on one line", f"{name!r}", "rename it"
            )
        where = f'{target}, column "{name}"'
        try:
            values = np.asarray(column)
        except ValueError:
            values = np.empty(0, object)
        if values.dtype.kind not in "iuf" or values.ndim != 1:
            kind = f"{values.dtype} values of shape {values.shape}"
            raise InputError.at(where, "real numbers along one axis", kind, "give such")
        arrays[name] = values.astype(np.float64)
        first = next(iter(arrays.values()))
        if len(values) != len(first):
            raise InputError.at(
                where, f"{len(first)} numbers, as before", f"{len(values)}", "give as many"
            )
    return arrays
