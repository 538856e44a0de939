"""What a fit leaves, seen with every effect's columns at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .._prepare import Preparation
from ._colour import colour_of
from ._columns import Group, groups_of
from ._fitted import Fitted
from ._folds import Folds
from ._gram import Gram
from ._nuisance import loop_shapes
from ._selection import TAUS, Hypothesis, Kind, Posterior, log_posterior_of, select
from ._thresholds import MISFIT

_LEAST_EFFECTIVE = 30
_FREE = 1e3

SHAPE_CLASS = frozenset(
    (
        "minor_loop_memory",
        "amplitude_dependence",
        "backlash",
        "coulomb_friction",
        "saturation",
        "electrostriction",
        "cubic_nonlinearity",
        "sensor_nonlinearity",
        "lost_contact",
        "quantisation",
    )
)
"""Effects that are themselves rate-independent: of the class that loop shapes span."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Groups of effects, and loop shapes (ΣL, S), about one fit."""

    groups: list[Group]
    shapes: np.ndarray

    @cached_property
    def matrix(self) -> np.ndarray:
        """All groups' columns (ΣL, K)."""
        return np.concatenate([group.columns for group in self.groups], axis=1)

    @cached_property
    def kinds(self) -> list[Kind]:
        """Which of them belong together."""
        found, at = [], 0
        for group in self.groups:
            name, width = group.effect.name, group.columns.shape[1]
            found.append(Kind(name, at, at + width, group.effect.one_sided, name in SHAPE_CLASS))
            at += width
        return found


def columns_of(fitted: Fitted) -> Columns:
    """Every effect's columns and the loop shapes, about a fit."""
    return Columns(groups_of(fitted), loop_shapes(fitted.preparation))


@dataclass(frozen=True, eq=False)
class View:
    """A fit with columns about it, their inner products, and the posterior over effects."""

    fitted: Fitted
    columns: Columns
    gram: Gram
    posterior: Posterior
    white: tuple[np.ndarray, np.ndarray, np.ndarray]
    """The error (ΣL,), the effects' columns and the loop shapes, whitened."""
    share: float
    """How many of the samples count, the neighbours of a misfit being alike."""

    def log_posterior_of(self, square: float, price: float) -> float:
        """That of one effect refitted to this χ² without loop shapes, beside the posterior's."""
        return log_posterior_of(1, self.share * square, price, self.share * self.gram.count)

    def folds(self, tau: float) -> Folds:
        """Stretches set aside, beside loop shapes of this size."""
        residual, _, shapes = self.white
        used = tau * shapes if tau > 0 else shapes[:, :0]
        return Folds(self.fitted, used, residual)

    @property
    def kinds(self) -> list[Kind]:
        return self.columns.kinds

    def misfit(self, hypothesis: Hypothesis) -> float:
        """χ² per sample of what a hypothesis leaves."""
        left = self.gram.left(hypothesis.tau, *hypothesis.columns(self.kinds))
        return float(left @ left) / self.gram.count

    def left_of(self, hypothesis: Hypothesis) -> np.ndarray:
        """What a hypothesis leaves of the error (ΣL,), in the response's unit."""
        fitted = self.fitted
        chosen, sizes = hypothesis.columns(self.kinds)
        tangent = fitted.tangent
        lengths = np.linalg.norm(fitted.whitened(tangent), axis=0) + 1e-300
        parts = [
            _FREE * tangent / lengths,
            hypothesis.tau * self.columns.shapes,
            self.columns.matrix[:, chosen] * sizes,
        ]
        design = np.concatenate(parts, axis=1)
        white = fitted.whitened(design)
        known = np.linalg.solve(
            np.eye(design.shape[1]) + white.T @ white, white.T @ fitted.whitened(fitted.error)
        )
        return fitted.error - design @ known


def view_of(
    fitted: Fitted, columns: Columns, small: float, *, thinned: bool = False, most: int = 3
) -> View:
    """The posterior about a fit; loop shapes of up to `small`, a share of the response's span, may
    stand beside effects of their own class.

    `thinned` where the noise's colour alone is known: samples of a misfit then count as far as they
    differ from their neighbours.
    """
    error, effects = fitted.whitened(fitted.error), fitted.whitened(columns.matrix)
    shapes = fitted.whitened(columns.shapes)
    samples = int(sum(np.count_nonzero(problem.weights) for problem in fitted.problems))
    gram = Gram(error, effects, shapes, fitted.whitened(fitted.tangent), samples)
    share = 1.0
    if thinned:
        left = gram.left(float(TAUS[-1]), np.zeros(0, int), np.zeros(0))
        if left @ left > MISFIT * gram.count:
            alike = max(0.0, float(np.corrcoef(left[1:], left[:-1])[0, 1]))
            share = max((1 - alike) / (1 + alike), _LEAST_EFFECTIVE / gram.count)
    posterior = select(gram, columns.kinds, small, share, most)
    return View(fitted, columns, gram, posterior, (error, effects, shapes), share)


def with_misfit_as_noise(view: View, hypothesis: Hypothesis) -> Preparation:
    """The preparation whose noise is all that a hypothesis leaves."""
    left, at, noises = view.left_of(hypothesis), 0, []
    nothing = np.zeros(0), np.zeros(0)
    for take, problem in zip(view.fitted.preparation.takes, view.fitted.problems, strict=True):
        own = left[at : at + len(take.recording)][take.used]
        at += len(problem.response)
        taps = colour_of(own)
        assert take.noise is not None  # a diagnosis has one
        noises.append(
            replace(
                take.noise,
                sigma=float(own.std()),
                filter=taps / taps[0],
                innovation=1 / taps[0],
                course=nothing,
            )
        )
    return view.fitted.preparation.with_noises(noises)
