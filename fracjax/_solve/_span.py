"""Signals that span all that a block can answer to a drive."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._computing import compiled
from .._operators import speed
from .._prepare import Problem, layout_of, placed, with_gains
from ._chains import Chain, chains_of
from ._interpolation import Chosen, choose, is_bounded

FRESH = 4
_MOST_SIGNALS = 400
_speed = compiled(speed)


class Span(NamedTuple):
    """Signals (L, n) that span a block's responses to one drive, and the laws they come from.

    `fresh` (L, FRESH (1 + g)) are the full model's responses at `fresh_positions`: with gains of
    zero, and the derivative by each gain.  Spans of one `key` are one.
    """

    key: tuple
    signals: np.ndarray
    chosen: tuple[tuple[Chosen, Chosen | None], ...]
    fresh: np.ndarray


def fresh_positions(block: AbstractBlock) -> np.ndarray:
    """Positions (FRESH, n) of shapes, at which nothing was chosen."""
    size = sum(size for _, size in layout_of(block).shapes)
    return np.random.default_rng(0).uniform(size=(FRESH, size))


def span_of(block: AbstractBlock, problem: Problem) -> Span | None:
    """The span of a block between its bounds, driven as in a problem.

    None where the block is no sum of chains of linear laws, where a shape has no bounds, and where
    too many signals would be needed.  The last few are kept: a fit that settles its noise, and
    recordings of one drive, ask for the same again.
    """
    chains = chains_of(block)
    if chains is None or not all(map(_is_bounded, chains)):
        return None
    size = sum(size for _, size in layout_of(block).gains)
    # Where a free parameter stands makes no difference.
    middle = with_gains(
        placed(block, np.full(fresh_positions(block).shape[1], 0.5)), np.zeros(size)
    )
    leaves, structure = jax.tree_util.tree_flatten(middle)
    drive, grid = np.asarray(problem.drive), problem.grid
    numbers = b"".join(np.asarray(leaf).tobytes() for leaf in (*leaves, grid.step, drive))
    return _kept(_Asked((structure, grid.history, problem.oversampling, numbers), middle, problem))


def _is_bounded(chain: Chain) -> bool:
    return is_bounded(chain.before) and (chain.after is None or is_bounded(chain.after))


@dataclass(frozen=True)
class _Asked:
    """What a span was asked for, the same as another where the keys are."""

    key: tuple
    block: AbstractBlock = field(compare=False)
    problem: Problem = field(compare=False)


@lru_cache(maxsize=4)
def _kept(asked: _Asked) -> Span | None:
    chains, problem = chains_of(asked.block), asked.problem
    assert chains is not None  # span_of has seen to it
    drive, grid = np.asarray(problem.drive), problem.grid
    found: list[np.ndarray] = [np.zeros((drive.size, 0))]
    chosen = []
    for chain in chains:
        first = choose(chain.before, drive[:, None], grid)
        if first is None:
            return None
        signals = first.responses(drive[:, None], grid)[:, 0]
        if chain.rated:
            signals = signals * np.asarray(_speed(drive, grid))[:, None]
        second = None
        if chain.after is not None and first.size:
            second = choose(chain.after, signals, grid)
            if second is None or first.size * second.size > _MOST_SIGNALS:
                return None
            signals = second.responses(signals, grid).reshape(drive.size, -1)
        found.append(signals)
        chosen.append((first, second))
    # A copy, which does not keep the finer grid's signals in memory.
    signals = np.concatenate(found, axis=1)[:: problem.oversampling].copy()
    return Span(asked.key, signals, tuple(chosen), _fresh(asked.block, problem))


def _fresh(block: AbstractBlock, problem: Problem) -> np.ndarray:
    names, found = [name for name, _ in layout_of(block).gains], []
    for position in fresh_positions(block):
        response, columns = problem.linearised(placed(block, position), names)
        found += [response[:, None], columns]
    return np.concatenate(found, axis=1)
