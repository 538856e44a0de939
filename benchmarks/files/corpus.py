"""Files in layouts drawn at random, whose rate, units, factors and signs are known, and how each is
read.

A unit, a factor or a rate is declared in one of many places or nowhere, beside lines that speak of
something else. `outcome_of` draws the file of a seed, reads it and says how it was read.
"""

from __future__ import annotations

import csv
import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
from nptdms import ChannelObject, RootObject, TdmsWriter
from openpyxl import Workbook
from pyarrow import feather, parquet
from scipy.io import savemat

from fracjax._io import read_segments
from fracjax._recording import UNSTATED, InputError, conversion

COUNT = 96
RATES = (100.0, 500.0, 1000.0, 2000.0, 20000.0)
CLOCKS = ("s", "ms", "us", "min")
DRIVES = ("V", "mV", "kV")
RESPONSES = ("um", "nm", "mm", "mrad")
NAMES = (
    ("time", "voltage", "displacement"),
    ("Time", "Voltage", "Position"),
    ("Zeit", "Spannung", "Weg"),
    ("时间", "电压", "位移"),
    ("t", "u", "y"),
)
DISTRACTORS = (
    "Operator: lab 3",
    "Trigger level: 0.5 V",
    "Range: 10 V",
    "Temperature: 23.4 degC",
    "Low pass: 20 kHz",
    "Sensor: capacitive, 0.5 um/V",
    "Amplifier gain: 20",
    "Record length: 96",
    "Date: 2026-02-13",
    "Comment: run after repair",
    "Serial: 0117",
)
IN_TEXT = (
    "brackets",
    "parentheses",
    "underscore",
    "stroke",
    "comma",
    "row of units",
    "comment of each",
    "comment of all",
    "JSON in a comment",
    "YAML in comments",
    "key and unit",
    "columns of units",
    "cells",
)
IN_ARRAYS = ("name", "attributes", "a table of units", "a list of units", "values beside")
CONTAINERS = (".parquet", ".feather", ".h5", ".npz", ".mat", ".tdms")
SHEETS = 0.12
"""Share of the texts that are written as a sheet, each line a row."""


@dataclass
class Truth:
    """What a file holds."""

    rate: float
    drive: np.ndarray
    """[V], or as it is written where no unit is declared."""
    response: np.ndarray
    units: tuple[str, str, str]
    """Of time, drive and response as written."""
    declared: bool = True
    clocked: bool = True
    """Whether the unit of the time is declared."""
    factor: float = 1.0
    """What counts of the drive stand for; 1 where they are none."""
    layout: list[str] = field(default_factory=list)


def draw(seed: int, folder: Path) -> tuple[Path, Truth]:
    """The file of a seed, and what it holds."""
    rng = np.random.default_rng(seed)
    rate = float(rng.choice(RATES))
    clock, drive_unit, response_unit = (str(rng.choice(e)) for e in (CLOCKS, DRIVES, RESPONSES))
    counted = np.arange(COUNT)
    phase = 2 * np.pi * np.arange(COUNT) / 31
    drive = np.round(40 - 50 * np.cos(phase), 4)
    response = np.round(-3 + 7 * np.cos(phase - 0.2), 4)
    truth = Truth(rate, drive, response, (clock, drive_unit, response_unit))
    timing = str(rng.choice(["column", "column", "column", "rate", "step"]))
    text = rng.random() < 0.6
    place = str(rng.choice((*IN_TEXT, "nowhere") if text else (*IN_ARRAYS, "nowhere")))
    truth.declared = place != "nowhere"
    truth.clocked = truth.declared or timing != "column"
    names = list(NAMES[rng.integers(len(NAMES))])
    form = "plain"
    if truth.clocked and timing == "column" and place != "cells":
        form = str(rng.choice(["plain"] * 4 + ["epoch", "wrap", "pair"]))
    counts = place not in ("cells", "columns of units") and rng.random() < 0.15
    if counts:
        truth.factor = float(rng.choice([0.0305, 0.005, 1e-3]))
        truth.drive = np.round(drive / truth.factor)
    stamps: list = [counted / rate / (conversion(clock, "s") or 1)]
    if form in ("epoch", "wrap"):
        truth.units = (str(rng.choice(["us", "ns"])), *truth.units[1:])
        ticks = counted * round(1 / rate / (conversion(truth.units[0], "s") or 1))
        if form == "epoch":
            stamps = [ticks + 1_717_000_000 * round(1 / (conversion(truth.units[0], "s") or 1))]
        else:
            stamps = [(ticks + 2**32 - 40 * ticks[1]) % 2**32]
    elif form == "pair":
        names = ["sec", *names[1:]]
        nanoseconds = counted * round(1e9 / rate) + 999_900_000
        stamps = [nanoseconds // 10**9, nanoseconds % 10**9]
        truth.units = ("s", *truth.units[1:])
    columns = [stamps[0], truth.drive, response]
    if timing != "column":
        names, columns = names[1:], columns[1:]
    units = list(truth.units)[3 - len(names) :]
    truth.layout = [place, form if timing == "column" else timing, "counts" if counts else "values"]
    if form == "pair":
        names.insert(1, "nsec")
        columns.insert(1, stamps[1])
        units.insert(1, "ns")
    if text:
        path = _text(rng, folder, truth, names, columns, units, place, timing, counts)
    else:
        path = _container(rng, folder, truth, names, columns, units, place, timing, counts)
    return path, truth


def _clock_lines(rng, truth: Truth, timing: str) -> dict[str, str]:
    """The key and value of a rate or a step, its unit in the value, in the key, or in a key of its
    own."""
    step = 1 / truth.rate
    unit = str(rng.choice(["Hz", "kHz"] if timing == "rate" else ["s", "ms", "us"]))
    number = truth.rate if timing == "rate" else step
    number = number * (conversion("Hz" if timing == "rate" else "s", unit) or 1)
    value = f"{number:.10g}"
    keys = (
        ("Sampling rate", "sample_rate", "fs")
        if timing == "rate"
        else ("dt", "Sampling interval", "time_step")
    )
    key = str(rng.choice(keys))
    way = rng.integers(4)
    if way == 0 and unit in ("Hz", "s"):
        return {key: value}
    if way == 1:
        return {f"{key} [{unit}]": value}
    if way == 2:
        return {key: value, f"{key}_unit": unit}
    return {key: f"{value} {unit}"}


def _text(rng, folder, truth, names, columns, units, place, timing, counts) -> Path:
    separator = str(rng.choice([",", ";", "\t"]))
    mark = str(rng.choice(["# ", "% ", ""])) if rng.random() < 0.8 else "# "
    if place in ("JSON in a comment", "YAML in comments"):
        mark = "# "
    lines = [mark + each for each in rng.permutation(DISTRACTORS)[: rng.integers(5)]]
    said: list[str] = []
    if timing != "column":
        said += [f"{k}: {v}" for k, v in _clock_lines(rng, truth, timing).items()]
    heads = {
        "brackets": [f"{n} [{u}]" for n, u in zip(names, units, strict=True)],
        "parentheses": [f"{n} ({u})" for n, u in zip(names, units, strict=True)],
        "underscore": [f"{n}_{u}" for n, u in zip(names, units, strict=True)],
        "stroke": [f"{n}/{u}" for n, u in zip(names, units, strict=True)],
        "comma": [f'"{n}, {u}"' for n, u in zip(names, units, strict=True)],
    }.get(place, list(names))
    pairs = list(zip(names, units, strict=True))
    if place == "comment of each":
        said += [f"{n}: {u}" for n, u in pairs]
    elif place == "comment of all":
        said.append("units: " + ", ".join(units))
    elif place == "JSON in a comment":
        said.append(json.dumps({n: {"unit": u} for n, u in pairs}, ensure_ascii=False))
    elif place == "YAML in comments":
        said += [line for n, u in pairs for line in (f"- name: {n}", f"  unit: {u}")]
    elif place == "key and unit":
        said += [f"{n} unit: {u}" for n, u in pairs]
    if counts:
        said.append(f"{names[-2]} scale: {truth.factor:g} {truth.units[1]}/count")
    lines += [mark + each for each in said]
    cells = [
        [f"{value}" if isinstance(value, np.integer) else f"{value:.9g}" for value in column]
        for column in columns
    ]
    if place == "cells":
        cells = [[f"{c} {u}" for c in column] for column, u in zip(cells, units, strict=True)]
    if place == "columns of units":
        for at in range(len(names) - 2):
            heads[at] = f"{heads[at]} [{units[at]}]"
        wide, wide_heads = [], []
        for at, column in enumerate(cells):
            wide.append(column)
            wide_heads.append(heads[at])
            if at >= len(cells) - 2:
                wide.append([units[at]] * COUNT)
                wide_heads.append(f"{names[at]} unit")
        cells, heads = wide, wide_heads
    lines.append(separator.join(heads))
    if place == "row of units":
        lines.append(separator.join(units))
    lines += [separator.join(row) for row in zip(*cells, strict=True)]
    if rng.random() < SHEETS:
        truth.layout[0] += " of .xlsx"
        return _sheet(folder / "loop.xlsx", lines, separator)
    path = folder / "loop.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _sheet(path: Path, lines: list[str], separator: str) -> Path:
    """Lines of text as the rows of a sheet, what is a number as one."""
    book = Workbook(write_only=True)
    sheet = book.create_sheet("run")
    for row in csv.reader(lines, delimiter=separator):
        sheet.append([_cell(cell) for cell in row])
    book.save(path)
    return path


def _cell(text: str) -> str | float | int:
    """A cell as a spreadsheet takes it that is typed in."""
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _container(rng, folder, truth, names, columns, units, place, timing, counts) -> Path:
    suffix = str(rng.choice(CONTAINERS))
    if place == "attributes" and suffix in (".npz", ".mat"):
        place = "values beside"
    if place == "values beside" and suffix in (".parquet", ".feather"):
        place = "attributes"
    truth.layout[0] = f"{place} of {suffix}"
    plain = dict(zip(sum(NAMES, ()), NAMES[0] * len(NAMES), strict=True))
    names = [name if name.isascii() else plain[name] for name in names]
    if place == "name":
        names = [f"{n}_{u}" for n, u in zip(names, units, strict=True)]
    stored = list(columns)
    if counts:
        stored[-2] = stored[-2].astype(np.int32)
    beside: dict[str, Any] = {}
    if timing != "column":
        for key, value in _clock_lines(rng, truth, timing).items():
            plain = key.replace(" ", "_").replace("[", "").replace("]", "")
            number = value.replace(".", "").replace("e-", "").isdigit()
            beside[plain if suffix == ".mat" else key] = float(value) if number else value
            if suffix == ".mat" and "[" in key:
                beside = {key.split(" [")[0].replace(" ", "_"): f"{value} {key.split('[')[1][:-1]}"}
    own: dict[str, dict[str, object]] = {name: {} for name in names}
    if place == "attributes":
        for name, unit in zip(names, units, strict=True):
            own[name]["units"] = unit
    elif place == "a table of units":
        beside["units"] = json.dumps(dict(zip(names, units, strict=True)))
    elif place == "a list of units":
        beside["units"] = np.array(units) if suffix in (".npz", ".mat") else json.dumps(units)
    elif place == "values beside":
        beside |= {f"{name}_unit": unit for name, unit in zip(names, units, strict=True)}
    if counts:
        if suffix in (".npz", ".mat"):
            beside[f"{names[-2]}_scale"] = truth.factor
        else:
            own[names[-2]]["scale"] = truth.factor
    path = folder / f"loop{suffix}"
    if suffix in (".parquet", ".feather"):
        fields = [
            pa.field(n, pa.array(c).type, metadata={k: str(v) for k, v in own[n].items()})
            for n, c in zip(names, stored, strict=True)
        ]
        schema = pa.schema(fields, metadata={k: str(v) for k, v in beside.items()})
        table = pa.table([pa.array(c) for c in stored], schema=schema)
        write = parquet.write_table if suffix == ".parquet" else feather.write_feather
        write(table, str(path))
    elif suffix == ".h5":
        with h5py.File(path, "w") as file:
            file.attrs.update(beside)
            for name, values in zip(names, stored, strict=True):
                file[name] = values
                file[name].attrs.update(own[name])
    elif suffix == ".tdms":
        channels = [
            ChannelObject("run", n, c, properties=own[n])
            for n, c in zip(names, stored, strict=True)
        ]
        with TdmsWriter(str(path)) as writer:
            writer.write_segment([RootObject(beside), *channels])
    elif suffix == ".npz":
        np.savez(path, **dict(zip(names, stored, strict=True)), **beside)
    else:
        savemat(path, dict(zip(names, stored, strict=True)) | beside)
    return path


def outcome_of(seed: int) -> tuple[str, list[str]]:
    """How the file of a seed is read, and its layout.

    "right": rate, numbers and units are those that are declared, and none where none is;
    "aloud": seconds were assumed with a warning; "listed": a unit was not taken, but is listed as
    not used; "refused": with a remedy; "wrong": anything else.
    """
    with tempfile.TemporaryDirectory() as folder:
        path, truth = draw(seed, Path(folder))
        try:
            (taken,) = read_segments(path)
        except InputError as error:
            remedy = f"{error}".rpartition("; ")[2]
            return (
                "refused" if "--" in remedy else f"refused without an option: {error}"
            ), truth.layout
        recording = taken.recording
    faults, listed = [], False
    aloud = any("s was assumed" in warning for warning in recording.warnings)
    if not np.isclose(recording.rate, truth.rate, rtol=1e-3) and not (aloud and not truth.clocked):
        faults.append(f"rate {recording.rate:g} for {truth.rate:g}")
    for role, at in (("drive", 1), ("response", 2)):
        unit, written = getattr(recording, f"{role}_unit"), truth.units[at]
        values = getattr(truth, role) * (truth.factor if role == "drive" else 1.0)
        scale = 1.0
        if unit == UNSTATED[role]:
            listed = listed or bool(truth.declared and taken.unused)
            if truth.declared and not taken.unused:
                faults.append(f"{role} without its unit {written}")
        else:
            scale = conversion(unit, written)
            if not truth.declared and truth.factor == 1.0:
                faults.append(f"{role} in {unit}, which nobody declared")
            if scale is None:
                faults.append(f"{role} in {unit} for {written}")
                continue
        if not np.allclose(getattr(recording, role) * scale, values, rtol=1e-6, atol=1e-9):
            faults.append(f"{role} with other numbers")
    if faults:
        return f"wrong: {'; '.join(faults)}", truth.layout
    return (
        "listed" if listed else "aloud" if aloud and not truth.clocked else "right"
    ), truth.layout
