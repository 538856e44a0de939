r"""The projected score test: does the residual contain effect k, after the fit has absorbed what it
can?

With W the whitening, r = W (y - f(θ̂)), J = W ∂f/∂θ and P = 1 - J(JᵀJ)⁻¹Jᵀ, the column of effect k
at shape j is d = W [f(θ̂, φ_kj) - f(θ̂)], and

    z = (P d)ᵀ r / ‖P d‖

is standard normal where the model is right.  Concealment is C = 1 - ‖P d‖²/‖d‖².

Trials that differ in linear gains alone, with D (K, L) their P d, form a family: a block with many
gains, such as a sum of play operators, is in the residual as far as all of them together are.  They
reduce χ² by rᵀDᵀ(DDᵀ)⁺D r, and the linear Bayes factor for them, each with a normal prior about 0
whose standard deviation is its typical size, is

    2 ln B = -ln det(1 + DDᵀ) + (D r)ᵀ (1 + DDᵀ)⁻¹ D r

Sources: C. R. Rao (1948) for score tests; Benveniste, Basseville & Moustakides, IEEE Trans. Autom.
Control 32 (1987) 583 for the local approach; R. B. Davies, Biometrika 74 (1987) 33 for shapes that
vanish under the null.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import jax
import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm
from scipy.stats import t as student

from .._blocks import AbstractBlock, Effect, Setting
from .._prepare import Problem, position_of

_DRAWS = 20_000
"""Simulated residuals for a p-value; chosen by judgement."""
_DETECTION = 5.0
"""|z| from which an effect counts as detectable; chosen by judgement."""
_LEAST_NORM = 1e-6
"""‖P d‖ below which a signature is numerically zero, over ‖d‖."""
_INDEPENDENT = 1e-6
"""Smallest eigenvalue of a Gram matrix that counts as independent, over the largest one."""


@dataclass(frozen=True)
class Residual:
    """Whitened residual (ΣL,) and an orthonormal basis (ΣL, r) of what the fit can absorb."""

    whitened: np.ndarray
    basis: np.ndarray

    def project(self, columns: np.ndarray) -> np.ndarray:
        """Columns (K, ΣL) minus what the fit can absorb."""
        return columns - (columns @ self.basis) @ self.basis.T


@dataclass(frozen=True, eq=False)
class EffectScore:
    """The score test of one effect over its trials (K,): z, ‖P d‖, concealment, amplitudes.

    `directions` (K, ΣL) are the P d of unit length; `sizes` the rms of each trial's change of the
    response, in the response's unit; `families` the indices of the trials of each family.
    """

    effect: Effect
    trials: list[AbstractBlock]
    z: np.ndarray
    norms: np.ndarray
    concealments: np.ndarray
    sizes: np.ndarray
    directions: np.ndarray
    families: tuple[tuple[int, ...], ...]

    def only(self, trials: list[int]) -> EffectScore:
        """The test with only some of the trials."""
        chosen = [self.trials[k] for k in trials]
        return EffectScore(
            self.effect,
            chosen,
            self.z[trials],
            self.norms[trials],
            self.concealments[trials],
            self.sizes[trials],
            self.directions[trials],
            _families(chosen),
        )

    @property
    def best(self) -> int:
        """The trial that the residual resembles most."""
        return int(np.argmax(np.abs(self.z)))

    @property
    def height(self) -> float:
        """The largest |z| of all trials."""
        return float(np.abs(self.z).max())

    @property
    def promised(self) -> float:
        """The reduction of χ² by the best family if the effect were linear, minus what noise gives
        to all gains of the family but one."""
        return max(self._reduction(list(family)) for family in self.families)

    def _reduction(self, family: list[int]) -> float:
        """The reduction of χ² by one family of trials, minus what noise gives to all but one."""
        values, turned = _independent(self.directions[family])
        along = turned.T @ self.z[family]
        return float(np.sum(along**2 / values)) - (along.size - 1)

    @property
    def log_evidence(self) -> float:
        """Linear log Bayes factor for the effect, with the typical amplitude as the standard
        deviation of the prior; for an effect with one sign, with half of that prior."""
        each = np.array([self._log_evidence(list(family)) for family in self.families])
        return float(logsumexp(each) - np.log(each.size))

    def _log_evidence(self, family: list[int]) -> float:
        """The linear log Bayes factor for one family of trials."""
        norms, z = self.norms[family], self.z[family]
        columns = norms[:, None] * self.directions[family]
        gram = np.eye(len(family)) + columns @ columns.T
        projections = norms * z
        quadratic = projections @ np.linalg.solve(gram, projections)
        log_evidence = 0.5 * (quadratic - np.linalg.slogdet(gram)[1])
        if self.effect.one_sided and len(family) == 1:
            n2 = norms[0] ** 2
            log_evidence += np.log(2) + norm.logcdf(z[0] * np.sqrt(n2 / (1 + n2)))
        return float(log_evidence)

    @property
    def detectable_amplitude(self) -> float:
        """The smallest rms change of the response with |z| ≥ 5, at the best trial, in its unit."""
        return float(_DETECTION * self.sizes[self.best] / max(self.norms[self.best], _LEAST_NORM))


class Scorer:
    """The score test of effects on one fitted base, whose responses are computed once; `bases` has
    one block for each recording."""

    def __init__(
        self, bases: Sequence[AbstractBlock], problems: tuple[Problem, ...], residual: Residual
    ):
        self.bases, self.problems, self.residual = bases, problems, residual
        self.drives = [np.asarray(problem.drive) for problem in problems]
        self.fine = [
            base.respond(u, p.grid) for base, u, p in zip(bases, self.drives, problems, strict=True)
        ]
        self.raw, self.whitened = self._sampled(self.fine)
        self.counted = np.concatenate([problem.weights for problem in problems]) > 0

    def _sampled(self, fine: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Responses at the recordings' samples (ΣL,), in their unit and whitened."""
        pairs = list(zip(fine, self.problems, strict=True))
        raw = [response[:: p.oversampling] for response, p in pairs]
        white = [p.whiten(r) for r, p in zip(raw, self.problems, strict=True)]
        return np.concatenate(raw), np.concatenate(white)

    def score(self, effect: Effect, setting: Setting) -> EffectScore:
        """Score one effect at all its trials."""
        trials = list(effect.trials(setting))
        changed = []
        for trial in trials:
            parts = zip(self.bases, self.problems, self.drives, self.fine, strict=True)
            changed.append(
                self._sampled([effect.respond(b, trial, u, y, p.grid) for b, p, u, y in parts])
            )
        raw, whitened = (np.stack(columns) for columns in zip(*changed, strict=True))
        columns = whitened - self.whitened
        sizes = np.sqrt(np.mean((raw - self.raw)[:, self.counted] ** 2, axis=1))
        projected = self.residual.project(columns)
        norms, lengths = np.linalg.norm(projected, axis=1), np.linalg.norm(columns, axis=1)
        nonzero = norms > _LEAST_NORM * np.maximum(lengths, 1.0)
        units = projected / np.maximum(norms, 1e-300)[:, None]
        directions = np.where(nonzero[:, None], units, 0.0)
        return EffectScore(
            effect=effect,
            trials=trials,
            z=directions @ self.residual.whitened,
            norms=np.where(nonzero, norms, 0.0),
            concealments=1 - (norms / np.maximum(lengths, 1e-300)) ** 2,
            sizes=sizes,
            directions=directions,
            families=_families(trials),
        )


def _families(trials: Sequence[AbstractBlock]) -> tuple[tuple[int, ...], ...]:
    """The indices of trials that differ in gains alone; each trial is in one family."""
    families: dict[Hashable, list[int]] = {}
    for k, trial in enumerate(trials):
        families.setdefault((kind_of(trial), position_of(trial).tobytes()), []).append(k)
    return tuple(tuple(family) for family in families.values())


def kind_of(block: AbstractBlock) -> Hashable:
    """A key that is equal for blocks that differ in the values of their parameters alone."""
    leaves, structure = jax.tree_util.tree_flatten(block)
    return structure, tuple(np.shape(leaf) for leaf in leaves)


def _independent(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (n,) and vectors (K, n) of the Gram matrix of directions (K, ΣL), without those
    that are numerically zero."""
    values, vectors = np.linalg.eigh(directions @ directions.T)
    apart = values > _INDEPENDENT * values[-1]
    return values[apart], vectors[:, apart]


def family_wise_p(scores: list[EffectScore], freedom: float, seed: int) -> float:
    """P(max |z| over all columns ≥ the observed one), if the model is right.

    `freedom`: the degrees of freedom of the noise level, as in Student's t.

    It is simulated with the columns' Gram matrix, which accounts for correlation, multiplicity and
    shapes together; for p-values that are too small to simulate it is Bonferroni's bound.
    """
    directions = np.concatenate([s.directions for s in scores])
    largest = max(s.height for s in scores)
    observed = float(norm.isf(student.sf(largest, freedom)))
    bonferroni = min(1.0, 2 * directions.shape[0] * float(norm.sf(observed)))
    if bonferroni < 1 / _DRAWS:
        return bonferroni
    values, vectors = _independent(directions)
    root = vectors * np.sqrt(values)
    generator = np.random.default_rng(seed)
    normal = generator.standard_normal((_DRAWS, root.shape[1]), np.float32)
    draws = normal @ root.T.astype(np.float32)
    exceeded = int(np.sum(np.abs(draws).max(axis=1) >= observed))
    return min(bonferroni, (exceeded + 1) / (_DRAWS + 1)) if exceeded == 0 else exceeded / _DRAWS


def confusability(one: EffectScore, other: EffectScore) -> float:
    """ρ = max |cos| between the directions that the residual resembles most."""
    return float(np.abs(one.directions[one.best] @ other.directions[other.best]))
