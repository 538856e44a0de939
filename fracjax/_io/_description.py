"""Descriptions of a lab's format: a file that says once what the options of `read` say."""

import json
import tomllib
from collections.abc import Mapping
from os import PathLike, fspath

from fracjax._io._files import opened, whole
from fracjax._recording import UNSTATED, InputError, Recording

_PLACES = {
    "time": {"column": "time", "unit": "time_unit", "wrap": "wrap"},
    "drive": {"column": "input", "unit": "input_unit", "scale": "input_scale"},
    "response": {"column": "output", "unit": "output_unit", "scale": "output_scale"},
    "file": {
        key: key for key in ("rate", "resample", "segment", "skip_rows", "names_row", "units_row")
    },
}
"""By section and key, the option of `read` that says the same."""
_HEAD = """\
# How files of one layout are read: give it as --description to any command.
# Options of a call count more than what stands here.
"""


def read_description(path: str | PathLike[str]) -> dict[str, object]:
    """The options of `read` that a description states.

    Raises InputError for a file that is none, or states what nobody knows.
    """
    source = fspath(path)
    with opened(source), open(source, "rb") as file:
        raw = file.read()
    try:
        sections = tomllib.loads(raw.decode("utf-8"))
    except ValueError as error:
        raise InputError.at(
            source, "a description in TOML", str(error)[:100].lower(), "correct that line"
        ) from None
    options: dict[str, object] = {}
    for section, entries in sections.items():
        keys = _PLACES.get(section)
        if keys is None or not isinstance(entries, dict):
            listed = ", ".join(f"[{each}]" for each in _PLACES)
            raise InputError.at(source, f"sections {listed}", f'"{section}"', "correct it")
        for key, value in entries.items():
            if key not in keys or not isinstance(value, str | int | float):
                where = f"{source}, [{section}]"
                given = f'"{key}"' if key not in keys else f"{key} = {value}"
                raise InputError.at(
                    where, f"{', '.join(keys)}, each one value", given, "correct it"
                )
            options[keys[key]] = value
    return options


def write_description(
    path: str | PathLike[str],
    recording: Recording,
    columns: Mapping[str, str | int],
    options: Mapping[str, object],
) -> None:
    """Write how a recording was read: its columns and units, and what the call said besides.

    Raises InputError where the file cannot be written.
    """
    said = {name: value for name, value in options.items() if value is not None}
    said |= columns
    for role, signal in (("input", "drive"), ("output", "response")):
        unit = getattr(recording, f"{signal}_unit")
        if unit != UNSTATED[signal]:
            said[f"{role}_unit"] = unit
    lines = [_HEAD]
    for section, keys in _PLACES.items():
        entries = [
            f"{key} = {json.dumps(said[o], ensure_ascii=False)}"
            for key, o in keys.items()
            if o in said
        ]
        if section in UNSTATED and f"{keys['unit']}" not in said:
            entries.append('# unit = "V"    nobody stated it')
        if entries:
            lines += [f"[{section}]", *entries, ""]
    with whole(path) as part:
        part.write_text("\n".join(lines), encoding="utf-8")
