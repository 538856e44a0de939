"""What each effect inside a machine would add to its response, to first order, and what else might.

    y(θ, f) = y(θ, 0) + Σ_k a_k L[f_k(q)] + …

f_k is the force or flow that effect k makes on the fitted motion q at its port, and L the response
of the fitted machine to a force there, linearised along that motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.signal import cont2discrete, lfilter, ss2tf

from .._blocks import (
    INSIDE,
    AbstractForce,
    AbstractInside,
    AbstractMachine,
    InsideEffect,
    Motion,
    Within,
)
from .._computing import compiled
from .._naming import block_name
from .._operators import Grid
from .._prepare import Problem
from .._solve import Solved

_FREQUENCIES, _DAMPINGS = 12, (0.03, 0.3, 1.0)
"""Frequencies, from one period in the recording to half its rate, and damping ratios of the linear
dynamics that may be missing; chosen by judgement."""
_POWERS = (2, 3)
"""Powers of a static curve of the drive or the response."""


_Recorded = list[tuple[tuple[np.ndarray, Motion], Within, Problem]]
"""Per recording: response and motion on the fine grid, the block and the problem."""


class Column(NamedTuple):
    """One shape of one hypothesis.

    Attributes:
        inside: (d,) the ports where it acts, and the effect at each; empty for what is not inside.
        white: (ΣL, d) what each of them, or of its columns, adds to the whitened responses.
        machine: the machine whose port it is, for a port may have several places; None for what is
            not inside.
    """

    inside: tuple[tuple[str, AbstractInside], ...]
    white: np.ndarray
    machine: AbstractMachine | None = None


@dataclass(frozen=True)
class Columns:
    """What effects inside a fitted machine, and other hypotheses, would add to its response.

    Attributes:
        effects: by name, the shapes of each effect that a port of the machine admits, at each alone
            and at all of them, and at every place that the port may have.
        others: by name, what is not inside: `linear_dynamics`, one more pair of poles in parallel;
            `drive_curve` and `response_curve`, a static curve before or after the machine.
        residual: (ΣL,) whitened.
        tangent: (ΣL, p) the whitened derivative by what is free: what the fit absorbs.
        size: the norm of the whitened responses about their means.
    """

    effects: dict[str, list[Column]]
    others: dict[str, list[Column]]
    residual: np.ndarray
    tangent: np.ndarray
    size: float


def columns_of(solved: Solved, others: dict[str, list[Column]] | None = None) -> Columns:
    """The columns about a fit of a machine, a `Within` block; `others` where they were made.

    What the machine has at a port is free in its fit, and has no column there.
    """
    problems = solved.preparation.problems()
    blocks = cast(tuple[Within, ...], solved.blocks)
    pairs = [
        (_recorded(block, problem), block, problem)
        for block, problem in zip(blocks, problems, strict=True)
    ]
    within, ports = pairs[0][1], pairs[0][1].machine.ports()
    at = {site: _placed(site, pairs) for site in ports}
    has = {(site, block_name(e)) for site, e in zip(within.sites, within.effects, strict=True)}
    effects = {}
    for name, effect in INSIDE.items():
        sites = [
            site
            for site, port in ports.items()
            if port.kind == effect.kind and (site, name) not in has
        ]
        single = [
            [shape for placed in at[site] for shape in _shapes(effect, site, placed)]
            for site in sites
        ]
        if sites:
            effects[name] = [shape for shapes in single for shape in shapes]
        if len(sites) > 1:  # all stores drain alike
            effects[name] += [
                Column(
                    tuple(pair for shape in shapes for pair in shape.inside),
                    np.concatenate([shape.white for shape in shapes], axis=1),
                    within.machine,
                )
                for shapes in zip(*single, strict=True)
            ]
    return Columns(
        effects,
        _others(pairs) if others is None else others,
        np.concatenate(solved.whitened),
        solved.whitened_derivative(),
        float(np.sqrt(sum(problem.size**2 for problem in problems))),
    )


def _placed(site: str, pairs: _Recorded) -> list[_Recorded]:
    """The recordings with a port at every place that it may have."""
    variants = list(zip(*(block.placements(site) for _, block, _ in pairs), strict=True))
    if len(variants) == 1:
        return [pairs]
    return [
        [
            (_recorded(block, problem), block, problem)
            for block, (*_, problem) in zip(blocks, pairs, strict=True)
        ]
        for blocks in variants
    ]


def _shapes(effect: InsideEffect, site: str, pairs: _Recorded) -> list[Column]:
    """An effect's trials at one port."""
    machine = pairs[0][1].machine
    place = list(machine.ports()).index(site)
    motions = [Motion(*(signal[place] for signal in motion)) for (_, motion), *_ in pairs]
    trials = effect.trials(Motion(*map(np.concatenate, zip(*motions, strict=True))))
    columns = [
        _whitened(problem, _pushed_by(trials, place, motion, block, problem))
        for (_, motion), block, problem in pairs
    ]
    return [
        Column(((site, trial),), np.concatenate([c[k] for c in columns])[:, None], machine)
        for k, trial in enumerate(trials)
    ]


def _recorded(block: Within, problem: Problem) -> tuple[np.ndarray, Motion]:
    """The response (M,) and the motion (p, M) at the ports on the fine grid."""
    response, motion = _move(block, problem.drive, problem.grid)
    return np.asarray(response), Motion(*map(np.asarray, motion))


@compiled
def _move(block: Within, drive: Any, grid: Grid) -> tuple[Array, Motion]:
    return block.respond_to(jnp.asarray(drive), jnp.zeros((1, drive.size)), grid)


def _pushed_by(
    trials: Sequence[AbstractInside], place: int, motion: Motion, block: Within, problem: Problem
) -> np.ndarray:
    """What trials (K,) at a port add to the response (K, M), to first order."""
    here = Motion(*(np.asarray(signal)[place] for signal in motion))
    forces = np.stack([_acting(trial, here, problem.grid.step) for trial in trials])
    return np.asarray(_propagated(block, problem.drive, forces, place, problem.grid))


def _acting(effect: AbstractInside, motion: Motion, step: Any) -> np.ndarray:
    """What an effect makes of a motion (M,): a force or flow (M,) in drive units."""
    if isinstance(effect, AbstractForce):
        return np.asarray(effect.force(motion)) + np.zeros(np.shape(motion.drive))
    return np.asarray(_remembering(effect, motion, step))


@compiled
def _remembering(effect: AbstractInside, motion: Motion, step: Any) -> Array:
    def advance(carry: tuple, now: Motion) -> tuple[tuple, Array]:
        before, memory = carry
        force, memory = effect.act(now, before, memory, step)
        return (now, memory), force

    motion = Motion(*map(jnp.asarray, motion))
    first = Motion(*(signal[0] for signal in motion))
    return jax.lax.scan(advance, (first, effect.memory()), motion)[1]


@compiled
def _propagated(block: Within, drive: Any, forces: Any, place: int, grid: Grid) -> Array:
    """The change (K, M) of the response by forces (K, M) at a port, along the motion."""
    drive, ports = jnp.asarray(drive), len(block.machine.ports())

    def respond(force: Array) -> Array:
        pushes = jnp.zeros((ports, drive.size)).at[place].set(force)
        return block.respond_to(drive, pushes, grid)[0]

    change = jax.linearize(respond, jnp.zeros(drive.size))[1]
    return jax.vmap(change)(jnp.asarray(forces))


def _whitened(problem: Problem, signals: np.ndarray) -> np.ndarray:
    """Signals (K, M) on the fine grid, at the samples and whitened: (K, L)."""
    return problem.whiten(np.ascontiguousarray(signals[:, :: problem.oversampling].T)).T


def _others(pairs: _Recorded) -> dict[str, list[Column]]:
    """What is not inside the machine, by name."""
    modes, drives, responses = [], [], []
    for (response, _), block, problem in pairs:
        drive = np.asarray(problem.drive)
        modes.append([_whitened(problem, pair) for pair in _dynamics(problem)])
        curves = np.stack([_centred(drive) ** power for power in _POWERS])
        changed = np.stack(block.linearise(drive, problem.grid, (), list(curves))[2])
        drives.append(_whitened(problem, changed))
        curves = np.stack([_centred(response) ** power for power in _POWERS])
        responses.append(_whitened(problem, curves))
    return {
        "linear_dynamics": [
            Column((), np.concatenate([of[k] for of in modes], axis=1).T)
            for k in range(len(modes[0]))
        ],
        "drive_curve": [Column((), np.concatenate(drives, axis=1).T)],
        "response_curve": [Column((), np.concatenate(responses, axis=1).T)],
    }


def _centred(signal: np.ndarray) -> np.ndarray:
    """A signal minus its mean, of unit rms."""
    centred = signal - signal.mean()
    return centred / (centred.std() or 1.0)


def _dynamics(problem: Problem) -> list[np.ndarray]:
    """Position and rate (2, M) of modes that the drive moves beside the machine."""
    drive, step = _centred(np.asarray(problem.drive)), float(problem.grid.step)
    rate = 1 / (step * problem.oversampling)
    pairs = []
    for frequency in np.geomspace(1 / (step * drive.size), rate / 2, _FREQUENCIES):
        for damping in _DAMPINGS:
            w = 2 * np.pi * frequency
            mode = np.array([[0.0, w], [-w, -2 * damping * w]]), np.array([[0.0], [w]])
            discrete: Any = cont2discrete((*mode, np.eye(2), np.zeros((2, 1))), step, "foh")
            numerators, poles = ss2tf(*discrete[:4])
            pairs.append(np.stack([np.asarray(lfilter(row, poles, drive)) for row in numerators]))
    return pairs
