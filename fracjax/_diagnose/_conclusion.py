"""What a course of rounds amounts to: the verdict, and all that supports it."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from .._blocks import EFFECTS
from .._fit import Estimate, Fit, fit_of, with_profiled_intervals
from .._models import Model
from .._prepare import (
    Noise,
    Take,
)
from .._solve import Progress
from ._codes import seen_in_codes
from ._curve import Curve, find_curve
from ._held_out import (
    Predict,
    Prediction,
    foretells_worse,
    gain,
)
from ._judgement import (
    APART,
    EXPLAINED,
    PLACES_ALONE,
    SIGNIFICANCE,
    Judged,
    excess_doubt,
    explained_fraction,
    freedom_of,
    is_exhausted,
    leaves_a_pattern,
    leftover,
    probability_of,
    reason,
    rivals_of,
)
from ._jumps import Jumps, find_jumps, hidden_in_noise
from ._locate import acting_at, frequency, locate
from ._next_experiment import Limits, propose
from ._procedure import Course, Round
from ._residual import beside_fit, errors_of, residual_of
from ._result import (
    Axis,
    Candidate,
    Diagnosis,
    HeldOut,
    NamedEffect,
    NextExperiment,
    Verdict,
)
from ._score import EffectScore
from ._sentence import next_experiment, sentence_of, where_of
from ._stage import Stage, path_of
from ._warnings import warnings_of

_MOST_RIVALS = 4
_WORTH_FITTING = 0.5
_NORMAL = 3.0
_CLEARLY = 0.4


class Conclusion:
    """What a course of rounds amounts to."""

    def __init__(
        self,
        model: Model,
        base: Stage,
        numerics: float,
        unseen: Take | None,
        predict: Predict,
        course: Course,
    ):
        self.model, self.base, self.numerics = model, base, numerics
        self.unseen, self.predict, self.course = unseen, predict, course
        noise = base.preparation.takes[0].noise
        assert noise is not None  # settle() leaves none unknown
        self.noise: Noise = noise

    @property
    def stage(self) -> Stage:
        """What was adopted; the base alone, where effects have only followed what is no law."""
        return self.course.stage if self.lawless is None else self.base

    @property
    def rounds(self) -> list[Round]:
        return self.course.rounds if self.lawless is None else []

    def diagnosis(self, limits: Limits, progress: Progress) -> Diagnosis:
        """The verdict and everything that supports it."""
        progress("writing the verdict")
        stage = self.stage
        base_fit = fit_of(self.model, self.base.solved)
        extended = self._extended(progress) if self.rounds else None
        coded = seen_in_codes(self.base, stage)
        effects = (*self._effects(extended), *((coded,) if coded else ()))
        verdict = self._verdict(effects)
        candidates = self._candidates({e.name for e in effects})
        axes, held_out = self._axes(effects), self.held_out
        return Diagnosis(
            verdict=verdict,
            sentence=sentence_of(
                verdict=verdict,
                effects=effects,
                adopted=stage.adopted,
                candidates=candidates,
                axes=axes,
                base=base_fit,
                noise=self.noise,
                held_out=held_out,
                too_small=self.course.too_small,
                free_form=self.lawless and self.lawless.sentence,
                in_the_noise=self._in_the_noise,
                exceeds_the_noise=self.exceeds_the_noise,
            ),
            base=base_fit,
            extended=extended,
            effects=effects,
            candidates=candidates,
            axes=axes,
            where=where_of(axes, verdict, stage.adopted if effects else (), self._left),
            noise=self.noise,
            numerics=self.numerics,
            p_value=self._p_value(effects),
            held_out=held_out,
            next_experiment=self._next_experiment(verdict, limits, progress),
            warnings=warnings_of(self.base, self.stage, self.noise, self.numerics, self.hidden),
        )

    def _verdict(self, effects: tuple[NamedEffect, ...]) -> Verdict:
        if effects:
            return "confusable" if any(e.confusable_with for e in effects) else "missing"
        if self.lawless is not None:
            return "unexplained"
        # Where no effect gains anything, places alone must be surer: a noise level that was read
        # from few samples with heavy tails is off by more than it says.
        limit = SIGNIFICANCE if self.course.gains else PLACES_ALONE
        return "none" if self.course.first.p_value >= limit else "unexplained"

    @property
    def exceeds_the_noise(self) -> bool:
        """Whether the base clearly leaves more than noise whose tails are those that the noise
        itself has shown.

        A burst does, which the tests take for a tail of the residual that it is in.
        """
        solved = self.base.solved
        doubt = excess_doubt(solved, _NORMAL)
        return self.base.excess > solved.samples * max(doubt, _CLEARLY)

    @property
    def _left(self) -> list[tuple[str, float]]:
        """What the base leaves in each recording, by its name, in its noise floors, rms."""
        left = []
        takes, simulations = self.base.preparation.takes, self.base.solved.simulations
        for take, simulation in zip(takes, simulations, strict=True):
            assert take.noise is not None  # a diagnosis has one
            error = (take.recording.response - simulation)[take.used]
            left.append((take.recording.source, float(error.std()) / take.noise.sigma))
        return left

    def _p_value(self, effects: tuple[NamedEffect, ...]) -> float:
        """The first test's, or that of jumps which it took for the noise's tails."""
        first = self.course.first
        found = first.least if effects else first.p_value
        return found if self.jumps is None else min(found, self.jumps.p_value(self.base))

    @property
    def lawless(self) -> Jumps | Curve | None:
        """What describes the mismatch without a law, and better than any law."""
        return self.jumps or self.curve

    @cached_property
    def jumps(self) -> Jumps | None:
        """Jumps, if they tell enough, and more than the effects that were adopted or may have been.

        Jumps foretell no other recording: what the effects have foretold is none.  They exclude an
        effect as another effect would: one step comes near a slow law that is hardly seen.
        """
        base, stage = self.base, self.course.stage
        if self.course.first.least >= SIGNIFICANCE and not self.exceeds_the_noise:
            return None
        if any(round_.winner.foretells_a_recording for round_ in self.course.rounds[-1:]):
            return None
        gained = base.solved.bic - stage.solved.bic
        jumps = find_jumps(base, _WORTH_FITTING * max(gained, base.excess))
        if jumps is None or explained_fraction(base, jumps.solved) < EXPLAINED:
            return None
        others = [stage.solved, *(j.solved for j in self.course.opening if j.admissible)]
        return jumps if min(map(jumps.ahead_of, others)) >= APART else None

    @cached_property
    def curve(self) -> Curve | None:
        """A static curve, if it tells enough, and clearly more than any effect that was adopted or
        may have been."""
        base, stage = self.base, self.course.stage
        if self.course.first.least >= SIGNIFICANCE or not self.course.is_real:
            return None
        fall = max(base.solved.cost - stage.solved.cost, base.excess)
        curve = find_curve(base, _WORTH_FITTING * fall)
        if curve is None or explained_fraction(base, curve.solved) < EXPLAINED:
            return None
        others = [
            base.solved,
            stage.solved,
            *(j.solved for j in self.course.opening if j.admissible),
        ]
        gained = base.solved.bic - stage.solved.bic
        if not all(curve.is_ahead_of(other, gained) for other in others):
            return None
        foretold = self.predict(stage.solved)
        by_curve = self.predict(curve.solved)
        return None if foretells_worse(self.predict, foretold, by_curve) else curve

    def _extended(self, progress: Progress) -> Fit:
        """The fit with what was adopted, and the intervals of what is named."""
        stage = self.stage
        fit = fit_of(Model(stage.solved.block, stage.name), stage.solved)
        if not self.is_explained:
            return fit
        paths = tuple(path_of(stage.layers, k) for k in range(len(self.rounds)))
        own = [e.name for e in fit.estimates if e.name.startswith(paths)]
        progress(f"finding the intervals of {len(own)} parameters")
        return with_profiled_intervals(fit, own)

    @cached_property
    def is_explained(self) -> bool:
        """Whether what was adopted explains the mismatch."""
        stage = self.stage
        return (
            explained_fraction(self.base, stage.solved) >= EXPLAINED
            and is_exhausted(self.base, stage)
            and not leaves_a_pattern(self.base, stage, self.course.last.axes)
            # However well it fits, it has followed something else.
            and not foretells_worse(self.predict, *self._predicted)
            and not self._stands_in
        )

    @property
    def _stands_in(self) -> bool:
        """Whether several effects leave more than noise, and are much further from a recording held
        out than from the training.

        The law of one may differ from ours, and need not reach as far; laws of the catalogue that
        are stacked without coming down to the noise stand in for one that is not in it.  That their
        many numbers are open is no excuse.
        """
        stage = self.stage
        if self.unseen is None or len(stage.layers) < 2 or leftover(stage) <= 0:
            return False
        return not self._predicted[1].is_as_good_as(stage.solved.excess_ratio)

    def _effects(self, extended: Fit | None) -> tuple[NamedEffect, ...]:
        """The adopted effects, if together they explain the mismatch."""
        if extended is None or not self.is_explained:
            return ()
        return tuple(
            self._named(round_, self._own_parameters(k, extended))
            for k, round_ in enumerate(self.rounds)
        )

    def _named(self, round_: Round, own: tuple[Estimate, ...]) -> NamedEffect:
        winner = round_.winner
        return NamedEffect(
            name=winner.name,
            site=winner.layer.site,
            probability=probability_of(winner, round_.found),
            explained_fraction=float(np.clip(winner.explained, 0.0, 1.0)),
            parameters=own,
            confusable_with=tuple(
                j.name for j in rivals_of(winner, round_.found) if j.name not in self.stage.adopted
            ),
        )

    def _own_parameters(self, k: int, extended: Fit) -> tuple[Estimate, ...]:
        """The estimates that came with the k-th effect, by its own names."""
        path = path_of(self.stage.layers, k)
        own = [e for e in extended.estimates if e.name.startswith(path)]
        return tuple(replace(e, name=e.name.removeprefix(path)) for e in own)

    def _candidates(self, named: Collection[str]) -> tuple[Candidate, ...]:
        """Every effect of the catalogue, by the evidence for it: those that were refitted first."""
        scores, judged = self.course.first.scores, self.course.judged
        found = [self._candidate(s, judged.get(s.effect.name), named) for s in scores]
        return tuple(
            sorted(found, key=lambda c: (c.delta_bic is not None, c.log_evidence), reverse=True)
        )

    def _candidate(
        self, score: EffectScore, judged: Judged | None, named: Collection[str]
    ) -> Candidate:
        adopted, p_value = self.stage.adopted, self.course.first.p_value
        forbidding = 0.0 if self.course.is_real else self.numerics
        why = reason(score, judged, adopted, p_value, forbidding)
        if score.effect.name in named and score.effect.name not in adopted:
            why = "named: the response lies on a grid whose steps are as large as the noise"
        if self.lawless is not None and judged is not None and judged.admissible:
            told = "jumps of the response tell" if self.jumps else "a static curve tells"
            why = f"rejected: {told} more"
        return Candidate(
            name=score.effect.name,
            site=score.effect.site,
            score=score.height,
            log_evidence=score.log_evidence if judged is None else 0.5 * judged.support,
            detectable_amplitude=score.detectable_amplitude,
            concealment=float(np.clip(score.concealments[score.best], 0.0, 1.0)),
            reason=why,
            delta_bic=None if judged is None else judged.delta_bic,
            explained_fraction=None if judged is None else judged.explained,
            held_out_gain=None if judged is None else judged.gain.share_of_rmse,
        )

    def _axes(self, effects: tuple[NamedEffect, ...]) -> tuple[Axis, ...]:
        """The axes, those first along which the named effect's signature is known to stand out,
        then those whose places take most of the residual."""
        leading = [round_.winner.name for round_ in self.rounds] + [e.name for e in effects]
        natural = EFFECTS[leading[0]].axes if leading else ()

        def order(axis: Axis) -> tuple[bool, int, float, float]:
            silent = axis.p_value >= SIGNIFICANCE
            # What is seen in the codes alone has no place in the residual.
            known = axis.axis in natural and not (silent and self.rounds)
            place = natural.index(axis.axis) if known else len(natural)
            return silent and not known, place, -axis.excess, axis.p_value

        axes = self.course.first.axes
        if natural == ("frequency",):
            # Of lines that it was read with, the floor hides the place.
            axes = [self._frequency() if a.axis == "frequency" else a for a in axes]
        axes = sorted(axes, key=order)
        return tuple(self._placed(axes, natural) if effects and self.rounds else axes)

    def _placed(self, axes: list[Axis], natural: Sequence[str]) -> list[Axis]:
        """The axes, of which the named effect's own says where that acts, if no place of it stands
        out by itself; and comes first, where none of them does."""
        own = next((axis for name in natural for axis in axes if axis.axis == name), None)
        if own is None or own.intervals:
            return axes
        base, stage = self.base, self.stage
        before, after = (errors_of(s.solved)[1] for s in (base, stage))
        change = beside_fit(before - after, base.solved)
        freedom = freedom_of(base.preparation, base.solved.kurtosis)
        maps = locate(base.preparation, base.preparation.problems(), change, freedom)
        acting = acting_at(own, maps)
        if axes[0].axis in natural:
            return [acting if axis is own else axis for axis in axes]
        return [acting, *(axis for axis in axes if axis is not own)]

    def _frequency(self) -> Axis:
        """The axis of frequency, the lines that the noise was read with taken for mismatch."""
        solved, preparation = self.base.solved, self.base.preparation
        bare = preparation.with_noises(
            [t.noise.without_lines() for t in preparation.takes if t.noise]
        )
        freedom = freedom_of(preparation, solved.kurtosis)
        problems = preparation.problems()
        return frequency(bare, problems, residual_of(solved), freedom)

    @cached_property
    def _predicted(self) -> tuple[Prediction, Prediction]:
        """What the base and what was adopted make of data held out."""
        base, stage = self.base, self.stage
        before = self.predict(base.solved)
        return before, self.predict(stage.solved) if self.rounds else before

    @property
    def held_out(self) -> HeldOut:
        """The scores on data held out."""
        take, (base, extended) = self.unseen, self._predicted
        source = "" if take is None else take.recording.source
        method = "stretches set aside in turn" if take is None else "recording"
        if not self.rounds:
            return HeldOut(method, base.rmse, None, base.folds, (), source)
        found = gain(base, extended)
        if take is not None or not any(found.foretold):
            return HeldOut(method, base.rmse, extended.rmse, base.folds, extended.folds, source)
        # A stretch that the others do not foretell says nothing of either model.
        before, after = (
            tuple(itertools.compress(prediction.folds, found.foretold))
            for prediction in (base, extended)
        )
        return HeldOut(method, found.base_rmse, found.extended_rmse, before, after, source)

    def _next_experiment(
        self, verdict: Verdict, limits: Limits, progress: Progress
    ) -> NextExperiment | None:
        """The drive that tells apart what this recording cannot: the look-alikes of an effect, or
        the best guesses where none explains the mismatch."""
        if verdict == "confusable":
            sets = [[r.winner, *rivals_of(r.winner, r.found)] for r in self.rounds]
            rivals = max(sets, key=len)
        elif verdict == "unexplained" and self.lawless is None:
            rivals = sorted(self.course.judged.values(), key=lambda j: -j.delta_bic)
        else:
            return None
        rivals = rivals[:_MOST_RIVALS]
        if len(rivals) < 2:
            return None
        blocks = [j.solved.block for j in rivals]
        proposal = propose(blocks, rivals[0].preparation, limits, progress)
        return next_experiment([j.name for j in rivals], proposal)

    @cached_property
    def hidden(self) -> list[tuple[str, str]]:
        """Jumps that count as noise, for what repeats does not have them: whose they are, and in
        words."""
        # Beside a mismatch steps would follow that.
        if self.lawless is not None or self.course.gains:
            return []
        told = []
        for k, take in enumerate(self.base.preparation.takes):
            hidden = hidden_in_noise(self.base, k)
            if hidden is not None:
                jumps, beside = hidden
                words = (
                    f"the noise floor holds what looks like {jumps.listed}; beside them the noise "
                    f"is {beside.sigma:.3g} {beside.unit}. They count as noise and hide what is "
                    "smaller; leave out the time that they spoil (--mask), or record the same "
                    "drive again."
                )
                told.append((take.recording.source, words))
        return told

    @property
    def _in_the_noise(self) -> str | None:
        """What the sentence says of them: of the first recording that has any."""
        if not self.hidden:
            return None
        source, words = self.hidden[0]
        return f"in {source} {words}" if len(self.base.preparation.takes) > 1 else words
