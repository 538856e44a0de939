"""The changes of the fitted model's response by every effect of the catalogue, as columns.

A column is the secant f(θ̂, φ) - f(θ̂) at a typical size and shape φ, on the fit's coarse grid;
trials that differ in linear gains alone are columns of one group.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import jax
import numpy as np

from .._blocks import EFFECTS, AbstractBlock, Effect
from .._computing import map_in_threads
from .._parameters import named_parameters
from .._prepare import position_of
from ._fitted import Fitted


@dataclass(frozen=True, eq=False)
class Group:
    """One shape of an effect: its columns (ΣL, k), in the response's unit, and the trial block that
    each of them belongs to."""

    effect: Effect
    trials: tuple[AbstractBlock, ...]
    columns: np.ndarray


def groups_of(fitted: Fitted) -> list[Group]:
    """The groups of all effects."""
    problems, setting = fitted.problems, fitted.preparation.setting
    drives = [np.asarray(problem.drive) for problem in problems]
    blocks = fitted.solved.blocks
    own = [b.respond(u, p.grid) for b, u, p in zip(blocks, drives, problems, strict=True)]

    def sampled(responses: Sequence[np.ndarray]) -> np.ndarray:
        pairs = zip(responses, problems, strict=True)
        return np.concatenate([response[:: p.oversampling] for response, p in pairs])

    base, lengths = sampled(own), [len(problem.response) for problem in problems]

    def of(effect: Effect) -> list[Group]:
        families: dict[Hashable, list[AbstractBlock]] = {}
        for trial in effect.trials(setting):
            families.setdefault((kind_of(trial), position_of(trial).tobytes()), []).append(trial)
        groups = []
        for trials in families.values():
            columns = []
            for trial in trials:
                parts = zip(blocks, drives, own, problems, strict=True)
                changed = sampled([effect.respond(b, trial, u, y, p.grid) for b, u, y, p in parts])
                columns += _by_recording(trial, np.nan_to_num(changed - base), lengths)
            each = tuple(trial for trial in trials for _ in range(len(columns) // len(trials)))
            groups.append(Group(effect, each, np.stack(columns, axis=1)))
        return groups

    by_effect = map_in_threads(of, list(EFFECTS.values()))
    return [group for groups in by_effect for group in groups]


def _by_recording(
    trial: AbstractBlock, column: np.ndarray, lengths: Sequence[int]
) -> list[np.ndarray]:
    """A column (ΣL,), or one for each recording if the trial has a parameter per recording."""
    if len(lengths) == 1 or not any(p.per_recording for p in named_parameters(trial).values()):
        return [column]
    recording = np.repeat(np.arange(len(lengths)), lengths)
    return [np.where(recording == k, column, 0.0) for k in range(len(lengths))]


def kind_of(block: AbstractBlock) -> Hashable:
    """A key that blocks share which differ in the values of their parameters alone."""
    leaves, structure = jax.tree_util.tree_flatten(block)
    return structure, tuple(np.shape(leaf) for leaf in leaves)
