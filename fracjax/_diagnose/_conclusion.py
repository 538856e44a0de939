"""The conclusion of a diagnosis: the verdict, and everything that supports it."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from .._blocks import EFFECTS
from .._fit import Estimate, Fit, fit_of, with_profiled_intervals
from .._models import Model
from .._prepare import Noise, Take
from .._solve import Progress
from ._codes import detected_in_codes
from ._curve import Curve, find_curve
from ._held_out import (
    Predict,
    Prediction,
    gain,
    predicts_worse,
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
    probability_of,
    reason,
    remaining_excess,
    residual_has_pattern,
    residual_is_noise,
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
"""Effects that a next experiment should distinguish at most; chosen by judgement."""
_WORTH_FITTING = 0.5
"""Share of the gain of the effects that jumps or a curve must promise to be fitted; chosen by
judgement."""
_NORMAL = 3.0
"""Kurtosis of normal noise."""
_CLEARLY = 0.4
"""Excess χ² per sample from which the residual clearly exceeds the noise; chosen by judgement."""


class Conclusion:
    """The conclusion from a course of rounds."""

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
        assert noise is not None  # settle() estimates every noise
        self.noise: Noise = noise

    @property
    def stage(self) -> Stage:
        """The adopted stage; the base alone, if jumps or a curve explain the mismatch better."""
        return self.course.stage if self.empirical is None else self.base

    @property
    def rounds(self) -> list[Round]:
        """The rounds of the adopted effects; none, if jumps or a curve explain it better."""
        return self.course.rounds if self.empirical is None else []

    def diagnosis(self, limits: Limits, progress: Progress) -> Diagnosis:
        """The verdict and everything that supports it."""
        progress("writing the verdict")
        stage = self.stage
        base_fit = fit_of(self.model, self.base.solved)
        extended = self._extended(progress) if self.rounds else None
        coded = detected_in_codes(self.base, stage)
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
                empirical=self.empirical and self.empirical.sentence,
                in_the_noise=self._in_the_noise,
                exceeds_the_noise=self.exceeds_the_noise,
            ),
            base=base_fit,
            extended=extended,
            effects=effects,
            candidates=candidates,
            axes=axes,
            where=where_of(axes, verdict, stage.adopted if effects else (), self._residual_ratios),
            noise=self.noise,
            numerics=self.numerics,
            p_value=self._p_value(effects),
            held_out=held_out,
            next_experiment=self._next_experiment(verdict, limits, progress),
            warnings=warnings_of(self.base, self.stage, self.noise, self.numerics, self.hidden),
        )

    def _verdict(self, effects: tuple[NamedEffect, ...]) -> Verdict:
        """The verdict, from the named effects and the significance of the residual."""
        if effects:
            return "confusable" if any(e.confusable_with for e in effects) else "missing"
        if self.empirical is not None:
            return "unexplained"
        # If no effect improves the fit, the places must be more significant: the error of a noise
        # level that was estimated from few samples with heavy tails is larger than estimated.
        limit = SIGNIFICANCE if self.course.gains else PLACES_ALONE
        return "none" if self.course.first.p_value >= limit else "unexplained"

    @property
    def exceeds_the_noise(self) -> bool:
        """Whether the base's residual clearly exceeds noise with normal tails.

        A burst does, which the tests would count as a heavy tail of the residual that contains it.
        """
        solved = self.base.solved
        doubt = excess_doubt(solved, _NORMAL)
        return self.base.excess > solved.samples * max(doubt, _CLEARLY)

    @property
    def _residual_ratios(self) -> list[tuple[str, float]]:
        """The name of each recording, and the rms of the base's residual over its noise level."""
        ratios = []
        takes, simulations = self.base.preparation.takes, self.base.solved.simulations
        for take, simulation in zip(takes, simulations, strict=True):
            assert take.noise is not None  # a diagnosis has one
            error = (take.recording.response - simulation)[take.used]
            ratios.append((take.recording.source, float(error.std()) / take.noise.sigma))
        return ratios

    def _p_value(self, effects: tuple[NamedEffect, ...]) -> float:
        """The p-value of the first test, or that of jumps, which the test may count as tails."""
        first = self.course.first
        p_value = first.least if effects else first.p_value
        return p_value if self.jumps is None else min(p_value, self.jumps.p_value(self.base))

    @property
    def empirical(self) -> Jumps | Curve | None:
        """Jumps or a curve that describe the mismatch better than any effect of the catalogue."""
        return self.jumps or self.curve

    @cached_property
    def jumps(self) -> Jumps | None:
        """Jumps, if they explain enough, and more than the effects that were adopted or could be.

        Jumps predict no other recording: a mismatch that effects have predicted in one is no jump.
        They must exclude an effect as another effect would, since a step resembles a slow effect
        that is hardly significant.
        """
        base, stage = self.base, self.course.stage
        if self.course.first.least >= SIGNIFICANCE and not self.exceeds_the_noise:
            return None
        if any(round_.winner.predicts_a_recording for round_ in self.course.rounds[-1:]):
            return None
        gained = base.solved.bic - stage.solved.bic
        jumps = find_jumps(base, _WORTH_FITTING * max(gained, base.excess))
        if jumps is None or explained_fraction(base, jumps.solved) < EXPLAINED:
            return None
        others = [stage.solved, *(j.solved for j in self.course.opening if j.admissible)]
        return jumps if min(map(jumps.ahead_of, others)) >= APART else None

    @cached_property
    def curve(self) -> Curve | None:
        """A static curve, if it explains enough, and clearly more than any effect that was adopted
        or could be."""
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
        by_stage = self.predict(stage.solved)
        by_curve = self.predict(curve.solved)
        return None if predicts_worse(self.predict, by_stage, by_curve) else curve

    def _extended(self, progress: Progress) -> Fit:
        """The fit with the adopted effects, with profiled intervals if they are named."""
        stage = self.stage
        fit = fit_of(Model(stage.solved.block, stage.name), stage.solved)
        if not self.is_explained:
            return fit
        paths = tuple(path_of(stage.layers, k) for k in range(len(self.rounds)))
        own = [e.path for e in fit.estimates if e.path.startswith(paths)]
        progress(f"computing the intervals of {len(own)} parameters")
        return with_profiled_intervals(fit, own)

    @cached_property
    def is_explained(self) -> bool:
        """Whether the adopted effects explain the mismatch."""
        stage = self.stage
        return (
            explained_fraction(self.base, stage.solved) >= EXPLAINED
            and residual_is_noise(self.base, stage)
            and not residual_has_pattern(self.base, stage, self.course.last.axes)
            # However well it fits, a worse prediction shows that it has followed another cause.
            and not predicts_worse(self.predict, *self._predicted)
            and not self._stands_in
        )

    @property
    def _stands_in(self) -> bool:
        """Whether several effects have a residual above the noise, and a much larger error on a
        held-out recording than on the training recordings.

        A single effect may differ from its model and need not be that accurate.  Several models of
        the catalogue whose residual still exceeds the noise compensate for an effect that is not in
        it.  The uncertainty of their many parameters does not excuse them.
        """
        stage = self.stage
        if self.unseen is None or len(stage.layers) < 2 or remaining_excess(stage) <= 0:
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
        """The named effect of one round, with its estimates and its rivals."""
        winner = round_.winner
        return NamedEffect(
            name=winner.name,
            site=winner.layer.site,
            probability=probability_of(winner, round_.candidates),
            explained_fraction=float(np.clip(winner.explained, 0.0, 1.0)),
            parameters=own,
            confusable_with=tuple(
                rival.name
                for rival in rivals_of(winner, round_.candidates)
                if rival.name not in self.stage.adopted
            ),
        )

    def _own_parameters(self, k: int, extended: Fit) -> tuple[Estimate, ...]:
        """The estimates of the k-th effect's parameters, by their names in its own block."""
        path = path_of(self.stage.layers, k)
        own = [e for e in extended.estimates if e.path.startswith(path)]
        return tuple(replace(e, name=e.path.removeprefix(path)) for e in own)

    def _candidates(self, named: Collection[str]) -> tuple[Candidate, ...]:
        """Every effect of the catalogue: first those that were refitted, ordered by evidence."""
        scores, judged = self.course.first.scores, self.course.judged
        candidates = [self._candidate(s, judged.get(s.effect.name), named) for s in scores]
        return tuple(
            sorted(
                candidates, key=lambda c: (c.delta_bic is not None, c.log_evidence), reverse=True
            )
        )

    def _candidate(
        self, score: EffectScore, judged: Judged | None, named: Collection[str]
    ) -> Candidate:
        """One effect of the catalogue, with its score and, if it was refitted, its judgement."""
        adopted, p_value = self.stage.adopted, self.course.first.p_value
        forbidding = 0.0 if self.course.is_real else self.numerics
        why = reason(score, judged, adopted, p_value, forbidding)
        if score.effect.name in named and score.effect.name not in adopted:
            why = "named: the response lies on a grid whose steps are as large as the noise"
        if self.empirical is not None and judged is not None and judged.admissible:
            better = "jumps of the response explain" if self.jumps else "a static curve explains"
            why = f"rejected: {better} more"
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
        """The axes: first those along which the named effect's signature stands out by the
        catalogue, then those whose places explain most of the residual."""
        leading = [round_.winner.name for round_ in self.rounds] + [e.name for e in effects]
        natural = EFFECTS[leading[0]].axes if leading else ()

        def order(axis: Axis) -> tuple[bool, int, float, float]:
            silent = axis.p_value >= SIGNIFICANCE
            # An effect that only the codes show has no place in the residual.
            leads = axis.axis in natural and not (silent and self.rounds)
            place = natural.index(axis.axis) if leads else len(natural)
            return silent and not leads, place, -axis.excess, axis.p_value

        axes = self.course.first.axes
        if natural == ("frequency",):
            # A noise floor that contains spectral lines hides their place.
            axes = [self._frequency() if a.axis == "frequency" else a for a in axes]
        axes = sorted(axes, key=order)
        return tuple(self._placed(axes, natural) if effects and self.rounds else axes)

    def _placed(self, axes: list[Axis], natural: Sequence[str]) -> list[Axis]:
        """The axes, with the places where the named effect acts on its own axis, if no place stands
        out there; that axis comes first if no axis of the effect does."""
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
        """The axis of frequency, with the spectral lines in the noise counted as mismatch."""
        solved, preparation = self.base.solved, self.base.preparation
        bare = preparation.with_noises(
            [t.noise.without_lines() for t in preparation.takes if t.noise]
        )
        freedom = freedom_of(preparation, solved.kurtosis)
        problems = preparation.problems()
        return frequency(bare, problems, residual_of(solved), freedom)

    @cached_property
    def _predicted(self) -> tuple[Prediction, Prediction]:
        """The predictions of held-out data by the base and by the adopted stage."""
        base, stage = self.base, self.stage
        before = self.predict(base.solved)
        return before, self.predict(stage.solved) if self.rounds else before

    @property
    def held_out(self) -> HeldOut:
        """The scores on held-out data."""
        take, (base, extended) = self.unseen, self._predicted
        source = "" if take is None else take.recording.source
        method = "stretches set aside in turn" if take is None else "recording"
        if not self.rounds:
            return HeldOut(method, base.rmse, None, base.folds, (), source)
        gained = gain(base, extended)
        if take is not None or not any(gained.predicted_folds):
            return HeldOut(method, base.rmse, extended.rmse, base.folds, extended.folds, source)
        # A stretch that the others do not predict is no evidence about either model.
        before, after = (
            tuple(itertools.compress(prediction.folds, gained.predicted_folds))
            for prediction in (base, extended)
        )
        return HeldOut(method, gained.base_rmse, gained.extended_rmse, before, after, source)

    def _next_experiment(
        self, verdict: Verdict, limits: Limits, progress: Progress
    ) -> NextExperiment | None:
        """The drive that distinguishes what this recording cannot: the look-alikes of an effect, or
        the best candidates if none explains the mismatch."""
        if verdict == "confusable":
            sets = [[r.winner, *rivals_of(r.winner, r.candidates)] for r in self.rounds]
            rivals = max(sets, key=len)
        elif verdict == "unexplained" and self.empirical is None:
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
        """Jumps that count as noise, since they do not repeat: the name of the recording, and a
        sentence."""
        # If there is a mismatch, steps would follow that.
        if self.empirical is not None or self.course.gains:
            return []
        sentences = []
        for k, take in enumerate(self.base.preparation.takes):
            hidden = hidden_in_noise(self.base, k)
            if hidden is not None:
                jumps, without = hidden
                words = (
                    f"the noise floor contains what looks like {jumps.listed}; without them the "
                    f"noise is {without.sigma:.3g} {without.unit}. They count as noise and hide "
                    "smaller effects; leave out the affected time (--mask), or record the same "
                    "drive again."
                )
                sentences.append((take.recording.source, words))
        return sentences

    @property
    def _in_the_noise(self) -> str | None:
        """The sentence on the jumps in the first recording that has any."""
        if not self.hidden:
            return None
        source, words = self.hidden[0]
        return f"in {source} {words}" if len(self.base.preparation.takes) > 1 else words
