r"""Memory of turning points: play operators, after a curve of the drive where there is one.

    p_n = min(max(p_{n-1}, v_n - r), v_n + r),    y = Σ w_i p_i

A play only takes values that the drive has had, shifted by its radius: nothing accumulates.
Source: Krejci & Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185.
"""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import (
    AmplitudeDependence,
    Backlash,
    DriveMemory,
    MinorLoopMemory,
    PrandtlIshlinskii,
)
from ._section import Response, Sampling, Section, State, section_of


class Plays(Section):
    """Plays with radii (R,) of a curve of the drive; the gains are their weights."""

    def __init__(
        self,
        weights: np.ndarray,
        radii: np.ndarray,
        exercised: float = 0.0,
        curve: Callable[[Array], Array] = lambda drive: drive,
    ):
        self.gains, self.radii = np.asarray(weights, float), np.asarray(radii, float)
        self.labels = tuple(f"play of {radius:.4g}" for radius in self.radii)
        self.exercised, self.curve = exercised, curve

    def start(self, drive: Array) -> State:
        return {"play": self.curve(drive) + self.exercised * self.radii}

    def begin(self, state: State) -> Response:
        before = state["play"]

        def respond(drive: Array) -> tuple[Array, State]:
            level = self.curve(drive)
            low, high = level - self.radii, level + self.radii
            # By comparisons: the derivative of min and max takes three times the operations.
            pushed = jax.lax.select(high < before, high, before)
            play = jax.lax.select(low > before, low, pushed)
            return play, {"play": play}

        return respond


def _with_line(first: float, weights: np.ndarray, radii: np.ndarray, exercised: float) -> Plays:
    """first · u + Σ w_i p_i: the drive itself is the play of radius 0."""
    return Plays(np.append(first, weights), np.append(0.0, radii), exercised)


@section_of.register
def _(block: MinorLoopMemory, sampling: Sampling) -> Section:
    return Plays(np.asarray(block.weights.value), np.asarray(block.radii))


@section_of.register
def _(block: DriveMemory, sampling: Sampling) -> Section:
    shares = np.asarray(block.shares.value)
    return _with_line(1 - shares.sum(), shares, np.asarray(block.radii), 0.0)


@section_of.register
def _(block: AmplitudeDependence, sampling: Sampling) -> Section:
    radii = np.ravel(block.radii)
    weights = np.full(radii.size, 4 * float(block.alpha.value) / radii.size)
    return _with_line(1.0, weights, radii, float(block.exercised.value))


@section_of.register
def _(block: Backlash, sampling: Sampling) -> Section:
    weight = float(block.weight.value)
    return _with_line(1 - weight, np.array([weight]), np.ravel(block.radius.value), 0.0)


@section_of.register
def _(block: PrandtlIshlinskii, sampling: Sampling) -> Section:
    curve = block.curve

    def along(drive: Array) -> Array:
        return curve._at(drive) - curve._at(jnp.zeros(()))

    weights, radii = np.asarray(block.weights.value), np.asarray(block.radii.value)
    return Plays(weights, radii, curve=along)
