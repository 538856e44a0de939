"""Which numbers a fit moves: shapes, which are iterated, and gains, which are eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from .._blocks import AbstractBlock, linear_gains
from .._parameters import named_parameters, set_values


class Layout(NamedTuple):
    """Names and sizes of the parameters a fit moves: shapes iterated, gains eliminated."""

    shapes: tuple[tuple[str, int], ...]
    gains: tuple[tuple[str, int], ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """One name per number that is fitted: `name`, or `name[k]` of a vector."""
        return tuple(
            name if size == 1 else f"{name}[{k}]"
            for name, size in self.shapes + self.gains
            for k in range(size)
        )


def layout_of(block: AbstractBlock) -> Layout:
    gains = linear_gains(block)
    free = {n: int(np.size(p.value)) for n, p in named_parameters(block).items() if not p.fixed}
    return Layout(
        tuple((n, size) for n, size in free.items() if n not in gains),
        tuple((n, free[n]) for n in gains),
    )


def split(block: AbstractBlock, names: tuple[tuple[str, int], ...], vector: Any) -> dict:
    parameters = named_parameters(block)
    values, at = {}, 0
    for name, size in names:
        values[name] = vector[at : at + size].reshape(np.shape(parameters[name].value))
        at += size
    return values


def with_gains(block: AbstractBlock, gains: Any) -> AbstractBlock:
    return set_values(block, split(block, layout_of(block).gains, gains))


def own_columns(problems: Sequence[Any]) -> list[Any]:
    """Per recording the columns (L, Σq) of all recordings' own terms, the others' being zero."""
    counts = [p.own.shape[1] for p in problems]
    ends = np.cumsum(counts)
    # What NumPy holds stays there: a padding by JAX costs as much as a simulation.
    return [
        (np if isinstance(p.own, np.ndarray) else jnp).pad(
            p.own, ((0, 0), (end - count, ends[-1] - end))
        )
        for p, count, end in zip(problems, counts, ends, strict=True)
    ]


def position_of(block: AbstractBlock) -> np.ndarray:
    """Where a block's shapes (n,) stand between their bounds, each from 0 to 1 on its own scale;
    one without bounds by its value."""
    parameters = named_parameters(block)
    free = [parameters[name] for name, _ in layout_of(block).shapes]
    places = [parameter.to_share(parameter.value) for parameter in free]
    return np.concatenate([np.ravel(place) for place in places]) if places else np.zeros(0)


def placed(block: AbstractBlock, position: Any) -> AbstractBlock:
    """The block with its shapes at a position (n,)."""
    parameters = named_parameters(block)
    shares = split(block, layout_of(block).shapes, position)
    return set_values(block, {n: parameters[n].from_share(s) for n, s in shares.items()})
