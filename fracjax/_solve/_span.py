"""Signals that span all responses of a block to a drive."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._operators import Grid
from .._prepare import Problem, layout_of, with_gains, with_shapes_at
from ._chains import Chain, chains_of
from ._interpolation import SPANNED, ChosenShapes, choose_shapes, is_bounded
from ._responses import speeds
from ._transformed import AT_ONCE, Transformed

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
    columns = np.empty((sum(of_chain.total for of_chain in signals), signals[0].samples))
    place = 0
    for of_chain in signals:
        of_chain.fill(0, columns[place : place + of_chain.total])
        place += of_chain.total
    return Span(request.key, columns.T.copy(), chosen, _fresh(request.block, problem))


@dataclass(frozen=True, eq=False)
class ChainSignals:
    """A chain's responses to d drives at its chosen shapes, without those to a constant.

    They are computed for one drive at a time, which limits memory to the processor's cache.

    Attributes:
        shapes: the last block of the chain at n chosen shapes.
        driven: what drives it: k signals for each of d drives.
        factors: (d, L) that multiply its responses, None where they are 1.
        grid: step [s] and history of the simulation.
        every: steps per sample.
        inputs: k.
    """

    shapes: ChosenShapes
    driven: Transformed
    factors: np.ndarray | None
    grid: Grid
    every: int
    inputs: int = 1

    @property
    def total(self) -> int:
        """The number k n of signals."""
        return self.inputs * self.shapes.size

    @property
    def samples(self) -> int:
        """The number L of samples of a signal."""
        return self.driven.growth[:: self.every].size

    @cached_property
    def _whole(self) -> list[tuple[int, np.ndarray]]:
        """The table of transfer functions, kept where it is one part."""
        first = next(self.shapes.tables(self.driven.zeta, self.grid), None)
        return [first] if first and len(first[1]) == self.shapes.size else []

    def _tables(self) -> Iterable[tuple[int, np.ndarray]]:
        return self._whole or self.shapes.tables(self.driven.zeta, self.grid)

    def fill(self, drive: int, signals: np.ndarray) -> None:
        """Write the signals (k n, L) of a drive."""
        spectra, size = self._spectra(np.array([drive]))[0], self.shapes.size
        factor = 1.0 if self.factors is None else self.factors[drive]
        for first, table in self._tables():
            for at in range(0, len(table), AT_ONCE):
                some = table[at : at + AT_ONCE]
                for k, spectrum in enumerate(spectra):
                    back = self.driven.back(some * spectrum, self.every)
                    place = k * size + first + at
                    np.multiply(back, factor, out=signals[place : place + len(back)])

    def mix(self, drives: np.ndarray, factors: np.ndarray) -> np.ndarray:
        """Sums (r, m, L) of the signals of drives (r,), by factors (r, m, k n)."""
        count, size = len(factors), self.shapes.size
        spectra, mixed = self._spectra(drives), np.zeros((*factors.shape[:2], self.samples))
        used = np.flatnonzero(factors.any(axis=(0, 2)))
        transforms = np.zeros((count, used.size, self.driven.zeta.size), complex)
        for at, table in self._tables():
            for k in range(self.inputs):
                place = k * size + at
                some = factors[:, used, place : place + len(table)].reshape(-1, len(table))
                # As real numbers, which takes a quarter of the time.
                product = (some @ table.view(float)).view(complex).reshape(transforms.shape)
                transforms += product * spectra[:, k, None]
        back = self.driven.back(transforms.reshape(-1, transforms.shape[-1]), self.every)
        mixed[:, used] = back.reshape(count, used.size, self.samples)
        if self.factors is not None:
            mixed *= self.factors[drives, None]
        return mixed

    def _spectra(self, drives: np.ndarray) -> np.ndarray:
        """The transforms (r, k, F) of what drives the block for drives (r,)."""
        if self.inputs == 1:
            return self.driven.drives[drives, None]
        # Of many signals between two blocks they are not kept, which limits memory.
        places = drives[:, None] * self.inputs + np.arange(self.inputs)
        return self.driven.of_rows(places.ravel()).reshape(*places.shape, -1)


def span_of_drives(
    chains: Sequence[Chain],
    drives: np.ndarray,
    like: Problem,
    spanned: float = SPANNED,
    short: bool = False,
) -> tuple[Chosen, list[ChainSignals]] | None:
    """Chains at shapes chosen for all drives (M, d) together, and the signals of each.

    The drives are on the grid of the problem `like`, and transformed on a `short` circle or a long
    one.  None where too many signals would be needed.
    """
    grid, every = like.grid, like.oversampling
    transformed = Transformed.of(drives, grid, short)
    chosen, signals_of_chains = [], []
    for chain in chains:
        first, second = choose_shapes(chain.before, transformed, grid, spanned), None
        if first is None:
            return None
        followed = chain.after is not None and first.size > 0
        fine = 1 if followed else every
        factors = speeds(drives, grid, fine) if chain.rated else None
        signals = ChainSignals(first, transformed, factors, grid, fine)
        if followed and chain.after is not None:
            between = np.empty((drives.shape[1], first.size, signals.samples))
            for at, of_drive in enumerate(between):
                signals.fill(at, of_drive)
            driven = Transformed.of(between.reshape(-1, between.shape[-1]).T, grid, short)
            second = choose_shapes(chain.after, driven, grid, spanned)
            if second is None or first.size * second.size > _MOST_SIGNALS:
                return None
            signals = ChainSignals(second, driven, None, grid, every, first.size)
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
