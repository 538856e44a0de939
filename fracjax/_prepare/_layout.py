"""The free parameters of a block: shapes, which are iterated, and gains, which are eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from .._blocks import AbstractBlock, linear_gains
from .._naming import shown_names
from .._parameters import named_parameters, set_values


class Layout(NamedTuple):
    """Names and sizes of a block's free parameters.

    Attributes:
        shapes: names and sizes of the parameters that are iterated.
        gains: names and sizes of the parameters that are eliminated, because the response is linear
            in them.
    """

    shapes: tuple[tuple[str, int], ...]
    gains: tuple[tuple[str, int], ...]

    def labels(self, block: AbstractBlock) -> tuple[str, ...]:
        """One label per free component, as results show it: `name`, or `name[k]` of a vector."""
        shown = shown_names(block)
        return tuple(
            shown[name] if size == 1 else f"{shown[name]}[{k}]"
            for name, size in self.shapes + self.gains
            for k in range(size)
        )


def layout_of(block: AbstractBlock) -> Layout:
    """The free parameters of a block: its shapes, then its gains."""
    gains = linear_gains(block)
    free = {n: int(np.size(p.value)) for n, p in named_parameters(block).items() if not p.fixed}
    return Layout(
        tuple((n, size) for n, size in free.items() if n not in gains),
        tuple((n, free[n]) for n in gains),
    )


def values_by_name(block: AbstractBlock, names: tuple[tuple[str, int], ...], vector: Any) -> dict:
    """A vector (Σ size,) cut into the parameters' values by name, each in its parameter's shape."""
    parameters = named_parameters(block)
    values, at = {}, 0
    for name, size in names:
        values[name] = vector[at : at + size].reshape(np.shape(parameters[name].value))
        at += size
    return values


def with_gains(block: AbstractBlock, gains: Any) -> AbstractBlock:
    """The block with its gains set to a vector (G,)."""
    return set_values(block, values_by_name(block, layout_of(block).gains, gains))


def own_columns(problems: Sequence[Any]) -> list[Any]:
    """Per recording, the own terms of all recordings as columns (L, Σq), zero for the others'."""
    counts = [p.own.shape[1] for p in problems]
    ends = np.cumsum(counts)
    # NumPy arrays stay in NumPy: padding them with JAX costs as much as a simulation.
    return [
        (np if isinstance(p.own, np.ndarray) else jnp).pad(
            p.own, ((0, 0), (end - count, ends[-1] - end))
        )
        for p, count, end in zip(problems, counts, ends, strict=True)
    ]


def position_of(block: AbstractBlock) -> np.ndarray:
    """The positions (n,) of a block's shapes between their bounds, from 0 to 1 on each shape's
    scale.

    The position of a shape without bounds is its value.
    """
    parameters = named_parameters(block)
    free = [parameters[name] for name, _ in layout_of(block).shapes]
    places = [parameter.to_share(parameter.value) for parameter in free]
    return np.concatenate([np.ravel(place) for place in places]) if places else np.zeros(0)


def with_shapes_at(block: AbstractBlock, position: Any) -> AbstractBlock:
    """The block with its shapes set to a position (n,)."""
    parameters = named_parameters(block)
    shares = values_by_name(block, layout_of(block).shapes, position)
    return set_values(block, {n: parameters[n].from_share(s) for n, s in shares.items()})
