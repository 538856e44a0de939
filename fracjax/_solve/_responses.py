"""Responses of many sums of chains at once, in NumPy, without compilation.

They equal those of the blocks' compiled programs to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from .._blocks import AbstractBlock, AbstractLinearBlock, Series
from .._operators import Grid, speed
from .._parameters import named_parameters, set_values
from .._prepare import Problem
from ._chains import chains_of, transfer
from ._transformed import AT_ONCE, Transformed


def speeds(drives: np.ndarray, grid: Grid, every: int = 1) -> np.ndarray:
    """The absolute rates |u̇| (d, ⌈M/every⌉) of drives (M, d) [drive unit/s]."""
    rows = np.ascontiguousarray(drives.T)
    parts = (rows[at : at + AT_ONCE] for at in range(0, len(rows), AT_ONCE))
    return np.concatenate([np.asarray(speed(part, grid, every)) for part in parts])


def respond(
    block: AbstractBlock, drives: np.ndarray, grid: Grid, every: int = 1, short: bool = False
) -> np.ndarray:
    """Responses (d, ⌈M/every⌉) of a sum of chains to drives (M, d), at each `every`-th sample.

    The block's parameters are single numbers, or arrays (d, 1) of one value for each drive.
    """
    chains = chains_of(block)
    assert chains is not None  # the caller has checked it
    transformed, total = Transformed.of(drives, grid, short), np.zeros(drives[::every].shape[::-1])
    for chain in chains:
        fine = every if chain.after is None else 1
        values = transfer(chain.before, transformed.zeta, grid)
        signals = transformed.back(values * transformed.drives, fine)
        signals = signals + _held(chain.before, drives, grid)
        if chain.rated:
            signals = signals * speeds(drives, grid, fine)
        if chain.after is not None:
            between = Transformed.of(signals.T, grid, short)
            after = between.back(transfer(chain.after, between.zeta, grid) * between.drives, every)
            signals = after + _held(chain.after, signals.T, grid)
        total += signals
    return total


def held(block: AbstractBlock, drives: np.ndarray, grid: Grid) -> np.ndarray:
    """What the constant part of drives (M, d) adds to the responses of the linear chains (d, 1)."""
    chains = chains_of(block)
    assert chains is not None  # the caller has checked it
    total = np.zeros((drives.shape[1], 1))
    for chain in chains:
        if not chain.rated:
            total = total + _held(chain.before, drives, grid)
    return total


def _held(block: AbstractBlock, drives: np.ndarray, grid: Grid) -> np.ndarray:
    """The response (d, 1) of a linear block to the constant part of drives (M, d)."""
    constant = {"rest": 0.0 * drives[0], "constant": drives[0], "periodic": drives.mean(axis=0)}
    return constant[grid.history][:, None] * _static_gain(block)


def _static_gain(block: AbstractBlock) -> Any:
    """The static gain of a linear block, or of linear blocks in series."""
    if isinstance(block, Series):
        return _static_gain(block.first) * _static_gain(block.second)
    assert isinstance(block, AbstractLinearBlock)
    return np.asarray(block.static_gain())


def respond_all(
    blocks: Sequence[AbstractBlock], problems: Sequence[Problem], short: bool = False
) -> list[np.ndarray]:
    """Each block's response (L,) to the drive of its problem.

    Problems of one grid are computed together, on a `short` circle or a long one.
    """
    groups: dict[tuple, list[int]] = {}
    for row, (block, problem) in enumerate(zip(blocks, problems, strict=True)):
        groups.setdefault(_kind(block, problem), []).append(row)
    responses: list[np.ndarray] = [np.zeros(0)] * len(blocks)
    for rows in groups.values():
        for at in range(0, len(rows), AT_ONCE):
            some = rows[at : at + AT_ONCE]
            like = problems[some[0]]
            drives = np.stack([np.asarray(problems[row].drive) for row in some]).T
            block = blocks[some[0]] if len(some) == 1 else stacked([blocks[row] for row in some])
            some_responses = respond(block, drives, like.grid, like.oversampling, short)
            for row, response in zip(some, some_responses, strict=True):
                responses[row] = response
    return responses


def stacked(blocks: Sequence[AbstractBlock]) -> AbstractBlock:
    """Blocks of one structure as one, whose parameters are arrays (R, 1)."""
    each = [named_parameters(block) for block in blocks]
    values = {n: np.array([[np.ravel(p[n].value)[0]] for p in each]) for n in each[0]}
    return set_values(blocks[0], values)


def _kind(block: AbstractBlock, problem: Problem) -> tuple:
    """Equal for problems that are computed together."""
    sizes = {np.size(p.value) for p in named_parameters(block).values()}
    alone = 0 if sizes <= {1} else id(problem)  # the parameters of several would need more axes
    structure = jax.tree_util.tree_structure(block)
    grid = problem.grid
    return alone, structure, grid.history, float(grid.step), np.size(problem.drive)
