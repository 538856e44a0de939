"""A measured frequency response: frequencies, complex ratio of response to drive, errors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from os import PathLike, fspath

import numpy as np
from numpy.typing import ArrayLike

from .._blocks import Setting
from .._io import read_table as table_of
from .._recording import InputError, parse_quantity, unit

_LEAST = 3
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


@dataclass(frozen=True)
class FrequencyTable:
    """A measured frequency response (F,) at rising frequencies (F,) [Hz].

    `response`: complex, [response_unit/drive_unit].  `amplitude_errors` (F,), relative to the
    amplitude, and `phase_errors` (F,) [rad] are standard errors, None where unknown.
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

    @property
    def setting(self) -> Setting:
        """What the table says about the size of things, for a drive of one unit."""
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
    drive_unit: str = "V",
    response_unit: str = "um",
    source: str = "table",
) -> FrequencyTable:
    """A table from columns (F,): frequencies [Hz], amplitude ratio [response_unit/drive_unit],
    phase [degrees], and standard errors in the same units where they are known.

    Raises InputError unless all are finite and of one length, frequencies, amplitudes and errors
    above 0, at least three frequencies, none of them twice.
    """
    given = {
        "frequencies": frequencies_Hz,
        "amplitude": amplitude,
        "phase": phase_deg,
        "amplitude errors": amplitude_errors,
        "phase errors": phase_errors_deg,
    }
    columns = {n: np.asarray(c, dtype=float) for n, c in given.items() if c is not None}
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
                "others",
                "correct them",
            )
    if count < _LEAST or np.unique(columns["frequencies"]).size < count:
        raise InputError.at(
            f"{source}, frequencies",
            f"at least {_LEAST} different ones",
            f"{np.unique(columns['frequencies']).size} among {count}",
            "measure more, or average those of one frequency",
        )
    unit(drive_unit, f"{source}, drive")
    unit(response_unit, f"{source}, response")
    order = np.argsort(columns["frequencies"])
    columns = {name: column[order] for name, column in columns.items()}
    of_amplitude, of_phase = columns.get("amplitude errors"), columns.get("phase errors")
    return FrequencyTable(
        frequencies_Hz=columns["frequencies"],
        response=columns["amplitude"] * np.exp(1j * np.radians(columns["phase"])),
        amplitude_errors=None if of_amplitude is None else of_amplitude / columns["amplitude"],
        phase_errors=None if of_phase is None else np.radians(of_phase),
        drive_unit=drive_unit,
        response_unit=response_unit,
        source=source,
    )


def read_frequency_table(
    path: str | PathLike[str], *, drive_unit: str | None = None, response_unit: str | None = None
) -> FrequencyTable:
    """A frequency response from a file of named columns, of any format that `read` takes.

    Columns: frequency [Hz], or any multiple, or rad/s; amplitude (magnitude, gain) as a ratio
    such as [um/V], or in dB of `response_unit`/`drive_unit`; phase in degrees or rad; or, instead
    of both, real and imaginary part.  With "error" in the name, standard errors of amplitude and
    phase, in the same units.  The units of the ratio are the amplitude's, or given, or um/V.
    Raises InputError where a column is missing, ambiguous, or in another unit.
    """
    source = fspath(path)
    table = table_of(source)
    found: dict[str, tuple[np.ndarray, str]] = {}
    for column, full in enumerate(table.names):
        name, written = _split(full)
        role = _role_of(name)
        if role is None:
            continue
        if role in found:
            raise InputError.at(
                source, f"one column for {role}", f'"{full}" too', "rename or remove it"
            )
        found[role] = table.numbers(column), table.about(column).unit or written
    if "real" in found and "imaginary" in found and "amplitude" not in found:
        found |= _polar(found["real"], found["imaginary"], source)
    for role in ("frequency", "amplitude", "phase"):
        if role not in found:
            names = ", ".join(f'"{name}"' for name in table.names) or "columns without names"
            raise InputError.at(
                source,
                f"a column for {role}, such as {_EXAMPLES[role]}",
                names,
                "name it so; for amplitudes alone there are tfocim and ofocim"
                if role == "phase"
                else "name it so",
            )
    frequencies, written = found["frequency"]
    amplitude, ratio = found["amplitude"]
    of_ratio = re.fullmatch(r"([^/]+)/([^/]+)", ratio)
    decibels = ratio.casefold() == "db"
    errors = found.get("amplitude error")
    relative = None if errors is None else errors[0]
    if decibels:
        amplitude = 10 ** (amplitude / 20)
        relative = None if relative is None else amplitude * relative * np.log(10) / 20
    phase_errors = found.get("phase error")
    return frequency_table(
        frequencies * _hertz(written, f"{source}, frequency"),
        amplitude,
        _degrees(*found["phase"], f"{source}, phase"),
        amplitude_errors=relative,
        phase_errors_deg=None
        if phase_errors is None
        else _degrees(phase_errors[0], phase_errors[1] or found["phase"][1], f"{source}, phase"),
        drive_unit=drive_unit or (of_ratio[2].strip() if of_ratio else "V"),
        response_unit=response_unit or (of_ratio[1].strip() if of_ratio else "um"),
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
    """A column's name without its unit, and the unit as written, or nothing."""
    parts = _UNITS.fullmatch(name)
    return (parts[1], next(filter(None, parts.groups()[1:]), "")) if parts else (name, "")


def _role_of(name: str) -> str | None:
    words = set(re.split(r"[\W_\d]+", name.casefold()))
    roles = [role for role, known in _WORDS.items() if words & known]
    if len(roles) != 1:
        return None
    return f"{roles[0]} error" if words & _ERROR else roles[0]


def _hertz(written: str, where: str) -> float:
    """The frequency's unit in Hz; Hz where none is written."""
    if written.replace("_", "/") == "rad/s":
        return 1 / (2 * np.pi)
    return parse_quantity(f"1 {written or 'Hz'}", "Hz", where)


def _degrees(values: np.ndarray, written: str, where: str) -> np.ndarray:
    """Angles in degrees; they are where nothing is written."""
    return values * parse_quantity(f"1 {written.replace('°', 'deg') or 'deg'}", "deg", where)
