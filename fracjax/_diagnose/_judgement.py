"""What a refitted effect must show before it is given its name."""

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

SIGNIFICANCE, PLACES_ALONE = 0.01, 1e-4
DELTA_BIC = 10.0
EXPLAINED = 0.9
SMALL = 0.1
"""A numerical error counts little beside ten times that."""
WORTH_NAMING = 0.02
"""Beside single effects of a development exam nothing took more than .009 of the excess; of true
second ones the smallest that completed a fit took .034."""
_INEXACT = 0.05
APART, _ALIKE = 25.0, 0.01
_UNUSUAL = 0.01
_REMAINDER = 0.5
_PATTERN = 0.15
SUREST = 0.96
_TEMPERED = 8.0


@dataclass(frozen=True, eq=False)
class Judged:
    """A refitted candidate with everything the naming rule asks.

    `delta_bic` is what it gains over the stage before it, `altogether` over the base with nothing
    adopted; `spared`: how much less its numbers cost by Laplace's evidence than by BIC, and
    `conceded` what keeping to usual ranges cost it, both in BIC's units; `foretells_worse` where a
    recording held out is clearly further from it than from the stage; `predict` is what made the
    prediction, of whatever data held out can tell.
    """

    refit: Refit
    delta_bic: float
    altogether: float
    spared: float
    conceded: float
    explained: float
    numerics: float
    gain: Gain
    foretells_worse: bool
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
        """What it gains by Laplace's evidence, in BIC's units."""
        return self.delta_bic + self.spared

    @property
    def support(self) -> float:
        """The mean of what it gains by BIC and by Laplace's evidence.

        Both approach twice the logarithm of one Bayes factor: BIC as if one sample had told each
        number beforehand, Laplace's by usual ranges that are as wide as what is known in general.
        """
        return self.delta_bic + 0.5 * self.spared

    @property
    def admissible(self) -> bool:
        """Better beyond doubt, also on data held out, within its range, and not an artefact."""
        return (
            self.delta_bic >= DELTA_BIC
            and self.gain.convincing
            and not self.foretells_worse
            and self.plausible
            and self.is_exact
        )

    @property
    def foretells_a_recording(self) -> bool:
        """Whether a recording that was held out is beyond doubt better foretold with it, and about
        as well as the training is followed.

        Gains that begin anew have been read from that recording, and foretell nothing of it.
        """
        own, shapes = (of(self.solved.block) for of in (self.layer.own, self.layer.own_shapes))
        gains = [parameter for name, parameter in own.items() if name not in shapes]
        if self.predict is predict_stretches or (gains and all(p.per_recording for p in gains)):
            return False
        return self.gain.convincing and self.gain.foretells(self.solved.excess_ratio)

    @property
    def is_exact(self) -> bool:
        """Whether the simulation's own error is far under the noise, or what is left beyond it."""
        return self.numerics <= tolerated_error(LIMIT, self.solved, SMALL)


def best_of(found: Sequence[Judged]) -> Judged | None:
    """The admissible candidate with the most support.

    By BIC alone each of eight plays costs as much as a number that the data know well, and a law of
    few numbers that fits and foretells less would take its name; by the evidence alone a law whose
    numbers the data hardly know takes the name of one that has fewer and fits as well.
    Of two laws of which one contains the other the simpler keeps its name, unless the other gains a
    hundredth more: of a large gain so much may be how the effect's own law differs from ours, and
    the further numbers follow that.
    """
    named = {j.name: j for j in found if j.admissible}
    best = max(named.values(), key=lambda j: j.support, default=None)
    if best is None or best.layer.effect.special_case not in named:
        return best
    simpler = named[best.layer.effect.special_case]
    return simpler if best.support - simpler.support < _ALIKE * best.altogether else best


def _ahead(j: Judged, winner: Judged) -> float:
    """How far another is ahead of the winner in BIC and in evidence: the lesser of both."""
    return min(j.delta_bic - winner.delta_bic, j.evidence - winner.evidence)


def margin_of(gain: float) -> float:
    """How far behind in BIC another fit must be to be excluded by one that gains so much.

    25, which is five standard errors between the two signatures.  No law of the catalogue is exact:
    of a large gain a hundredth, within which the difference may be that of the effect's own law
    from ours, or of one that was adopted before it.
    """
    return max(APART, _ALIKE * gain)


def unusual_loss(gain: float) -> float:
    """How much of its gain a fit may lose by keeping to its usual ranges before these count against
    it."""
    return max(DELTA_BIC, _UNUSUAL * gain)


def rivals_of(winner: Judged, found: Sequence[Judged]) -> list[Judged]:
    """The effects that fit as well as the winner or better, by BIC and by evidence, best first.

    One outside its expected range is not adopted, nor one that folds of held-out data speak
    against; yet what fits better is not excluded by either.  What fits less well, and only far from
    its range or against data held out, mimics the winner.  An effect is not excluded by what its
    usual ranges cost it, nor by numbers that the data hardly know, unless they are so many that any
    residual would be followed; nor by the count of its numbers where it foretells data held out
    better than the winner does, for what merely follows a residual foretells worse.
    """
    margin = margin_of(winner.altogether)

    def comes_close(j: Judged) -> bool:
        mimics = not j.plausible and j.delta_bic <= winner.delta_bic
        possible = not (mimics or j.gain.refuted)
        spared = np.clip(j.spared - winner.spared, 0.0, DELTA_BIC)
        behind = min(j.delta_bic - winner.delta_bic + spared, j.evidence - winner.evidence)
        near = behind + j.conceded - winner.conceded > -margin
        foretells_better = j.predict is winner.predict and j.gain.fall > winner.gain.fall
        fits_better = j.solved.cost < winner.solved.cost and foretells_better
        return j.is_exact and (_ahead(j, winner) > 0 or (possible and (near or fits_better)))

    close = [j for j in found if j is not winner and comes_close(j)]
    return sorted(close, key=lambda j: -j.delta_bic)


def probability_of(winner: Judged, found: Sequence[Judged]) -> float:
    """How often such a name is right: each rival weighs exp(-ΔBIC/8) beside it.

    With exact laws it would be exp(-ΔBIC/2); as they are not, the evidence is tempered to a quarter
    of that, by which 61 first names of an exam made for development are the most probable.  In
    three before it one effect in thirty that had no rival was another.
    """
    behind = [max(0.0, -_ahead(j, winner)) for j in rivals_of(winner, found)]
    return SUREST / (1 + float(np.sum(np.exp(-np.array(behind) / _TEMPERED))))


def explained_fraction(base: Stage, solved: Solved) -> float:
    """The share of the base's excess residual that is gone, as far as that is known."""
    doubt = solved.samples * excess_doubt(solved)
    fall = base.solved.cost - solved.cost
    return float(fall / max(fall, base.excess - doubt)) if fall > 0 else 0.0


def is_exhausted(base: Stage, stage: Stage) -> bool:
    """Whether what is left over is smaller than the noise, as far as that is known, but for what
    the effects' own laws may differ from ours.

    Where it is not, the best of the catalogue has taken up most of something that is not in it.
    """
    return leftover(stage) <= _INEXACT * max(0.0, base.excess / base.solved.samples)


def leftover(stage: Stage) -> float:
    """χ² per sample that is left over beyond the noise and a share of it, as far as that is
    known."""
    doubt = excess_doubt(stage.solved)
    return stage.solved.cost / stage.solved.samples - 1 - _REMAINDER - doubt


def leaves_a_pattern(base: Stage, stage: Stage, axes: Sequence[Axis]) -> bool:
    """Whether places still take from the residual a share of what the effects have taken.

    Then the effects have followed something else as far as they could.
    """
    fall = base.solved.cost - stage.solved.cost
    left = max((axis.excess for axis in axes), default=0.0)
    return left > _PATTERN * (left + fall)


def excess_doubt(solved: Solved, kurtosis: float | None = None) -> float:
    """Three standard errors of an excess χ² per sample, by the χ² distribution and by the noise
    level's own error; its tails those of what the fit leaves, where no other kurtosis is given."""
    known = noise_doubt(solved.preparation, solved.kurtosis if kurtosis is None else kurtosis)
    return float(3 * np.sqrt(2 / solved.samples + known**2))


def least_share(base: Stage, stage: Stage) -> float:
    """The share of the base's excess below which a further effect is not looked for.

    A remainder under the noise, and far smaller than what was explained, may be no more than the
    adopted effect's own law being another than ours.
    """
    imitated = any(not layer.effect.foreign for layer in stage.layers)
    return WORTH_NAMING if imitated and is_exhausted(base, stage) else 0.0


def share_of_excess(base: Stage, before: Stage, winner: Judged) -> float:
    """The share of the base's excess residual that the winner takes away beyond what was adopted
    before it."""
    return (before.solved.cost - winner.solved.cost) / max(base.excess, 1e-300)


def noise_doubt(preparation: Preparation, kurtosis: float) -> float:
    """The relative standard error of the noise's variance, the worst of all recordings."""
    return max(take.noise.doubt(kurtosis) for take in preparation.takes if take.noise is not None)


def freedom_of(preparation: Preparation, kurtosis: float) -> float:
    """The degrees of freedom behind the noise level, for a residual of this kurtosis: a short rest
    may hold none of a heavy tail."""
    return 2 / max(noise_doubt(preparation, kurtosis), 1e-6) ** 2


def is_plausible(before: Solved, solved: Solved, layer: Layer) -> bool:
    """Whether the outermost effect's shapes ended within their expected ranges, and its gains as
    near to theirs as makes little of what it gains on the fit before.

    Gains are eliminated, and end where the data have them: a contact that is lost has one sign, and
    a bend of the other is another law.
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
    """Why a candidate was kept or rejected, in words; `numerics` is the base's error where that
    forbids refits."""
    if p_value >= SIGNIFICANCE:
        return "nothing in the residual beyond noise"
    if numerics > LIMIT:
        return f"not refitted: the discretisation error is {numerics:.2g} noise units"
    if judged is None:
        return "not refitted: other effects have more evidence in the residual"
    if judged.name in adopted:
        return "adopted: better beyond doubt, also on data held out"
    if not judged.is_exact:
        return f"rejected: its discretisation error is {judged.numerics:.2g} noise units"
    if judged.delta_bic < DELTA_BIC:
        return f"rejected: the refit gains only {judged.delta_bic:.3g} in BIC"
    if not judged.plausible:
        return "rejected: its refitted parameters lie outside their plausible range"
    if judged.foretells_worse:
        return "rejected: the recording held out is foretold worse with it than without"
    if not judged.gain.convincing:
        return "rejected: the refit does not predict held-out data better beyond doubt"
    return "has less evidence than the adopted effect"
