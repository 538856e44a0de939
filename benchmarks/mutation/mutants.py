"""Mutants: one small fault in a source file, of a kind that hands make.

Written on `ast`: cosmic-ray and mutmut choose neither a sample nor the tests to run on each mutant,
and know no slices, minima or dropped returns.

A place is an expression, or an `+=`; it can go wrong in one or more ways:

- `+` for `-`, `*` for `/`, `**` or `//`, `and` for `or`, and the other way round; a lost minus;
- `<` for `<=` or `>=`, `==` for `!=`, `in` for `not in`, `is` for `is not`;
- 0 for 1, n + 1 for n, 2 x for x, True for False, also where these are defaults of arguments;
- a condition turned into its opposite, `min` for `max`, `any` for `all`, `floor` for `ceil`;
- a slice that begins or ends one further; None returned instead of a value.

Left out are texts (docstrings, errors and warnings with their arguments, f-strings, reports of
progress), annotations and unions of types, imports, decorators and fields of classes, `strict` of
`zip`, which no input can break, and what is only about speed: `_programs.py`, and the constants in
SPEED.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass

SPEED = {"BATCH_SIZE", "_ROWS", "_LARGEST_TABLE", "at_once"}
TEXTS = {"progress", "warn", "field"}

_OPERATORS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
    ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
_COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_PAIRS = (("min", "max"), ("minimum", "maximum"), ("argmin", "argmax"), ("any", "all"),
          ("floor", "ceil"))  # fmt: skip
_NAMES = {one: other for pair in _PAIRS for one, other in (pair, pair[::-1])}


@dataclass(frozen=True)
class Mutant:
    """One expression of a file, and what stands there instead; all but the line in bytes."""

    file: str
    line: int
    column: int
    start: int
    end: int
    before: str
    after: str

    @property
    def mutation(self) -> str:
        return f"{self.before} -> {self.after}"

    def apply(self, source: str) -> str:
        """The source with the fault in it."""
        text = source.encode()
        return (text[: self.start] + self.after.encode() + text[self.end :]).decode()


def places(file: str, source: str) -> list[list[Mutant]]:
    """Every place of a file that can go wrong, each with the ways in which it can."""
    lines = source.encode().splitlines(keepends=True)
    starts = [sum(map(len, lines[:k])) for k in range(len(lines))]
    found: dict[tuple[int, int], list[Mutant]] = {}
    for node, other in _faults(ast.parse(source)):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[operator]
        # Brackets keep an expression together wherever it stands.
        compound = isinstance(other, ast.expr) and not isinstance(other, _ATOMS)
        after = f"({ast.unparse(other)})" if compound else ast.unparse(other)
        mutant = Mutant(file, node.lineno, node.col_offset, begin, end, ast.unparse(node), after)
        found.setdefault((begin, end), []).append(mutant)
    return list(found.values())


_ATOMS = (ast.Constant, ast.Name, ast.Attribute)
Node = ast.expr | ast.stmt


def _faults(node: ast.AST) -> Iterator[tuple[Node, Node]]:
    """An expression and what might stand there by mistake, of this node and of all below it."""
    if _is_left_out(node):
        return
    yield from _faults_of(node)
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list"}:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _faults(child)


def _is_left_out(node: ast.AST) -> bool:
    match node:
        case ast.Import() | ast.ImportFrom() | ast.Raise() | ast.JoinedStr():
            return True
        case ast.Assign(targets=[ast.Name(id=name)], value=value):
            # A union of types; of arrays it would be inside a function and no plain names.
            return name in SPEED or (name[0].isupper() and isinstance(value, ast.BinOp))
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name in TEXTS
        case ast.keyword(arg="strict"):
            return True
    return False


def _faults_of(node: ast.AST) -> Iterator[tuple[Node, Node]]:
    match node:
        case ast.Constant(value=bool(value)):
            yield node, ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield node, ast.Constant(value + 1)
        case ast.Constant(value=float() | complex() as value):
            yield node, ast.Constant(2 * value or 1.0)
        case ast.BinOp(left, operator, right) if type(operator) in _OPERATORS:
            yield node, ast.BinOp(left, _OPERATORS[type(operator)](), right)
        case ast.AugAssign(target, operator, value) if type(operator) in _OPERATORS:
            yield node, ast.AugAssign(target, _OPERATORS[type(operator)](), value)
        case ast.BoolOp(operator, values):
            yield node, ast.BoolOp(_OPERATORS[type(operator)](), values)
        case ast.UnaryOp(ast.Not() | ast.USub() | ast.Invert(), operand):
            yield node, operand
        case ast.Compare(left, operators, others):
            for k, operator in enumerate(operators):
                for other in _COMPARISONS[type(operator)]:
                    changed = [*operators[:k], other(), *operators[k + 1 :]]
                    yield node, ast.Compare(left, changed, others)
        case ast.Name(id) if id in _NAMES:
            yield node, ast.Name(_NAMES[id])
        case ast.Attribute(value, attr) if attr in _NAMES:
            yield node, ast.Attribute(value, _NAMES[attr])
        case ast.Slice(lower, upper):
            for bound in (lower, upper):
                # A number is a place of its own.
                if bound is not None and not isinstance(bound, ast.Constant | ast.UnaryOp):
                    yield bound, ast.BinOp(bound, ast.Add(), ast.Constant(1))
        case ast.Return(value=ast.expr() as value) if not _is_none(value):
            yield value, ast.Constant(None)
        case ast.If(test=test) | ast.While(test=test) | ast.IfExp(test=test):
            yield from _opposite(test)
        case ast.comprehension(ifs=tests):
            for test in tests:
                yield from _opposite(test)


def _opposite(test: ast.expr) -> Iterator[tuple[Node, Node]]:
    # A comparison and a `not` have theirs already.
    if not isinstance(test, ast.Compare | ast.UnaryOp):
        yield test, ast.UnaryOp(ast.Not(), test)


def _is_none(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) and value.value is None
