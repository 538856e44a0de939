"""A measured frequency response: frequencies, complex ratio of response to drive, errors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike, fspath

import numpy as np
from numpy.typing import ArrayLike

from .._blocks import Setting
from .._io import read_table as table_of
from .._io import write
from .._recording import UNSTATED, InputError, parse_quantity, unit
from .._show import Shown

_LEAST = 3
"""Fewest frequencies of a table; chosen by judgement."""
_WORDS = {
    "frequency": {"frequency", "frequencies", "freq", "f", "omega", "w"},
    "amplitude": {"amplitude", "magnitude", "gain", "ratio", "amp", "mag", "abs"},
    "phase": {"phase", "angle", "arg", "ph"},
    "real": {"real", "re"},
    "imaginary": {"imag", "imaginary", "im"},
}
_ERROR = {"error", "err", "sd", "std", "sigma", "uncertainty", "se"}
_UNITS = re.compile(
    r"(.*?)(?:[\s_]*[\[(]\s*([^\])]*?)\s*[\])]|_(m?k?Hz|rad_s|rad/s|dB|deg|rad|degrees)"
    r"|\s+/\s+(\S+))",
    re.IGNORECASE,
)


@dataclass(frozen=True, repr=False)
class FrequencyTable(Shown):
    """A measured frequency response at rising frequencies.

    Attributes:
        frequencies_Hz: Frequencies (F,) [Hz].
        response: Complex ratio of response to drive (F,) [response_unit/drive_unit].
        amplitude_errors: Standard errors of the amplitude (F,), relative to it, or None.
        phase_errors: Standard errors of the phase (F,) [rad], or None.
        drive_unit: Unit of the drive.
        response_unit: Unit of the response.
        source: Name of the table, for messages.
    """

    frequencies_Hz: np.ndarray
    response: np.ndarray
    amplitude_errors: np.ndarray | None
    phase_errors: np.ndarray | None
    drive_unit: str
    response_unit: str
    source: str

    def __len__(self) -> int:
        return len(self.frequencies_Hz)

    def write(self, path: str | PathLike[str]) -> None:
        """Write the table, from which `read_frequency_table` reads the same.

        Args:
            path: The file; its suffix sets the format, as in `fracjax.write`.

        Raises:
            InputError: The suffix is unknown or the file cannot be written.
        """
        unit, sizes = f"[{self.response_unit}/{self.drive_unit}]", np.abs(self.response)
        columns = {
            "frequency_Hz": self.frequencies_Hz,
            f"amplitude {unit}": sizes,
            "phase_deg": np.degrees(np.unwrap(np.angle(self.response))),
        }
        if self.amplitude_errors is not None:
            columns[f"amplitude error {unit}"] = sizes * self.amplitude_errors
        if self.phase_errors is not None:
            columns["phase_error_deg"] = np.degrees(self.phase_errors)
        write(path, columns)

    @property
    def setting(self) -> Setting:
        """Sizes that scale a model's starting values, for a drive of unit amplitude."""
        lowest, highest = float(self.frequencies_Hz[0]), float(self.frequencies_Hz[-1])
        return Setting(
            drive_low=0.0,
            drive_high=1.0,
            response_span=float(np.abs(self.response).max()),
            step=0.1 / highest,
            duration=1 / lowest,
            top_frequency=highest,
            top_rate=np.pi * highest,
            rms_rate=np.pi * highest / np.sqrt(2),
            response_low=0.0,
            resolution=0.0,
        )


def frequency_table(
    frequencies_Hz: ArrayLike,
    amplitude: ArrayLike,
    phase_deg: ArrayLike,
    *,
    amplitude_errors: ArrayLike | None = None,
    phase_errors_deg: ArrayLike | None = None,
    drive_unit: str = "",
    response_unit: str = "",
    source: str = "table",
) -> FrequencyTable:
    """Make a frequency table from columns.

    Args:
        frequencies_Hz: Frequencies (F,) [Hz], in any order.
        amplitude: Amplitude ratios (F,) [response_unit/drive_unit].
        phase_deg: Phases (F,) [degrees].
        amplitude_errors: Standard errors of the amplitude (F,) [response_unit/drive_unit].
        phase_errors_deg: Standard errors of the phase (F,) [degrees].
        drive_unit: Unit of the drive.
        response_unit: Unit of the response.
        source: Name of the table, for messages.

    Returns:
        The table, sorted by frequency.

    Raises:
        InputError: A column has another length or values that are not finite; a frequency,
            amplitude or error is not above 0; there are fewer than three frequencies, or one
            occurs twice; or a unit is unknown.
    """
    named = {
        "frequencies": frequencies_Hz,
        "amplitude": amplitude,
        "phase": phase_deg,
        "amplitude errors": amplitude_errors,
        "phase errors": phase_errors_deg,
    }
    columns = {n: np.asarray(c, dtype=float) for n, c in named.items() if c is not None}
    count = columns["frequencies"].size
    for name, column in columns.items():
        if column.shape != (count,):
            raise InputError.at(
                f"{source}, {name}",
                f"a list of {count} numbers",
                f"shape {column.shape}",
                "match it",
            )
        if not np.all(np.isfinite(column) & ((column > 0) | (name == "phase"))):
            raise InputError.at(
                f"{source}, {name}",
                "finite numbers" if name == "phase" else "finite numbers above 0",
                "other values",
                "correct them",
            )
    if count < _LEAST or np.unique(columns["frequencies"]).size < count:
        raise InputError.at(
            f"{source}, frequencies",
            f"at least {_LEAST} different ones",
            f"{np.unique(columns['frequencies']).size} among {count}",
            "measure more, or average those of one frequency",
        )
    drive_unit = drive_unit or UNSTATED["drive"]
    response_unit = response_unit or UNSTATED["response"]
    unit(drive_unit, f"{source}, drive")
    unit(response_unit, f"{source}, response")
    order = np.argsort(columns["frequencies"])
    columns = {name: column[order] for name, column in columns.items()}
    amplitude_sd, phase_sd = columns.get("amplitude errors"), columns.get("phase errors")
    return FrequencyTable(
        frequencies_Hz=columns["frequencies"],
        response=columns["amplitude"] * np.exp(1j * np.radians(columns["phase"])),
        amplitude_errors=None if amplitude_sd is None else amplitude_sd / columns["amplitude"],
        phase_errors=None if phase_sd is None else np.radians(phase_sd),
        drive_unit=drive_unit,
        response_unit=response_unit,
        source=source,
    )


def read_frequency_table(
    path: str | PathLike[str], *, drive_unit: str | None = None, response_unit: str | None = None
) -> FrequencyTable:
    """Read a frequency response from a file of named columns, of any format that `read` accepts.

    The file has a column for the frequency (in Hz, a multiple of it, or rad/s), one for the
    amplitude (or magnitude, gain) as a ratio such as [um/V] or in dB of response unit per drive
    unit, and one for the phase (in degrees or rad), or, instead of these two, real and imaginary
    part.  Columns with "error" in their name hold
    standard errors, in the same units.

    Args:
        path: The file.
        drive_unit: Unit of the drive; by default that of the amplitude's column.
        response_unit: Unit of the response; by default that of the amplitude's column.

    Returns:
        The table, sorted by frequency.

    Raises:
        InputError: A column is missing, ambiguous or in another unit, or as `frequency_table`.
    """
    source = fspath(path)
    table = table_of(source)
    columns: dict[str, tuple[np.ndarray, str]] = {}
    for column, heading in enumerate(table.names):
        name, unit_as_written = _split(heading)
        role = _role_of(name)
        if role is None:
            continue
        if role in columns:
            raise InputError.at(
                source, f"one column for {role}", f'"{heading}" as well', "rename or remove it"
            )
        columns[role] = table.numbers(column), table.about(column).unit or unit_as_written
    if "real" in columns and "imaginary" in columns and "amplitude" not in columns:
        columns |= _polar(columns["real"], columns["imaginary"], source)
    for role in ("frequency", "amplitude", "phase"):
        if role not in columns:
            names = ", ".join(f'"{name}"' for name in table.names) or "columns without names"
            raise InputError.at(
                source,
                f"a column for {role}, such as {_EXAMPLES[role]}",
                names,
                "name one so; for amplitudes alone there are tfocim and ofocim"
                if role == "phase"
                else "name one so",
            )
    frequencies, unit_as_written = columns["frequency"]
    amplitude, ratio = columns["amplitude"]
    ratio_units = re.fullmatch(r"([^/]+)/([^/]+)", ratio)
    decibels = ratio.casefold() == "db"
    errors = columns.get("amplitude error")
    relative = None if errors is None else errors[0]
    if decibels:
        amplitude = 10 ** (amplitude / 20)
        relative = None if relative is None else amplitude * relative * np.log(10) / 20
    phase_errors = columns.get("phase error")
    return frequency_table(
        frequencies * _hertz(unit_as_written, f"{source}, frequency"),
        amplitude,
        _degrees(*columns["phase"], f"{source}, phase"),
        amplitude_errors=relative,
        phase_errors_deg=None
        if phase_errors is None
        else _degrees(phase_errors[0], phase_errors[1] or columns["phase"][1], f"{source}, phase"),
        drive_unit=drive_unit or (ratio_units[2].strip() if ratio_units else ""),
        response_unit=response_unit or (ratio_units[1].strip() if ratio_units else ""),
        source=source,
    )


def _polar(
    real: tuple[np.ndarray, str], imaginary: tuple[np.ndarray, str], source: str
) -> dict[str, tuple[np.ndarray, str]]:
    """Amplitude and phase [rad] of real and imaginary part, each with its unit."""
    if real[1] != imaginary[1]:
        raise InputError.at(
            source, "one unit of both parts", f'"{real[1]}" and "{imaginary[1]}"', "convert one"
        )
    response = real[0] + 1j * imaginary[0]
    return {"amplitude": (np.abs(response), real[1]), "phase": (np.angle(response), "rad")}


_EXAMPLES = {
    "frequency": '"frequency_Hz"',
    "amplitude": '"amplitude [um/V]" or "magnitude_dB"',
    "phase": '"phase_deg"',
}


def _split(name: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit as written; the unit may be empty."""
    parts = _UNITS.fullmatch(name)
    return (parts[1], next(filter(None, parts.groups()[1:]), "")) if parts else (name, "")


def _role_of(name: str) -> str | None:
    """What a column holds according to its name; None if no role or several fit."""
    words = set(re.split(r"[\W_\d]+", name.casefold()))
    roles = [role for role, keywords in _WORDS.items() if words & keywords]
    if len(roles) != 1:
        return None
    return f"{roles[0]} error" if words & _ERROR else roles[0]


def _hertz(unit_as_written: str, where: str) -> float:
    """Factor from the frequency's unit to Hz; an empty unit means Hz."""
    if unit_as_written.replace("_", "/") == "rad/s":
        return 1 / (2 * np.pi)
    return parse_quantity(f"1 {unit_as_written or 'Hz'}", "Hz", where)


def _degrees(values: np.ndarray, unit_as_written: str, where: str) -> np.ndarray:
    """Angles in degrees; an empty unit means degrees."""
    return values * parse_quantity(
        f"1 {unit_as_written.replace('°', 'deg') or 'deg'}", "deg", where
    )
