"""The residual of a fit beside the columns of every effect, and the posterior over effects."""

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
from ._modes import modes_of
from ._nuisance import loop_shapes
from ._selection import TAUS, Hypothesis, Kind, Posterior, log_posterior_of, select
from ._thresholds import MISFIT

_LEAST_EFFECTIVE = 30
"""The fewest samples that count as independent; chosen by judgement."""

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
"""Effects that are rate-independent, as loop shapes are."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Groups of the effects' columns, and loop shapes (ΣL, S), about one fit."""

    groups: list[Group]
    shapes: np.ndarray

    @cached_property
    def matrix(self) -> np.ndarray:
        """The columns (ΣL, K) of all groups."""
        return np.concatenate([group.columns for group in self.groups], axis=1)

    @cached_property
    def kinds(self) -> list[Kind]:
        """One kind per group: the range of its columns in `matrix`."""
        kinds, at = [], 0
        for group in self.groups:
            name, width = group.effect.name, group.columns.shape[1]
            kinds.append(Kind(name, at, at + width, group.effect.one_sided, name in SHAPE_CLASS))
            at += width
        return kinds


def columns_of(fitted: Fitted) -> Columns:
    """Every effect's columns and the loop shapes, about a fit."""
    shapes = loop_shapes(fitted.preparation)
    return Columns(groups_of(fitted) + modes_of(fitted, shapes), shapes)


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
    """The share of samples that count as independent, since a misfit is correlated."""

    def log_posterior_of(self, square: float, price: float) -> float:
        """The log posterior of one effect after a refit without loop shapes, from its χ² (`square`)
        and Occam's factor (`price`)."""
        return log_posterior_of(1, self.share * square, price, self.share * self.gram.count)

    def folds(self, tau: float) -> Folds:
        """Held-out stretches, with loop shapes of size τ."""
        residual, _, shapes = self.white
        used = tau * shapes if tau > 0 else shapes[:, :0]
        return Folds(self.fitted, used, residual)

    @property
    def kinds(self) -> list[Kind]:
        """The kinds of the columns."""
        return self.columns.kinds

    def misfit(self, hypothesis: Hypothesis) -> float:
        """χ² per sample after a hypothesis."""
        remainder = self.gram.remainder(hypothesis.tau, *hypothesis.columns(self.kinds))
        return float(remainder @ remainder) / self.gram.count

    def remainder_of(self, hypothesis: Hypothesis) -> np.ndarray:
        """The error (ΣL,) minus what a hypothesis and a change of the model's parameters explain,
        in the response's unit."""
        fitted = self.fitted
        chosen, sizes = hypothesis.columns(self.kinds)
        parts = [
            fitted.free_directions,
            hypothesis.tau * self.columns.shapes,
            self.columns.matrix[:, chosen] * sizes,
        ]
        design = np.concatenate(parts, axis=1)
        white = fitted.whitened(design)
        coefficients = np.linalg.solve(
            np.eye(design.shape[1]) + white.T @ white, white.T @ fitted.whitened(fitted.error)
        )
        return fitted.error - design @ coefficients


def view_of(fitted: Fitted, columns: Columns, small: float) -> View:
    """The posterior about a fit, over sets of up to three effects.

    Rate-independent effects are only combined with loop shapes up to `small`, over the response's
    span.  A correlated misfit that no loop shape explains reduces the number of independent
    samples.
    """
    error, effects = fitted.whitened(fitted.error), fitted.whitened(columns.matrix)
    shapes = fitted.whitened(columns.shapes)
    samples = int(np.count_nonzero(fitted.counted))
    gram = Gram(error, effects, shapes, fitted.whitened(fitted.tangent), samples)
    remainder = gram.remainder(float(TAUS[-1]), np.zeros(0, int), np.zeros(0))
    share = 1.0
    if remainder @ remainder > MISFIT * gram.count:
        alike = max(0.0, float(np.corrcoef(remainder[1:], remainder[:-1])[0, 1]))
        share = max((1 - alike) / (1 + alike), _LEAST_EFFECTIVE / gram.count)
    posterior = select(gram, columns.kinds, small, share)
    return View(fitted, columns, gram, posterior, (error, effects, shapes), share)


def with_misfit_as_noise(view: View, hypothesis: Hypothesis) -> Preparation:
    """The preparation whose noise has the level and the colour of the error after a hypothesis."""
    remainder, at, noises = view.remainder_of(hypothesis), 0, []
    nothing = np.zeros(0), np.zeros(0)
    for take, problem in zip(view.fitted.preparation.takes, view.fitted.problems, strict=True):
        own = remainder[at : at + len(take.recording)][take.used]
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
