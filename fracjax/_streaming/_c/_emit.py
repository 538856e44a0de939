"""A JAX program as the body of a C function.

The program is made of numbers and arrays of fixed shapes.  Nested calls are inlined, what nobody
uses is dropped, and neighbouring operations on arrays of one size share a loop; what only the loop
needs is a local number there.  A `while` becomes a loop with its condition at the top.  There is no
pointer, no allocation, and no call but those of math.h.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jax.extend.core import ClosedJaxpr, Literal

_CALLS = ("pjit", "jit", "custom_jvp_call", "custom_vjp_call", "closed_call")
"""Primitives that only call another program."""
_INFIX = {
    "add": "+", "add_any": "+", "sub": "-", "mul": "*", "div": "/",
    "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!=", "and": "&", "or": "|",
}  # fmt: skip
_FUNCTIONS = {
    "exp": "R(exp)({0})", "expm1": "R(expm1)({0})", "log": "R(log)({0})", "sqrt": "R(sqrt)({0})",
    "abs": "R(fabs)({0})", "pow": "R(pow)({0}, {1})", "floor": "R(floor)({0})",
    "tanh": "R(tanh)({0})", "neg": "-{0}", "not": "!{0}", "square": "{0} * {0}",
    "max": "{0} > {1} ? {0} : {1}", "min": "{0} < {1} ? {0} : {1}",
    "sign": "(real)(({0} > 0) - ({0} < 0))", "is_finite": "isfinite({0}) ? 1 : 0",
    "select_n": "{0} ? {2} : {1}", "copy": "{0}", "stop_gradient": "{0}",
}  # fmt: skip


@dataclass(frozen=True)
class Operation:
    """One operation: its primitive, what it reads and makes, and its parameters."""

    name: str
    reads: tuple[Any, ...]
    makes: tuple[Any, ...]
    parameters: dict[str, Any]


@dataclass
class Names:
    """The C names of values, and the constants that the code needs."""

    of: dict[Any, str] = field(default_factory=dict)
    constants: dict[str, np.ndarray] = field(default_factory=dict)
    operations: int = 0

    def constant(self, value: np.ndarray) -> str:
        """The name of a constant array, each kept once."""
        for name, other in self.constants.items():
            if other.shape == value.shape and np.array_equal(other, value):
                return name
        name = f"c{len(self.constants)}"
        self.constants[name] = value
        return name

    def new(self, variable: Any) -> str:
        """A new name for a value."""
        return self.of.setdefault(variable, f"v{len(self.of)}")


class Fixed:
    """A value that is known when the code is written."""

    def __init__(self, value: Any):
        self.value = np.asarray(value)
        self.aval = self.value


def flattened(program: ClosedJaxpr) -> tuple[list[Operation], list[Any], list[Any]]:
    """The operations of a program with all calls inlined, its inputs and its outputs."""
    places: dict[Any, Any] = {}

    def place(variable: Any) -> Any:
        if isinstance(variable, Literal):
            return Fixed(variable.val)
        return places.get(variable, variable)

    def walk(jaxpr: Any) -> Iterator[Operation]:
        for equation in jaxpr.eqns:
            name, parameters = equation.primitive.name, equation.params
            reads = tuple(place(v) for v in equation.invars)
            if name in _CALLS:
                inner = parameters.get("jaxpr") or parameters["call_jaxpr"]
                body = inner.jaxpr
                yield from enter(body, [Fixed(c) for c in inner.consts], reads)
                for made, result in zip(equation.outvars, body.outvars, strict=True):
                    places[made] = place(result)
                # A function that is called twice is one program: its values are made anew.
                continue
            makes = tuple(_Value(v.aval) for v in equation.outvars)
            places.update(zip(equation.outvars, makes, strict=True))
            yield Operation(name, reads, makes, dict(parameters))

    def enter(body: Any, consts: Sequence[Any], reads: Sequence[Any]) -> Iterator[Operation]:
        places.update(zip(body.constvars, consts, strict=True))
        places.update(zip(body.invars, reads, strict=True))
        return walk(body)

    jaxpr = program.jaxpr
    inputs = [_Value(v.aval) for v in jaxpr.invars]
    operations = list(enter(jaxpr, [Fixed(c) for c in program.consts], inputs))
    return operations, inputs, [place(v) for v in jaxpr.outvars]


class _Value:
    """A value that the code computes."""

    def __init__(self, aval: Any):
        self.aval = aval


def used(operations: list[Operation], outputs: Sequence[Any]) -> list[Operation]:
    """The operations on which the outputs depend."""
    needed, kept = {id(v) for v in outputs}, []
    for operation in reversed(operations):
        if any(id(v) in needed for v in operation.makes):
            needed.update(id(v) for v in operation.reads)
            kept.append(operation)
    return kept[::-1]


def size_of(value: Any) -> int:
    """How many numbers a value has."""
    return math.prod(np.shape(value.aval) if isinstance(value, Fixed) else value.aval.shape)


def number(value: Any) -> str:
    """A number as C writes it, with every digit."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(int(value))
    if not math.isfinite(value):
        return ("-" if value < 0 else "") + "R_INFINITY"
    text = repr(float(value))
    return f"C({text})" if value >= 0 else f"-C({text[1:]})"


def body_of(
    operations: list[Operation], outputs: Sequence[Any], names: Names, depth: int = 1
) -> list[str]:
    """The statements that compute the outputs, in order."""
    operations = used(operations, outputs)
    lines: list[str] = []
    at = 0
    while at < len(operations):
        group = _group(operations[at:])
        wanted = {id(v) for v in outputs}
        wanted |= {id(v) for each in operations[at + len(group) :] for v in each.reads}
        if len(group) > 1 or _is_elementwise(operations[at]):
            lines += _loop(group, wanted, names)
        else:
            lines += _alone(operations[at], names)
        at += len(group)
    return ["    " * (depth - 1) + line for line in lines]


def _group(operations: list[Operation]) -> list[Operation]:
    """The first operation and those after it that share its loop."""
    first = operations[0]
    size = size_of(first.makes[0])
    if not _is_elementwise(first) or size == 1:
        return [first]
    group = []
    for operation in operations:
        if not _is_elementwise(operation) or size_of(operation.makes[0]) != size:
            break
        group.append(operation)
    return group


def _is_elementwise(operation: Operation) -> bool:
    """Whether each number made depends on numbers at known places."""
    return operation.name in _INFIX or operation.name in _FUNCTIONS or operation.name in (
        "integer_pow", "convert_element_type", "broadcast_in_dim", "reshape", "squeeze", "slice",
        "concatenate", "expand_dims",
    )  # fmt: skip


def _loop(group: list[Operation], wanted: set[int], names: Names) -> list[str]:
    """One loop, or statements without one for single numbers."""
    size = size_of(group[0].makes[0])
    inside: dict[int, str] = {}
    before, statements = [], []
    for operation in group:
        made = operation.makes[0]
        names.operations += size * (operation.name in _INFIX or operation.name in _FUNCTIONS)
        # A value that is read at another place of the array than its own must have been stored.
        expression = _expression(operation, inside, names)
        kind, name = _type(made), names.new(made)
        if size == 1:
            statements.append(f"const {kind} {name} = {expression};")
        elif id(made) in wanted or _is_read_elsewhere(made, group):
            before.append(f"{kind} {name}[{size}];")
            statements.append(f"{name}[i] = {expression};")
        else:
            statements.append(f"const {kind} {name} = {expression};")
            inside[id(made)] = name
    if size == 1:
        return [f"    {line}" for line in statements]
    return [
        *(f"    {line}" for line in before),
        f"    for (int i = 0; i < {size}; ++i) {{",
        *(f"        {line}" for line in statements),
        "    }",
    ]


def _is_read_elsewhere(made: Any, group: list[Operation]) -> bool:
    """Whether an operation of the group reads a value at another place than its own."""
    return any(made in each.reads and each.name in ("slice", "concatenate") for each in group)


def _type(value: Any) -> str:
    return "real" if np.dtype(value.aval.dtype).kind == "f" else "int"


def _at(value: Any, index: str, inside: dict[int, str], names: Names) -> str:
    """A number of a value at an index."""
    if isinstance(value, Fixed):
        if value.value.size == 1:
            return number(value.value.reshape(-1)[0])
        flat = value.value.reshape(-1)
        if np.all(flat == flat[0]):
            return number(flat[0])
        return f"{names.constant(flat)}[{index}]"
    if id(value) in inside:
        return inside[id(value)]
    name = names.of[value]
    return name if size_of(value) == 1 else f"{name}[{index}]"


def _expression(operation: Operation, inside: dict[int, str], names: Names) -> str:
    """The number that an operation makes at index i."""
    name, reads, made = operation.name, operation.reads, operation.makes[0]
    here = [_at(read, _aligned(read, made), inside, names) for read in reads]
    match name:
        case "integer_pow":
            power = operation.parameters["y"]
            product = " * ".join([here[0]] * abs(power)) or "1"
            return product if power >= 0 else f"C(1.0) / ({product})"
        case "convert_element_type":
            return f"({_type(made)}){here[0]}"
        case "reshape" | "squeeze" | "expand_dims":
            return here[0]
        case "broadcast_in_dim":
            place = _place(reads[0], made, operation.parameters["broadcast_dimensions"])
            return _at(reads[0], place, inside, names)
        case "slice":
            start = operation.parameters["start_indices"][0]
            place = str(start) if size_of(made) == 1 else f"i + {start}"
            return _at(reads[0], place, {}, names)
        case "concatenate":
            return _joined(reads, names)
        case _ if name in _INFIX:
            return f"{_argument(here[0])} {_INFIX[name]} {_argument(here[1])}"
    return _FUNCTIONS[name].format(*map(_argument, here))


def _aligned(read: Any, made: Any) -> str:
    """The index in a value that is read, where a side of length 1 is repeated."""
    size = size_of(read)
    if size in (1, size_of(made)) or len(read.aval.shape) != len(made.aval.shape):
        return "i"
    return _place(read, made, range(len(made.aval.shape)))


def _argument(text: str) -> str:
    return f"({text})" if text.startswith("-") else text


def _place(source: Any, made: Any, dimensions: Sequence[int]) -> str:
    """The index in a source of the number at index i of an array that it is repeated in."""
    shape, terms, stride = made.aval.shape, [], 1
    sizes = source.aval.shape
    for axis in reversed(range(len(sizes))):
        if sizes[axis] > 1:
            after = math.prod(shape[dimensions[axis] + 1 :])
            index = "i" if after == 1 else f"i / {after}"
            if math.prod(shape[: dimensions[axis]]) > 1:
                index = f"({index}) % {sizes[axis]}" if after > 1 else f"{index} % {sizes[axis]}"
            terms.append(index if stride == 1 else f"({index}) * {stride}")
        stride *= sizes[axis]
    return " + ".join(terms) or "0"


def _joined(reads: Sequence[Any], names: Names) -> str:
    """The number at index i of values one after the other."""
    start, text, close = 0, "", ""
    for read in reads[:-1]:
        size = size_of(read)
        text += f"i < {start + size} ? {_at(read, _shifted(start), {}, names)} : ("
        close += ")"
        start += size
    return text + _at(reads[-1], _shifted(start), {}, names) + close


def _shifted(start: int) -> str:
    return f"i - {start}" if start else "i"


def _alone(operation: Operation, names: Names) -> list[str]:
    """The statements of an operation that has its own loop."""
    match operation.name:
        case "reduce_sum":
            return _sum(operation, names)
        case "dot_general":
            return _product(operation, names)
        case "while":
            return _while(operation, names)
    raise NotImplementedError(operation.name)  # pragma: no cover - a section uses a new operation


def _sum(operation: Operation, names: Names) -> list[str]:
    """The sum of an array."""
    (source,), made = operation.reads, operation.makes[0]
    name, size = names.new(made), size_of(source)
    if size == 1:
        return [f"    const {_type(made)} {name} = {_at(source, '0', {}, names)};"]
    names.operations += size
    return [
        f"    {_type(made)} {name} = 0;",
        f"    for (int i = 0; i < {size}; ++i) {name} += {_at(source, 'i', {}, names)};",
    ]


def _product(operation: Operation, names: Names) -> list[str]:
    """A matrix times a vector."""
    matrix, vector = operation.reads
    made = operation.makes[0]
    rows, columns = matrix.aval.shape
    name = names.new(made)
    names.operations += 2 * rows * columns
    entry = _at(matrix, f"i * {columns} + j", {}, names)
    return [
        f"    real {name}[{rows}];",
        f"    for (int i = 0; i < {rows}; ++i) {{",
        f"        {name}[i] = 0;",
        f"        for (int j = 0; j < {columns}; ++j) "
        f"{name}[i] += {entry} * {_at(vector, 'j', {}, names)};",
        "    }",
    ]


def _while(operation: Operation, names: Names) -> list[str]:
    """A loop over numbers, each kept in a variable."""
    parameters, reads = operation.parameters, operation.reads
    condition, body = parameters["cond_jaxpr"], parameters["body_jaxpr"]
    first, second = parameters["cond_nconsts"], parameters["body_nconsts"]
    tested, shared, starts = reads[:first], reads[first : first + second], reads[first + second :]
    lines, kept = [], []
    for start, made in zip(starts, operation.makes, strict=True):
        lines.append(f"    {_type(made)} {names.new(made)} = {_at(start, '0', {}, names)};")
        kept.append(made)
    lines.append("    for (;;) {")
    test, inputs, (result,) = flattened(condition)
    test, (result,) = _replaced(test, inputs, [*tested, *kept], [result])
    lines += body_of(test, [result], names, 2)
    lines.append(f"        if (!({_at(result, '0', {}, names)})) break;")
    work, inputs, results = flattened(body)
    work, results = _replaced(work, inputs, [*shared, *kept], results)
    lines += body_of(work, results, names, 2)
    # All are read before any is set.
    pairs = [
        (names.of[made], _at(result, "0", {}, names), _type(made))
        for made, result in zip(kept, results, strict=True)
    ]
    lines += [f"        const {kind} next_{name} = {text};" for name, text, kind in pairs]
    lines += [f"        {name} = next_{name};" for name, _, _ in pairs]
    return [*lines, "    }"]


def _replaced(
    operations: list[Operation], inputs: Sequence[Any], actual: Sequence[Any], outputs: list[Any]
) -> tuple[list[Operation], list[Any]]:
    """Operations and outputs with other inputs."""
    swap = {id(a): b for a, b in zip(inputs, actual, strict=True)}
    moved = [
        Operation(o.name, tuple(swap.get(id(v), v) for v in o.reads), o.makes, o.parameters)
        for o in operations
    ]
    return moved, [swap.get(id(v), v) for v in outputs]
