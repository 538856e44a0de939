"""The search from all starts at once, on compressed problems: a stack of one (`_lockstep`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, layout_of, position_of, with_shapes_at
from ._compressed import compress
from ._lockstep import Stack, descend_together

LEAST_STARTS = 4
"""With fewer starts, descents on the full model take less time than compression."""


class SearchResult(NamedTuple):
    """The result of a search.

    Attributes:
        best: the block with the least χ².
        costs: (S,) χ² where each start ended.
        evaluations: how often the objective was computed.
    """

    best: AbstractBlock
    costs: np.ndarray
    evaluations: int

    @property
    def cost(self) -> float:
        """The least χ²."""
        return float(self.costs.min())


def search(starts: list[AbstractBlock], problems: tuple[Problem, ...]) -> SearchResult | None:
    """The best shapes from all starts together.

    None where the problems cannot be compressed accurately enough, or where there are so few starts
    that a descent from each takes less time than compression.
    """
    block = starts[0]
    if len(starts) < LEAST_STARTS or not layout_of(block).shapes:
        return None
    compressed = compress(block, problems)
    if compressed is None:
        return None
    positions = np.clip(np.stack([position_of(start) for start in starts]), 0.0, 1.0)
    stacks = [Stack.of_one(problem) for problem in compressed.problems]
    positions, costs, _, evaluations = descend_together(
        block, stacks, np.zeros(len(positions), int), positions
    )
    best = int(np.argmin(costs))
    # The noise may be unknown as yet, so that the error is compared with the residual.
    noise = np.sqrt(costs[best] / sum(float(p.count) for p in problems))
    if not compressed.is_accurate_for(noise):
        return None
    return SearchResult(with_shapes_at(block, positions[best]), costs, int(evaluations.sum()))
