"""Names of parameters by the block that they belong to: "resonance.damping".

Inside, a parameter is known by its place in the composition, "second.second.damping", from which
parts of a composition are cut and joined.  What is shown and asked for is the block's name: that of
its effect or model, which is the name of its file, or of its class where it is from elsewhere.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any, TypeVar

import jax

from ._blocks import (
    AbstractBlock,
    AbstractInside,
    Inverse,
    LinearParallel,
    LinearSeries,
    Parallel,
    Series,
    Within,
)
from ._parameters import is_parameter, named_parameters
from ._recording import InputError, closest

T = TypeVar("T")

_COMPONENT = re.compile(r"(\[\d+\])?(@\d+)?$")
"""What may follow a parameter's name: the index of a component, and that of a recording."""


def block_name(block: AbstractBlock | AbstractInside) -> str:
    """The name of one block: of its file among the blocks, else of its class in snake case."""
    package, _, file = type(block).__module__.rpartition(".")
    if package == AbstractBlock.__module__.rpartition(".")[0] and file[0] != "_":
        return file
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", type(block).__name__).lower()


def _parts(block: AbstractBlock, path: str = "") -> Iterator[tuple[str, str]]:
    """The place and the name of every block of a composition, in order."""
    match block:
        case Series() | LinearSeries() | Parallel() | LinearParallel():
            yield from _parts(block.first, f"{path}first.")
            yield from _parts(block.second, f"{path}second.")
        case Inverse():
            yield from _parts(block.block, f"{path}block.")
        case Within():
            yield from _parts(block.machine, f"{path}machine.")
            for k, effect in enumerate(block.effects):
                yield f"{path}effects.{k}.", block_name(effect)
            yield path, "state"  # what remains is the state that it starts in
        case _:
            yield path, block_name(block)


def prefixes_of(block: AbstractBlock) -> dict[str, str]:
    """The prefix shown for each block of a composition, by that of its place; "" for one alone.

    Blocks of the same name are numbered from 1, in order.
    """
    parts = list(_parts(block))
    if len(parts) == 1:
        return {parts[0][0]: ""}
    counts, numbers = Counter(name for _, name in parts), Counter()
    prefixes = {}
    for path, name in parts:
        numbers[name] += 1
        prefixes[path] = f"{name}_{numbers[name]}." if counts[name] > 1 else f"{name}."
    return prefixes


def shown_names(block: AbstractBlock) -> Mapping[str, str]:
    """The name shown for each parameter, by its place: second.damping → resonance.damping."""
    structure = jax.tree_util.tree_structure(block, is_leaf=is_parameter)
    return _shown_names(structure, tuple(named_parameters(block)))


@lru_cache(maxsize=1024)
def _shown_names(structure: Any, paths: tuple[str, ...]) -> Mapping[str, str]:
    """`shown_names` of a block's structure, kept because every step of a fit asks for them."""
    prefixes = prefixes_of(structure.unflatten(range(structure.num_leaves)))
    places = {path: next(each for each in prefixes if path.startswith(each)) for path in paths}
    return {path: prefixes[place] + path.removeprefix(place) for path, place in places.items()}


def path_of_name(name: str, block: AbstractBlock) -> str:
    """The place of a parameter that is given by its block's name or by its place.

    An index of a component or of a recording stays.  A name of no parameter is returned as it is.
    """
    base = _COMPONENT.sub("", name)
    shown = shown_names(block)
    by_name = {each: path for path, each in shown.items()}
    return by_name.get(base, base) + name[len(base) :]


def suffix_of(name: str) -> str:
    """The index of a component and of a recording at the end of a name; "" where it has none."""
    return name[len(_COMPONENT.sub("", name)) :]


def shown_name(name: str, block: AbstractBlock) -> str:
    """The name shown of a parameter that is given by its block's name or by its place."""
    base = _COMPONENT.sub("", name)
    return shown_names(block).get(base, base) + name[len(base) :]


def accepted_names(block: AbstractBlock) -> set[str]:
    """All names that reach a parameter of the block: by its own block, and by its place."""
    shown = shown_names(block)
    return {*shown, *shown.values()}


class ByName(dict[str, T]):
    """Values by the names of a model's parameters, also reached by their places."""

    def __init__(self, block: AbstractBlock, values: Iterable[tuple[str, T]]):
        super().__init__(values)
        self._block = block

    def __missing__(self, name: str) -> T:
        shown = shown_name(name, self._block)
        if shown in self:
            return self[shown]
        raise unknown_parameter(name, self)


def unknown_parameter(name: object, names: Iterable[str]) -> InputError:
    """The error for a name that no parameter has."""
    listed = list(names)
    return InputError.at(
        f'parameter "{name}"',
        f"one of {', '.join(listed)}",
        f"none of that name{closest(str(name), listed)}",
        "correct it",
    )
