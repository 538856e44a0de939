"""What every effect of the catalogue would add to the fitted model, as groups of columns.

A column is the secant f(θ̂, φ) - f(θ̂) at a typical size and shape φ, on the fit's coarse grid;
shapes that differ in linear gains alone are columns of one group.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from scipy.signal import lfilter

from .._blocks import EFFECTS, AbstractBlock, Effect, Resonance
from .._computing import map_in_threads
from .._parameters import named_parameters
from .._prepare import position_of
from ._fitted import Fitted

_MODES, _DAMPINGS = 80, (0.01, 0.05)
_LOWEST, _HIGHEST = 10.0, 0.9


@dataclass(frozen=True, eq=False)
class Group:
    """One shape of an effect: its columns (ΣL, k), in the response's unit, and the block that each
    of them is the secant to."""

    effect: Effect
    trials: tuple[AbstractBlock, ...]
    columns: np.ndarray


def groups_of(fitted: Fitted, adopted: Collection[str] = ()) -> list[Group]:
    """The groups of all effects that are not adopted."""
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
        found = []
        for trials in families.values():
            columns = []
            for trial in trials:
                parts = zip(blocks, drives, own, problems, strict=True)
                changed = sampled([effect.respond(b, trial, u, y, p.grid) for b, u, y, p in parts])
                columns += _by_recording(trial, np.nan_to_num(changed - base), lengths)
            each = tuple(trial for trial in trials for _ in range(len(columns) // len(trials)))
            found.append(Group(effect, each, np.stack(columns, axis=1)))
        return found

    listed = [effect for name, effect in EFFECTS.items() if name not in adopted]
    groups = [group for found in map_in_threads(of, listed) for group in found]
    if "resonance" not in adopted:
        groups += _modes(fitted, [y[:: p.oversampling] for y, p in zip(own, problems, strict=True)])
    return groups


def _by_recording(
    trial: AbstractBlock, column: np.ndarray, lengths: Sequence[int]
) -> list[np.ndarray]:
    """A column (ΣL,), or one for each recording where what it shows begins anew with each."""
    if len(lengths) == 1 or not any(p.per_recording for p in named_parameters(trial).values()):
        return [column]
    recording = np.repeat(np.arange(len(lengths)), lengths)
    return [np.where(recording == k, column, 0.0) for k in range(len(lengths))]


def _modes(fitted: Fitted, responses: Sequence[np.ndarray]) -> list[Group]:
    """A dense grid of modes: one that rings is seen from nearby alone."""
    setting = fitted.preparation.setting
    lowest, highest = max(_LOWEST, 2 * setting.top_frequency), _HIGHEST * 0.5 / setting.step
    effect, found = EFFECTS["resonance"], []
    if lowest >= highest:
        return []
    for frequency in np.geomspace(lowest, highest, _MODES):
        for damping in _DAMPINGS:
            parts = [_rung(y, frequency * setting.step, damping) - y for y in responses]
            column = np.concatenate(parts)[:, None]
            trial = Resonance(frequency, damping)
            found.append(Group(effect, (trial,), column))
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
