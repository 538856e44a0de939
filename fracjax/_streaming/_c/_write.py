"""The files of a stream in C: code, header, test vector, and a Makefile that checks it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from string import Template
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..._recording import InputError
from .._program import FLAGS, HELD, LEVEL, RESTARTED, SLEW, Described, sound
from ._emit import Names, body_of, flattened, number, size_of

TEMPLATES = Path(__file__).parent
_SAMPLES = 4096
"""Samples of the test vector; chosen by judgement."""
_TOLERANCE = {"double": 1e-9, "float": 2e-3}
"""By which share of the drive's range C may differ from Python along the test vector: of rounding
in double precision; in single precision by trial, the largest where a mode is inverted."""
_KEYWORDS = (
    "auto", "break", "case", "char", "const", "continue", "default", "do", "double", "else", "enum",
    "extern", "float", "for", "goto", "if", "inline", "int", "long", "register", "restrict",
    "return", "short", "signed", "sizeof", "static", "struct", "switch", "typedef", "union",
    "unsigned", "void", "volatile", "while",
)  # fmt: skip
REALS = {"double": ("", "DBL_EPSILON"), "float": ("##f", "FLT_EPSILON")}
"""What follows the name of a number or of a function of math.h, and the rounding error."""


def checked_name(name: str) -> None:
    """Raises InputError when a name is no C identifier."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name) or name in _KEYWORDS:
        raise InputError.at("C code, name", "a C identifier", f'"{name}"', "choose another name")


def write_c(stream: Described, folder: Path, name: str, real: str) -> list[Path]:
    """Write the files of a stream."""
    checked_name(name)
    if real not in REALS:
        raise InputError.at("C code, real", '"double" or "float"', f'"{real}"', "choose one")
    folder.mkdir(parents=True, exist_ok=True)
    code = Code(stream, name)
    vector = vector_of(stream)
    files = {
        f"{name}.h": code.fill("stage.h.in", real),
        f"{name}.c": code.fill("stage.c.in", real),
        f"{name}_test.c": code.fill("test.c.in", real),
        f"{name}_vector.csv": _table(vector),
        "Makefile": code.fill("Makefile.in", real),
    }
    for file, text in files.items():
        (folder / file).write_text(text, encoding="utf-8")
    return [folder / file for file in files]


@lru_cache(maxsize=1)
def vector_of(stream: Described) -> dict[str, np.ndarray]:
    """Inputs and what Python makes of them: swings, steps that meet the limits, and a sample that
    is no number, from rest at the middle of the drive's range."""
    program, count = stream.program, _SAMPLES
    low, high = stream.limits
    state = stream.start((low + high) / 2)
    times = np.arange(count) / count
    random = np.random.default_rng(0)
    shape = 0.5 + 0.45 * np.sin(2 * np.pi * (1 + 5 * times) * times) * (1 - 0.5 * times)
    shape[3 * count // 4 :] += np.where(np.arange(count - 3 * count // 4) % 200 < 100, 0.0, 0.9)
    inputs = {}
    if program.inputs[0] == "drive":
        inputs["drive"] = low + (high - low) * shape
    else:
        ends = [float(_response_at_rest(stream, drive)) for drive in (low, high)]
        inputs["desired"] = ends[0] + (ends[1] - ends[0]) * shape
        if "measured" in program.inputs:
            noise = 1e-3 * (ends[1] - ends[0]) * random.standard_normal(count)
            inputs["measured"] = 1.02 * inputs["desired"] + noise
    next(iter(inputs.values()))[count // 2] = np.nan
    output, predicted, flags = stream.run(tuple(inputs.values()), state)
    return {**inputs, "output": output, "predicted": predicted, "flags": flags}


def _response_at_rest(stream: Described, drive: float) -> np.ndarray:
    """The response at rest at a drive [response]."""
    return stream.start(drive)["desired"]


def _table(columns: dict[str, np.ndarray]) -> str:
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    lines = (",".join("nan" if x != x else repr(x) for x in row) for row in rows)
    return ",".join(columns) + "\n" + "\n".join(lines) + "\n"


class Code:
    """The code of a stream: statements, constants, the state's fields, and what they cost."""

    def __init__(self, stream: Described, name: str):
        self.stream, self.name = stream, name
        program = stream.program
        with jax.enable_x64(True):
            state = stream.start(0.0)
            leaves, tree = jax.tree.flatten(state)
            paths = jax.tree_util.tree_leaves_with_path(state)
            self.fields = [(_identifier(path), leaf.shape) for path, leaf in paths]
            one = jnp.zeros(())
            start = jax.make_jaxpr(lambda drive: jax.tree.leaves(program.start(drive)))(one)

            def step(eps: Any, inputs: list[Any], values: list[Any]) -> Any:
                output, after = program.step(eps, tree.unflatten(values), *inputs)
                return [*output, *jax.tree.leaves(after)]

            inputs = [one] * len(program.inputs)
            moved = jax.make_jaxpr(step)(one, inputs, [jnp.asarray(leaf) for leaf in leaves])
            whole = jax.make_jaxpr(lambda values: sound(tree.unflatten(values)))(leaves)
        self.names = Names()
        self.sound = self._function(whole, [], ["sound"], stored=False)
        self.start = self._function(start, ["drive"], [])
        self.names.operations = 0
        self.step = self._function(
            moved, ["R_EPSILON", *program.inputs], ["drive", "predicted", "flags"]
        )
        self.operations = self.names.operations

    def _function(
        self, program: Any, inputs: list[str], outputs: list[str], stored: bool = True
    ) -> str:
        """The body of a function of inputs and, where it reads it, the state."""
        operations, given, results = flattened(program)
        reads = [f"s->{field}" for field, _ in self.fields]
        for value, text in zip(given, [*inputs, *reads], strict=False):
            self.names.of[value] = text
        lines = body_of(operations, results, self.names)
        # What is set is written after everything was read.
        for text, value in zip(outputs, results, strict=False):
            lines.append(
                f"    const {'int' if text in ('flags', 'sound') else 'real'} out_{text} = "
                f"{self._read(value)};"
            )
        for (field, shape), value in zip(
            self.fields if stored else [], results[len(outputs) :], strict=True
        ):
            if self.names.of.get(value) == f"s->{field}":
                continue
            if shape:
                size = size_of(value)
                lines.append(
                    f"    for (int i = 0; i < {size}; ++i) s->{field}[i] = {self._read(value)};"
                )
            else:
                lines.append(f"    s->{field} = {self._read(value)};")
        return "\n".join(lines)

    def _read(self, value: Any) -> str:
        from ._emit import _at

        return _at(value, "i", {}, self.names)

    @property
    def bytes(self) -> int:
        """Bytes of the state and of the constants, in double precision."""
        state = sum(int(np.prod(shape)) for _, shape in self.fields)
        return 8 * (state + sum(each.size for each in self.names.constants.values()))

    def fill(self, template: str, real: str, others: Mapping[str, str] | None = None) -> str:
        """A template with everything filled in, and with what only this one has."""
        stream, program = self.stream, self.stream.program
        suffix, epsilon = REALS[real]
        inverse = program.inputs[0] == "desired"
        drive, response = stream.units
        units = {"desired": response, "measured": response, "drive": drive}
        factor = 1 if real == "double" else 0.5
        low, high = stream.limits
        fields = {
            "NAME": self.name,
            "UPPER": self.name.upper(),
            "MODEL": stream.model.replace("*/", ""),
            "WHAT": "The inverse" if inverse else "The model",
            "ABOUT": "\n".join(f" * {line}" for line in stream.about.splitlines()[1:]),
            "FROM": ", ".join(f"{each} [{units[each]}]" for each in program.inputs),
            "TO": f"drive [{drive}]" if inverse else f"response [{response}]",
            "OPERATIONS": str(self.operations),
            "BYTES": str(round(factor * self.bytes)),
            "REAL": real,
            "SUFFIX": suffix,
            "EPSILON": epsilon,
            "STEP": repr(stream.step),
            "LOW": repr(low),
            "HIGH": repr(high),
            "STATE": "\n".join(
                f"    real_{self.name} {field}{f'[{int(np.prod(shape))}]' if shape else ''};"
                for field, shape in self.fields
            ),
            "ARGUMENTS": ", ".join(f"real_{self.name} {each}" for each in program.inputs),
            "INPUTS": str(len(program.inputs)),
            "CALL": ", ".join(f"(real_{self.name})x[{k}]" for k in range(len(program.inputs))),
            "TOLERANCE": repr(_TOLERANCE[real]),
            "RANGE": repr(high - low if inverse else float(np.ptp(vector_of(stream)["output"]))),
            "MIDDLE": repr((low + high) / 2),
            "CONSTANTS": "\n".join(map(_constant, *zip(*self.names.constants.items(), strict=True)))
            if self.names.constants
            else "",
            "START": self.start,
            "BODY": self.step,
            "SOUND": self.sound,
            "FLAGS": "\n".join(
                f"#define {self.name.upper()}_{label} {flag} /* {FLAGS[flag]} */"
                for label, flag in (
                    ("HELD", HELD), ("LEVEL", LEVEL), ("SLEW", SLEW), ("RESTARTED", RESTARTED)
                )
            ),
        }  # fmt: skip
        text = (TEMPLATES / template).read_text(encoding="utf-8")
        return Template(text).substitute(fields, **(others or {}))


def _identifier(path: Any) -> str:
    """A place in the state as a C identifier: stage[0]["law"]["play"] → stage0_law_play."""
    parts = [str(getattr(key, "key", getattr(key, "idx", ""))) for key in path]
    text = "_".join(parts)
    return re.sub(r"_(\d)", r"\1", text)


def _constant(name: str, values: np.ndarray) -> str:
    """A constant array in C, with every digit."""
    kind = "real" if values.dtype.kind == "f" else "int"
    rows = ",\n    ".join(", ".join(map(number, row)) for row in _by_fours(values))
    return f"static const {kind} {name}[{values.size}] = {{\n    {rows},\n}};"


def _by_fours(values: np.ndarray) -> list[np.ndarray]:
    return [values[k : k + 4] for k in range(0, values.size, 4)]
