"""A stream as an FMU 3.0 for co-simulation: its C code, a description, and a binary for this
machine.

Source: Modelica Association, Functional Mock-up Interface Specification 3.0 (2022).
"""

from __future__ import annotations

import hashlib
import platform
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import jinja2

from ..._recording import InputError, unit
from .._program import FLAGS, Described
from ._write import TEMPLATES, Code, checked_name

_BASES = {
    "kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol",
    "candela": "cd", "radian": "rad",
}  # fmt: skip
_COMPILERS = ("cc", "gcc", "clang")
_SUFFIXES = {
    "linux": ("linux", ".so"),
    "darwin": ("darwin", ".dylib"),
    "win32": ("windows", ".dll"),
}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
_FIRST = 2
"""The reference of the first input; before it are the time and the drive at rest."""
_TEXTS = {
    "desired": "The desired response",
    "measured": "The measured response",
    "drive": "The drive",
    "response": "The response",
}


def write_fmu(stream: Described, folder: Path, name: str) -> Path:
    """Write NAME.fmu: sources for every machine, and a binary for this one where it has a compiler.

    Raises InputError when the name is no C identifier, or the compiler does not work.
    """
    checked_name(name)
    code = Code(stream, name)
    sources = {f"{name}.{end}": code.fill(f"stage.{end}.in", "double") for end in ("c", "h")}
    token = hashlib.sha256("".join(sources.values()).encode()).hexdigest()[:32]
    sources[f"{name}_fmu.c"] = code.fill("fmu.c.in", "double", _starts(stream, token))
    sources["buildDescription.xml"] = code.fill("buildDescription.xml.in", "double")
    files = {
        "modelDescription.xml": _description(stream, name, token).encode(),
        **{f"sources/{file}": text.encode() for file, text in sources.items()},
        **_binary(sources, name),
    }
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.fmu"
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for file, content in files.items():
            # Without the time of day: the same stream is the same file.
            archive.writestr(ZipInfo(file), content, ZIP_DEFLATED)
    return path


def platforms(path: Path) -> tuple[str, ...]:
    """The platforms that an FMU has a binary for, such as x86_64-linux."""
    with ZipFile(path) as archive:
        names = [name.split("/") for name in archive.namelist()]
    return tuple(parts[1] for parts in names if parts[0] == "binaries")


def _at_rest(stream: Described) -> tuple[float, dict[str, float]]:
    """The drive at rest [drive] and what the inputs are then."""
    low, high = stream.limits
    rest = min(max(0.0, low), high)
    state = stream.start(rest)
    reading = float(state["desired"]) if "desired" in state else 0.0
    return rest, {"drive": rest, "desired": reading, "measured": reading}


def _starts(stream: Described, token: str) -> dict[str, str]:
    """What the FMU's code has besides that of the stream."""
    rest, values = _at_rest(stream)
    inputs = stream.program.inputs
    return {
        "TOKEN": token,
        "REST": repr(rest),
        "STARTS": ", ".join(repr(values[name]) for name in inputs),
        "GIVEN": ", ".join(f"c->inputs[{k}]" for k in range(len(inputs))),
    }


def _description(stream: Described, name: str, token: str) -> str:
    """modelDescription.xml."""
    drive, response = stream.units
    inputs, (rest, values) = stream.program.inputs, _at_rest(stream)
    inverse = inputs[0] == "desired"
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(
        (TEMPLATES / "modelDescription.xml.jinja").read_text("utf-8")
    )
    variables = [
        {
            "name": each,
            "reference": _FIRST + k,
            "start": repr(values[each]),
            "unit": drive if each == "drive" else response,
            "text": _TEXTS[each],
        }
        for k, each in enumerate(inputs)
    ]
    output = "drive" if inverse else "response"
    return template.render(
        name=name,
        token=token,
        what="The inverse" if inverse else "The model",
        model=stream.model,
        step=repr(stream.step),
        units=[_unit(each) for each in dict.fromkeys(stream.units)],
        rest=repr(rest),
        drive=drive,
        response=response,
        inputs=variables,
        output={
            "name": output,
            "reference": _FIRST + len(inputs),
            "unit": drive if inverse else response,
            "text": _TEXTS[output],
        },
        flags="; ".join(f"{flag}: {text}" for flag, text in FLAGS.items()),
    )


def _unit(text: str) -> dict:
    """A unit by its base units; without them where it has others than those of the SI."""
    scale, base = unit(text, "FMU, units")[:2]
    powers = {_BASES.get(name): power for name, power in base}
    standard = None not in powers and all(power == int(power) for power in powers.values())
    if not standard:
        return {"name": text, "powers": None}
    ordered = {name: int(powers[name]) for name in _BASES.values() if name in powers}
    return {"name": text, "powers": list(ordered.items()), "factor": repr(float(scale))}


def _binary(sources: dict[str, str], name: str) -> dict[str, bytes]:
    """The shared library for this machine, by its path in the FMU; none without a compiler."""
    compiler = next(filter(None, map(shutil.which, _COMPILERS)), None)
    if compiler is None or sys.platform not in _SUFFIXES:
        return {}
    system, suffix = _SUFFIXES[sys.platform]
    machine = platform.machine().lower()
    flags = ["-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden"]
    with TemporaryDirectory() as scratch:
        for file, text in sources.items():
            (Path(scratch) / file).write_text(text, encoding="utf-8")
        library = Path(scratch) / f"{name}{suffix}"
        command = [compiler, *flags, f"{name}_fmu.c", f"{name}.c", "-o", library.name, "-lm"]
        done = subprocess.run(command, cwd=scratch, capture_output=True, text=True)
        if done.returncode:
            raise InputError.at(
                f"FMU, {compiler}",
                "a C compiler that makes a shared library",
                done.stderr.strip().partition("\n")[0],
                "mend it; without any compiler on the path, the sources alone are written",
            )
        where = f"binaries/{_MACHINES.get(machine, machine)}-{system}/{library.name}"
        return {where: library.read_bytes()}
