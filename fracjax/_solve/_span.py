"""Signals that span all responses of a block to a drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, layout_of, with_gains, with_shapes_at
from ._chains import Chain, chains_of
from ._interpolation import SPANNED, ChosenShapes, choose_shapes, is_bounded
from ._responses import speeds
from ._transformed import Transformed

FRESH = 4
"""Positions at which a compressed problem is compared with the full model.  Chosen by judgement."""
_MOST_SIGNALS = 400
"""Most signals of a chain, above which compression does not pay.  Chosen by judgement."""


Chosen = tuple[tuple[ChosenShapes, ChosenShapes | None], ...]
"""Per chain, its first and last block at chosen shapes."""


class Span(NamedTuple):
    """Signals that span a block's responses to one drive.

    Attributes:
        key: equal for equal spans.
        signals: (L, n) in the response's unit.
        chosen: per chain, its first and last block at chosen shapes.
        fresh: (L, FRESH (1 + g)), the full model's responses at `fresh_positions`: with gains of
            zero, and the derivative by each gain.
    """

    key: tuple
    signals: np.ndarray
    chosen: Chosen
    fresh: np.ndarray


def fresh_positions(block: AbstractBlock) -> np.ndarray:
    """Positions (FRESH, n) of shapes that were not chosen."""
    size = sum(size for _, size in layout_of(block).shapes)
    return np.random.default_rng(0).uniform(size=(FRESH, size))


def span_of(block: AbstractBlock, problem: Problem) -> Span | None:
    """The span of a block between its bounds, for the drive of a problem.

    None where the block is no sum of chains of linear blocks, where a shape has no bounds, or where
    too many signals would be needed.  The last few spans are kept, because a fit whose noise is
    reread and recordings of the same drive need the same span again.
    """
    chains = chains_of(block)
    if chains is None or not all_bounded(chains):
        return None
    size = sum(size for _, size in layout_of(block).gains)
    # The values of the free parameters make no difference.
    middle = with_gains(
        with_shapes_at(block, np.full(fresh_positions(block).shape[1], 0.5)), np.zeros(size)
    )
    leaves, structure = jax.tree_util.tree_flatten(middle)
    drive, grid = np.asarray(problem.drive), problem.grid
    content = b"".join(np.asarray(leaf).tobytes() for leaf in (*leaves, grid.step, drive))
    return _compute(
        Request((structure, grid.history, problem.oversampling, content), middle, problem)
    )


def all_bounded(chains: Sequence[Chain]) -> bool:
    """Whether all shapes of chains have bounds."""
    return all(
        is_bounded(chain.before) and (chain.after is None or is_bounded(chain.after))
        for chain in chains
    )


@dataclass(frozen=True)
class Request:
    """A request for a span, equal to another where the keys are equal.

    Attributes:
        key: identifies block, drive and grid.
        block: with its free parameters at fixed values.
        problem: the recording.
    """

    key: tuple
    block: AbstractBlock = field(compare=False)
    problem: Problem = field(compare=False)


@lru_cache(maxsize=4)
def _compute(request: Request) -> Span | None:
    """The span of a request, kept for equal requests."""
    chains, problem = chains_of(request.block), request.problem
    assert chains is not None  # span_of has checked it
    span = span_of_drives(chains, np.asarray(problem.drive)[:, None], problem)
    if span is None:
        return None
    chosen, signals = span
    columns = np.concatenate([of_chain[0] for of_chain in signals]).T.copy()
    return Span(request.key, columns, chosen, _fresh(request.block, problem))


def span_of_drives(
    chains: Sequence[Chain], drives: np.ndarray, like: Problem, spanned: float = SPANNED
) -> tuple[Chosen, list[np.ndarray]] | None:
    """Chains at shapes chosen for all drives (M, d) together, and per chain its signals (d, n, L).

    The drives are on the grid of the problem `like`.  None where too many signals would be needed.
    """
    grid, count, every = like.grid, drives.shape[1], like.oversampling
    rates = speeds(drives, grid) if any(chain.rated for chain in chains) else None
    transformed = Transformed.of(drives, grid)
    chosen, signals_of_chains = [], []
    for chain in chains:
        first, second = choose_shapes(chain.before, transformed, grid, spanned), None
        if first is None:
            return None
        followed = chain.after is not None and first.size > 0
        fine = 1 if followed else every
        factors = rates[:, ::fine] if chain.rated and rates is not None else 1.0
        signals = first.responses(transformed, grid, fine, factors)
        if followed and chain.after is not None:
            between = Transformed.of(signals.reshape(-1, signals.shape[-1]).T, grid)
            second = choose_shapes(chain.after, between, grid, spanned)
            if second is None or first.size * second.size > _MOST_SIGNALS:
                return None
            signals = second.responses(between, grid, every)
            signals = signals.reshape(count, first.size * second.size, -1)
        signals_of_chains.append(signals)
        chosen.append((first, second))
    return tuple(chosen), signals_of_chains


def _fresh(block: AbstractBlock, problem: Problem) -> np.ndarray:
    """The full model's responses (L, FRESH (1 + g)) at the fresh positions."""
    names, columns_of_positions = [name for name, _ in layout_of(block).gains], []
    for position in fresh_positions(block):
        response, columns = problem.linearised(with_shapes_at(block, position), names)
        columns_of_positions += [response[:, None], columns]
    return np.concatenate(columns_of_positions, axis=1)
