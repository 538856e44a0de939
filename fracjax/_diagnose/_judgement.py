"""The criteria by which a refitted effect is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._prepare import Preparation
from .._solve import LIMIT, Solved, tolerated_error
from ._evidence import strain
from ._held_out import Gain, Predict, Prediction, predict_stretches
from ._refit import Refit
from ._result import Axis
from ._score import EffectScore
from ._stage import Layer, Stage

SIGNIFICANCE = 0.01
"""p-value below which a mismatch is significant."""
PLACES_ALONE = 1e-4
"""The same if no effect improves the fit; chosen by judgement."""
DELTA_BIC = 10.0
"""Gain in BIC from which an effect is adopted: very strong evidence by Kass & Raftery, J. Am. Stat.
Assoc. 90 (1995) 773."""
EXPLAINED = 0.9
"""The share of the excess residual that adopted effects must explain; chosen by judgement."""
SMALL = 0.1
"""A numerical error is negligible compared with ten times its size; chosen by judgement."""
WORTH_NAMING = 0.02
"""The smallest share of the excess that a further effect must explain.  In a development exam
nothing explained more than .009 of it in addition to a single true effect; of true second effects
the smallest that completed a fit explained .034."""
_INEXACT = 0.05
"""Share of the base's excess by which an adopted effect may differ from its model; chosen by
judgement."""
APART = 25.0
"""Difference in BIC that excludes another fit: five standard errors between two signatures."""
_ALIKE = 0.01
"""The same as a share of the gain, since no model of the catalogue is exact; chosen by judgement.
"""
_UNUSUAL = 0.01
"""Share of its gain that an effect may lose by keeping to its usual ranges; chosen by judgement."""
_REMAINDER = 0.5
"""Excess χ² per sample that still counts as smaller than the noise; chosen by judgement."""
_PATTERN = 0.15
"""Share of the explained χ² that a pattern in the residual may have; chosen by judgement."""
SUREST = 0.96
"""Probability of a name without rivals; see `probability_of`."""
_TEMPERED = 8.0
"""The difference in BIC that lowers a rival's weight by e; see `probability_of`."""


@dataclass(frozen=True, eq=False)
class Judged:
    """A refitted candidate with every figure that the naming rule requires.

    `delta_bic` is its gain in BIC over the stage before it, `altogether` over the base without
    effects; `spared` the cost of its parameters by BIC minus that by Laplace's evidence, and
    `conceded` what keeping to usual ranges cost it, both in units of BIC; `predicts_worse` states
    whether its error on a held-out recording is clearly larger than the stage's; `predict` made the
    `prediction` of held-out data.
    """

    refit: Refit
    delta_bic: float
    altogether: float
    spared: float
    conceded: float
    explained: float
    numerics: float
    gain: Gain
    predicts_worse: bool
    prediction: Prediction
    predict: Predict
    plausible: bool

    @property
    def name(self) -> str:
        return self.refit.name

    @property
    def layer(self) -> Layer:
        return self.refit.layer

    @property
    def solved(self) -> Solved:
        return self.refit.solved

    @property
    def preparation(self) -> Preparation:
        return self.solved.preparation

    @property
    def evidence(self) -> float:
        """Its gain by Laplace's evidence, in units of BIC."""
        return self.delta_bic + self.spared

    @property
    def support(self) -> float:
        """The mean of its gains by BIC and by Laplace's evidence.

        Both approximate twice the logarithm of the same Bayes factor: BIC with a prior that is
        worth one sample for each parameter, Laplace's with the usual ranges as a prior.
        """
        return self.delta_bic + 0.5 * self.spared

    @property
    def admissible(self) -> bool:
        """Whether it may be named: its gain in BIC is 10 or more, significant on held-out data too,
        its parameters are plausible, and it is not a numerical artefact."""
        return (
            self.delta_bic >= DELTA_BIC
            and self.gain.convincing
            and not self.predicts_worse
            and self.plausible
            and self.is_exact
        )

    @property
    def predicts_a_recording(self) -> bool:
        """Whether it predicts a held-out recording significantly better, and about as accurately as
        the training recordings.

        Gains that are separate for each recording are estimated from the held-out one itself: an
        effect that has only such gains predicts nothing about it.
        """
        own, shapes = (of(self.solved.block) for of in (self.layer.own, self.layer.own_shapes))
        gains = [parameter for name, parameter in own.items() if name not in shapes]
        if self.predict is predict_stretches or (gains and all(p.per_recording for p in gains)):
            return False
        return self.gain.convincing and self.gain.agrees_with_training(self.solved.excess_ratio)

    @property
    def is_exact(self) -> bool:
        """Whether the simulation's error is far below the noise, or below the excess residual."""
        return self.numerics <= tolerated_error(LIMIT, self.solved, SMALL)


def best_of(candidates: Sequence[Judged]) -> Judged | None:
    """The admissible candidate with the most support.

    By BIC alone each of eight play operators costs as much as a well determined parameter, and a
    model of few parameters that fits and predicts worse would be named instead; by Laplace's
    evidence alone a model with poorly determined parameters would be named instead of one that has
    fewer and fits as well.
    If one model contains the other, the simpler one is named, unless the other gains a hundredth
    more: a hundredth of a large gain may be the difference between the effect and its model, which
    the further parameters absorb.
    """
    named = {j.name: j for j in candidates if j.admissible}
    best = max(named.values(), key=lambda j: j.support, default=None)
    if best is None or best.layer.effect.special_case not in named:
        return best
    simpler = named[best.layer.effect.special_case]
    return simpler if best.support - simpler.support < _ALIKE * best.altogether else best


def _ahead(j: Judged, winner: Judged) -> float:
    """How far another is ahead of the winner in BIC and in evidence: the smaller of both."""
    return min(j.delta_bic - winner.delta_bic, j.evidence - winner.evidence)


def margin_of(gain: float) -> float:
    """How far behind in BIC another fit must be to be excluded by one with this gain.

    25, which is five standard errors between the two signatures.  No model of the catalogue is
    exact: for a large gain it is a hundredth of it, which may be the difference between an effect
    and its model.
    """
    return max(APART, _ALIKE * gain)


def unusual_loss(gain: float) -> float:
    """How much of its gain a fit may lose by keeping to its usual ranges, before it counts as
    outside of them."""
    return max(DELTA_BIC, _UNUSUAL * gain)


def rivals_of(winner: Judged, candidates: Sequence[Judged]) -> list[Judged]:
    """The effects that fit as well as the winner or better, by BIC and by evidence, best first.

    A candidate outside its expected range, or contradicted by folds of held-out data, is not
    adopted, but if it fits better it remains a rival.  A candidate that fits less well, and only
    far from its range or against held-out data, mimics the winner and is no rival.  The cost of
    keeping to usual ranges does not exclude an effect, nor do poorly determined parameters, unless
    they are so many that they could follow any residual.  The number of its parameters does not
    exclude it either if it predicts held-out data better than the winner, since a model that merely
    follows a residual predicts worse.
    """
    margin = margin_of(winner.altogether)

    def comes_close(j: Judged) -> bool:
        mimics = not j.plausible and j.delta_bic <= winner.delta_bic
        possible = not (mimics or j.gain.refuted)
        spared = np.clip(j.spared - winner.spared, 0.0, DELTA_BIC)
        behind = min(j.delta_bic - winner.delta_bic + spared, j.evidence - winner.evidence)
        near = behind + j.conceded - winner.conceded > -margin
        predicts_better = j.predict is winner.predict and j.gain.fall > winner.gain.fall
        is_better = j.solved.cost < winner.solved.cost and predicts_better
        return j.is_exact and (_ahead(j, winner) > 0 or (possible and (near or is_better)))

    close = [j for j in candidates if j is not winner and comes_close(j)]
    return sorted(close, key=lambda j: -j.delta_bic)


def probability_of(winner: Judged, candidates: Sequence[Judged]) -> float:
    """The probability that the name is right: each rival has the weight exp(-ΔBIC/8), the name 1.

    With exact models it would be exp(-ΔBIC/2).  Since they are not exact, the evidence is tempered
    to a quarter, which maximises the likelihood of the 61 first names of a development exam.  In
    three earlier exams one in thirty names without a rival was wrong, hence the largest value 0.96.
    """
    behind = [max(0.0, -_ahead(j, winner)) for j in rivals_of(winner, candidates)]
    return SUREST / (1 + float(np.sum(np.exp(-np.array(behind) / _TEMPERED))))


def explained_fraction(base: Stage, solved: Solved) -> float:
    """The share of the base's excess residual that a fit explains, with the excess reduced by its
    uncertainty."""
    doubt = solved.samples * excess_doubt(solved)
    fall = base.solved.cost - solved.cost
    return float(fall / max(fall, base.excess - doubt)) if fall > 0 else 0.0


def residual_is_noise(base: Stage, stage: Stage) -> bool:
    """Whether the excess residual is smaller than the noise, within its uncertainty and within the
    difference between the effects and their models.

    If it is not, the best of the catalogue has absorbed most of an effect that is not in it.
    """
    return remaining_excess(stage) <= _INEXACT * max(0.0, base.excess / base.solved.samples)


def remaining_excess(stage: Stage) -> float:
    """χ² per sample of the residual minus that of the noise, of a share of the noise, and of the
    uncertainty of both."""
    doubt = excess_doubt(stage.solved)
    return stage.solved.cost / stage.solved.samples - 1 - _REMAINDER - doubt


def residual_has_pattern(base: Stage, stage: Stage, axes: Sequence[Axis]) -> bool:
    """Whether places still explain a share of the residual, compared with what the effects explain.

    Then the effects have followed another cause as far as they could.
    """
    fall = base.solved.cost - stage.solved.cost
    by_places = max((axis.excess for axis in axes), default=0.0)
    return by_places > _PATTERN * (by_places + fall)


def excess_doubt(solved: Solved, kurtosis: float | None = None) -> float:
    """Three standard errors of an excess χ² per sample, from the χ² distribution and the error of
    the noise level, for the residual's kurtosis or another one."""
    of_level = noise_doubt(solved.preparation, solved.kurtosis if kurtosis is None else kurtosis)
    return float(3 * np.sqrt(2 / solved.samples + of_level**2))


def least_share(base: Stage, stage: Stage) -> float:
    """The share of the base's excess below which no further effect is searched for.

    A residual below the noise, and far smaller than what was explained, may only be the difference
    between the adopted effect and its model.
    """
    imitated = any(not layer.effect.foreign for layer in stage.layers)
    return WORTH_NAMING if imitated and residual_is_noise(base, stage) else 0.0


def share_of_excess(base: Stage, before: Stage, winner: Judged) -> float:
    """The share of the base's excess residual that the winner explains in addition to the effects
    adopted before it."""
    return (before.solved.cost - winner.solved.cost) / max(base.excess, 1e-300)


def noise_doubt(preparation: Preparation, kurtosis: float) -> float:
    """The relative standard error of the noise's variance, the worst of all recordings."""
    return max(take.noise.doubt(kurtosis) for take in preparation.takes if take.noise is not None)


def freedom_of(preparation: Preparation, kurtosis: float) -> float:
    """The degrees of freedom of the noise level, for a residual of this kurtosis: a short rest may
    contain none of a heavy tail."""
    return 2 / max(noise_doubt(preparation, kurtosis), 1e-6) ** 2


def is_plausible(before: Solved, solved: Solved, layer: Layer) -> bool:
    """Whether the outermost effect's shapes lie within their expected ranges, and its gains so near
    to theirs that the difference costs little of the gain over the fit before.

    Gains are eliminated from the fit, and therefore unbounded: lost contact, for example, has one
    sign only, and a curve with the other sign is another effect.
    """
    own = layer.own_shapes(solved.block)
    if not all(parameter.is_plausible for parameter in own.values()):
        return False
    return strain(solved, layer) <= unusual_loss(before.cost - solved.cost)


def reason(
    score: EffectScore,
    judged: Judged | None,
    adopted: Sequence[str],
    p_value: float,
    numerics: float,
) -> str:
    """Why a candidate was adopted or rejected, in words; `numerics` is the base's discretisation
    error over the noise if it prevents refits, otherwise 0."""
    if p_value >= SIGNIFICANCE:
        return "the residual does not exceed the noise"
    if numerics > LIMIT:
        return f"not refitted: the discretisation error is {numerics:.2g} noise units"
    if judged is None:
        return "not refitted: other effects have more evidence in the residual"
    if judged.name in adopted:
        return "adopted: significantly better, also on held-out data"
    if not judged.is_exact:
        return f"rejected: its discretisation error is {judged.numerics:.2g} noise units"
    if judged.delta_bic < DELTA_BIC:
        return f"rejected: the refit gains only {judged.delta_bic:.3g} in BIC"
    if not judged.plausible:
        return "rejected: its refitted parameters lie outside their plausible range"
    if judged.predicts_worse:
        return "rejected: the held-out recording is predicted worse with it than without"
    if not judged.gain.convincing:
        return "rejected: the refit does not predict held-out data significantly better"
    return "has less evidence than the adopted effect"
