r"""A static curve that is not in the catalogue: an empirical description of a mismatch.

An amplifier with kinks, a hinge that stiffens, a sensor with its own table:

    v = u + Σ_i c_i |u - u_i|,    twelve u_i evenly over the range

of the drive u before the base, or of the response after it, with fitted slopes.  It is the same for
rising and falling drive and at every rate.  Play operators of both signs can follow it on a single
loop, which has only one rising and one falling branch.  An effect's model has a few parameters, the
curve has twelve: if the model is right, the curve gains less in BIC.
Source: the piecewise linear static part of a Hammerstein or Wiener model, Giri & Bai,
Block-oriented Nonlinear System Identification (2010), chapter 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import Parameter, named_parameters
from .._solve import Solved, orthonormal_basis, solve_from
from ._evidence import delta_bic
from ._judgement import margin_of
from ._residual import residual_of
from ._score import Residual
from ._stage import Stage

_KINKS = 12
"""Kinks of a curve; chosen by judgement."""


class Bent(AbstractBlock):
    """The curve; its parameters `turns` (12,) are half of each change of slope, dimensionless, at
    `kinks` (12,), in the unit of the drive."""

    turns: Parameter
    kinks: Array | np.ndarray

    def __init__(self, low: float, high: float):
        self.turns = Parameter(np.zeros(_KINKS), gain=True)
        self.kinks = low + (np.arange(_KINKS) + 0.5) / _KINKS * (high - low)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return drive + jnp.abs(drive[:, None] - jnp.asarray(self.kinks)) @ self.turns.value


@dataclass(frozen=True)
class Curve:
    """The base fitted together with a curve of the `argument`, drive or response, in its `unit`;
    `or_else` is the other one, if a curve of that is not excluded, else ""."""

    argument: str
    unit: str
    kinks: np.ndarray
    turns: np.ndarray
    solved: Solved
    or_else: str = ""

    def is_ahead_of(self, other: Solved, gained: float) -> bool:
        """Whether it excludes another fit, if the gain in BIC over the base is `gained`."""
        return delta_bic(other, self.solved) >= margin_of(gained)

    @property
    def sentence(self) -> str:
        """The stretches where it is steepest and flattest, and the remedy, in words."""
        is_below = np.tri(self.kinks.size - 1, self.kinks.size)
        inner = 1 + (2 * is_below - 1) @ self.turns
        slopes = inner / inner.mean()
        stretches = [
            f"{word} ({slopes[k]:.3g} times its mean slope) from {self.kinks[k]:.4g} to "
            f"{self.kinks[k + 1]:.4g} {self.unit}"
            for word, k in (("steepest", np.argmax(slopes)), ("flattest", np.argmin(slopes)))
        ]
        remedy = {
            "drive": "Record the voltage at the actuator itself: a curve of the amplifier is then "
            "part of the drive.",
            "response": "Record the same drive with the sensor's gap shifted, or with a second "
            "sensor: a curve of the sensor then shifts with it.",
        }[self.argument]
        other = f" (or of the {self.or_else}, which fits nearly as well)" if self.or_else else ""
        return (
            f"It looks like a static curve of the {self.argument}{other}, the same for rising and "
            "falling drive and at every rate, of a shape that the catalogue does not contain: "
            f"{' and '.join(stretches)}. {remedy}"
        )


def find_curve(base: Stage, least: float) -> Curve | None:
    """The base fitted with a curve of the drive or of the response, whichever gains more; None if
    neither reduces χ² by `least` in the linear test."""
    setting, bare = base.preparation.setting, (base.solved.block, base.nominal)
    takes, problems = base.preparation.takes, base.preparation.problems()
    responses = [
        problem.linearised(base.solved.block, [])[0][: take.used.size][take.used]
        for problem, take in zip(problems, takes, strict=True)
    ]
    ahead = Bent(setting.drive_low, setting.drive_high)
    behind = Bent(min(r.min() for r in responses), max(r.max() for r in responses))
    # Each recording has its own zero of the displacement.
    recording = takes[0].recording
    zero = float(np.mean(recording.response[takes[0].used] - responses[0]))
    sides = [
        ("drive", recording.drive_unit, 0.0, "first", [ahead >> block for block in bare]),
        ("response", recording.response_unit, zero, "second", [block >> behind for block in bare]),
    ]
    residual = residual_of(base.solved)
    curves = [
        _fitted(argument, unit, zero, place, starts, base)
        for argument, unit, zero, place, starts in sides
        if _promised(starts[0], place, base, residual) >= least
    ]
    if not curves:
        return None
    best, *others = sorted(curves, key=lambda curve: curve.solved.bic)
    gained = base.solved.bic - best.solved.bic
    near = [other.argument for other in others if not best.is_ahead_of(other.solved, gained)]
    return replace(best, or_else="".join(near))


def _promised(block: AbstractBlock, place: str, base: Stage, residual: Residual) -> float:
    """The reduction of χ² by all changes of slope together, by the projected score test."""
    pieces = [
        problem.whiten(problem.linearised(block, [f"{place}.turns"])[1])
        for problem in base.preparation.problems()
    ]
    directions = orthonormal_basis(residual.project(np.concatenate(pieces).T).T)
    return float(np.sum((directions.T @ residual.whitened) ** 2))


def _fitted(
    argument: str,
    unit: str,
    zero: float,
    place: str,
    starts: list[AbstractBlock],
    base: Stage,
) -> Curve:
    """The base fitted together with a curve, whose kinks are counted from `zero` in `unit`."""
    solved = solve_from(starts, base.preparation)
    turns = named_parameters(solved.block)[f"{place}.turns"].value
    kinks = zero + getattr(starts[0], place).kinks
    return Curve(argument, unit, kinks, np.asarray(turns), solved)
