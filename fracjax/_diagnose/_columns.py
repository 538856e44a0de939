"""What every effect of the catalogue would add to the fitted model, as groups of columns.

A column is the secant f(θ̂, φ) - f(θ̂) at a typical size and shape φ, on the fit's coarse grid; where
the loop's shape is not the model's, an effect acts on what that adds too.  Shapes that differ in
linear gains alone are columns of one group.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import numpy as np
from scipy.signal import lfilter

from .._blocks import EFFECTS, AbstractBlock, ClockSkew, Delay, DriveLag, Effect, Resonance
from .._computing import map_in_threads
from .._operators import Grid
from .._parameters import named_parameters
from .._prepare import position_of
from ._fitted import Fitted

_MODES, _DAMPINGS = 80, (0.01, 0.05)
_LOWEST, _HIGHEST = 10.0, 0.9


_SHIFTS = (Delay, DriveLag, ClockSkew)
"""Blocks before the model that a loop shape, which knows no rate, lets pass as they are."""


@dataclass(frozen=True, eq=False)
class Group:
    """One shape of an effect: its columns (ΣL, k), in the response's unit, the block that each of
    them is the secant to, and what of them acts on the loop's shape beside the model (ΣL, k)."""

    effect: Effect
    trials: tuple[AbstractBlock, ...]
    columns: np.ndarray
    on_shape: np.ndarray


class _Signal(NamedTuple):
    """A recording's drive and the model's response (M,) on the fine grid, with its block and grid,
    and what the loop's shape adds to that response."""

    block: AbstractBlock
    grid: Grid
    oversampling: int
    drive: np.ndarray
    response: np.ndarray
    shape: np.ndarray

    def secant(self, effect: Effect, trial: AbstractBlock) -> tuple[np.ndarray, np.ndarray]:
        """What a trial changes (L,), and what of that acts on the loop's shape."""
        changed = effect.respond(self.block, trial, self.drive, self.response, self.grid)
        on_model, on_shape = changed - self.response, np.zeros_like(self.shape)
        if self.shape.any():
            on_shape = self._on_shape(effect, trial, on_model)
        both = (on_model + on_shape, on_shape)
        of_all, of_shape = (np.nan_to_num(x[:: self.oversampling]) for x in both)
        return of_all, of_shape

    def _on_shape(self, effect: Effect, trial: AbstractBlock, on_model: np.ndarray) -> np.ndarray:
        if effect.site_of(trial) != "drive":
            whole = self.response + self.shape
            of_whole = effect.respond(self.block, trial, self.drive, whole, self.grid) - whole
            return of_whole - on_model
        if isinstance(trial, _SHIFTS):
            return trial.respond(self.shape, self.grid) - self.shape
        return np.zeros_like(self.shape)


def groups_of(fitted: Fitted, shape: np.ndarray | None = None) -> list[Group]:
    """The groups of all effects; `shape` (ΣL,) is what the loop's shape adds to the response."""
    setting, signals = fitted.preparation.setting, _signals(fitted, shape)
    lengths = [len(problem.response) for problem in fitted.problems]

    def of(effect: Effect) -> list[Group]:
        families: dict[Hashable, list[AbstractBlock]] = {}
        for trial in effect.trials(setting):
            families.setdefault((kind_of(trial), position_of(trial).tobytes()), []).append(trial)
        found = []
        for trials in families.values():
            columns: list[np.ndarray] = []
            on_shape: list[np.ndarray] = []
            for trial in trials:
                parts = zip(*(signal.secant(effect, trial) for signal in signals), strict=True)
                for listed, part in zip((columns, on_shape), parts, strict=True):
                    listed += _by_recording(trial, np.concatenate(part), lengths)
            each = tuple(trial for trial in trials for _ in range(len(columns) // len(trials)))
            found.append(Group(effect, each, np.stack(columns, axis=1), np.stack(on_shape, axis=1)))
        return found

    groups = [group for found in map_in_threads(of, list(EFFECTS.values())) for group in found]
    return groups + _modes(fitted, signals)


def _signals(fitted: Fitted, shape: np.ndarray | None) -> list[_Signal]:
    """What the effects act on, for each recording."""
    found, at = [], 0
    for block, problem in zip(fitted.solved.blocks, fitted.problems, strict=True):
        drive, length = np.asarray(problem.drive), len(problem.response)
        own, added = block.respond(drive, problem.grid), np.zeros(drive.size)
        if shape is not None:
            where = np.arange(drive.size) / problem.oversampling
            added = np.interp(where, np.arange(length), shape[at : at + length])
        at += length
        found.append(_Signal(block, problem.grid, problem.oversampling, drive, own, added))
    return found


def _by_recording(
    trial: AbstractBlock, column: np.ndarray, lengths: Sequence[int]
) -> list[np.ndarray]:
    """A column (ΣL,), or one for each recording where what it shows begins anew with each."""
    if len(lengths) == 1 or not any(p.per_recording for p in named_parameters(trial).values()):
        return [column]
    recording = np.repeat(np.arange(len(lengths)), lengths)
    return [np.where(recording == k, column, 0.0) for k in range(len(lengths))]


def _modes(fitted: Fitted, signals: Sequence[_Signal]) -> list[Group]:
    """A dense grid of modes: one that rings is seen from nearby alone."""
    setting = fitted.preparation.setting
    lowest, highest = max(_LOWEST, 2 * setting.top_frequency), _HIGHEST * 0.5 / setting.step
    if lowest >= highest:
        return []
    models, shapes = (
        [x[:: s.oversampling] for s, x in zip(signals, of, strict=True)]
        for of in ([s.response for s in signals], [s.shape for s in signals])
    )
    found = []
    for frequency in np.geomspace(lowest, highest, _MODES):
        for damping in _DAMPINGS:
            on_model, on_shape = (
                np.concatenate([_rung(y, frequency * setting.step, damping) - y for y in part])
                for part in (models, shapes)
            )
            trial, both = Resonance(frequency, damping), on_model + on_shape
            found.append(Group(EFFECTS["resonance"], (trial,), both[:, None], on_shape[:, None]))
    return found


def _rung(signal: np.ndarray, frequency: float, damping: float) -> np.ndarray:
    """A signal (N,) through a mode of that frequency [1/sample], by the bilinear rule with the
    frequency kept."""
    w = 2 * np.pi * frequency
    k = w / np.tan(w / 2)
    first = k * k + 2 * damping * w * k + w * w
    squares = w * w / first
    poles = [1.0, (2 * w * w - 2 * k * k) / first, (k * k - 2 * damping * w * k + w * w) / first]
    moved = signal - signal[0]
    return np.asarray(lfilter(squares * np.array([1.0, 2.0, 1.0]), poles, moved)) + signal[0]


def kind_of(block: AbstractBlock) -> Hashable:
    """What blocks share that differ in the values of their parameters alone."""
    leaves, structure = jax.tree_util.tree_flatten(block)
    return structure, tuple(np.shape(leaf) for leaf in leaves)
