"""The results of an inquiry: named effects, candidates, places, held-out scores, the shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.stats import norm

from .._blocks import AbstractBlock
from .._fit import Estimate, Fit, fit_of, is_useless
from .._models import Model
from .._prepare import Conditions, Noise, Normal, Preparation, Take
from ._fitted import Fitted, fitted
from ._held_out import Predict, Prediction
from ._inquiry import Inquiry
from ._layers import Layer, path_of, wrapped, written
from ._places import Residual, acting_at, freedom_of, locate
from ._refits import Explanation
from ._result import Axis, Candidate, HeldOut, NamedEffect, Shape, Verdict
from ._shape import HYSTERESIS_SHAPE, entry_of
from ._thresholds import APART, DETECTED, EXPLAINED, FAR, REFUTED, SHARE, SIGNIFICANCE

_MEMORY = "minor_loop_memory"
"""The effect that stands for the loop's shape in the extended model."""
_SUREST = 0.96
"""The largest probability of a name; chosen by judgement."""
_USUAL_PLAY = 0.2
"""Prior standard deviation of a play's weight, over the slope; chosen by judgement."""


@dataclass(frozen=True, eq=False)
class Findings:
    """An inquiry into a model, with the held-out recording, if any, and how it is predicted;
    `doubts` are the reasons why the recording cannot be diagnosed."""

    model: Model
    inquiry: Inquiry
    unseen: Take | None
    predict: Predict
    doubts: tuple[str, ...] = ()
    with_plays: bool = True

    @property
    def base(self) -> Fitted:
        """The fitted base model."""
        return self.inquiry.base

    @property
    def noise(self) -> Noise:
        """The noise of the first recording."""
        noise = self.base.preparation.takes[0].noise
        assert noise is not None  # settle() leaves none unknown
        return noise

    @property
    def residuals(self) -> list[tuple[str, float]]:
        """The name of each recording and the rms of the base's residual in it, over its noise."""
        residuals, takes = [], self.base.preparation.takes
        for take, simulation in zip(takes, self.base.simulations, strict=True):
            assert take.noise is not None  # settle() leaves none unknown
            error = (take.recording.response - simulation)[take.used]
            residuals.append((take.recording.source, float(error.std()) / take.noise.sigma))
        return residuals

    @property
    def is_far(self) -> bool:
        """Whether the loop of a recording that can be diagnosed has another shape than the model's,
        and the residual is far above the noise."""
        far = any(times > FAR for _, times in self.residuals)
        return far and self.inquiry.is_shape and not self.doubts

    @property
    def tones(self) -> list[str]:
        """Warnings of tones that no drive causes, if they are not of the mains."""
        if "mains_interference" in self.names:
            return []
        warnings = []
        for take in self.base.preparation.takes:
            tone, recording = take.noise and take.noise.tone, take.recording
            if tone:
                warnings.append(
                    f"{recording.source}: a tone near {tone.frequency * recording.rate:.4g} Hz of "
                    f"about {tone.rms:.2g} {recording.response_unit} rms is not caused by the "
                    "drive, such as interference or a vibration; keep it out of the recording."
                )
        return warnings

    @property
    def jumps(self) -> str:
        """The jumps that explain the mismatch better than any effect, in words; "" if none do."""
        jumps = self.inquiry.jumps
        if jumps is None:
            return ""
        starts = np.cumsum([0, *(len(problem.response) for problem in self.base.problems)])
        listed = []
        for sample, size in zip(jumps.samples, jumps.sizes, strict=True):
            k = int(np.searchsorted(starts, sample, side="right")) - 1
            recording = self.base.preparation.takes[k].recording
            of = f" of {recording.source}" if len(starts) > 2 else ""
            time = (sample - starts[k]) * recording.dt
            listed.append(f"by {size:.3g} {recording.response_unit} at {time:.4g} s{of}")
        return (
            f"The response jumps {', '.join(listed)}, where no effect of the catalogue does: look "
            "for a mount that slips, a switched range or a bad contact."
        )

    @property
    def displaced(self) -> list[str]:
        """Warnings of base parameters outside their usual range: they may hide an effect."""
        warnings = []
        for name, p in self.base.displaced.items():
            low, high = p.plausible
            ends = f"{float(np.min(low)):.3g} to {float(np.max(high)):.3g}"
            warnings.append(
                f"{name} of {self.model.name} ended at {float(np.ravel(p.value)[0]):.3g}, outside "
                f"its usual range of {ends}: it may stand in for physics that the model lacks."
            )
        return warnings

    @cached_property
    def base_fit(self) -> Fit:
        """The base model's fit, as a result."""
        return _fit_of(self.model, self.base)

    @cached_property
    def shape(self) -> Shape | None:
        """How far the loop's shape is from the model's; None where that is not sure."""
        inquiry = self.inquiry
        if not inquiry.is_shape:
            return None
        added = inquiry.explained_by_shape[self.base.counted]
        excess = inquiry.first.gram.square - inquiry.first.gram.count
        share = (inquiry.first.gram.square - inquiry.judge.inner.square) / max(excess, 1e-300)
        unit = self.base.preparation.takes[0].recording.response_unit
        rms = float(np.sqrt(np.mean((added - added.mean()) ** 2)))
        return Shape(rms, unit, float(np.clip(share, 0.0, 1.0)), self.model.name)

    @cached_property
    def extended(self) -> Fitted | None:
        """The model fitted together with the named effects; a sum of plays stands for the loop's
        shape.

        With plays it starts from the effects as they were fitted without them, and from the model
        as fitted alone: what either has become in the other's stead may be a poor basin.
        """
        if not self.layers:
            return None
        base, explanation = self.base.solved.block, self.inquiry.explanation
        if self._has_plays:
            starts = [wrapped(base, self.layers)]
            if explanation is not None:
                starts.append(_with_memory(explanation, self.layers[0]))
            return fitted(starts, self._with_usual_plays())
        block = base if explanation is None else explanation.fitted.solved.block
        return fitted([block], self.base.preparation)

    def _with_usual_plays(self) -> Preparation:
        """The preparation with a prior for the plays' weights, since a drive hardly distinguishes
        neighbouring thresholds."""
        setting = self.base.preparation.setting
        usual = Normal(0.0, _USUAL_PLAY * setting.response_span / setting.drive_span)
        priors = {f"{path_of(self.layers, 0)}weights": usual}
        return replace(self.base.preparation, conditions=Conditions(priors=priors))

    @cached_property
    def layers(self) -> tuple[Layer, ...]:
        """The effects that the extended model adds, the first innermost."""
        explanation = self.inquiry.explanation
        named = () if explanation is None else explanation.layers
        if not self._has_plays or not (named or self._shape_is_named):
            return named
        effect = entry_of(_MEMORY)
        return (Layer(effect, effect.trials(self.base.preparation.setting)[0]), *named)

    @cached_property
    def _shape_is_named(self) -> bool:
        """Whether loop shapes explain the mismatch."""
        return self.shape is not None and self.shape.share >= EXPLAINED and not self.doubts

    @cached_property
    def extended_fit(self) -> Fit | None:
        """The extended model's fit, as a result."""
        if self.extended is None:
            return None
        name = written(self.model.name, self.layers)
        return _fit_of(Model(self.extended.solved.block, name), self.extended)

    @cached_property
    def effects(self) -> tuple[NamedEffect, ...]:
        """The named effects, the one that explains most first, and the loop's shape last."""
        effects = []
        if self.extended_fit is not None:
            offset = len(self.layers) - len(self.inquiry.names)
            for k, name in enumerate(self.inquiry.names):
                path = path_of(self.layers, k + offset)
                effects.append(
                    NamedEffect(
                        name=name.effect,
                        site=self.layers[k + offset].site,
                        probability=min(_SUREST, name.probability) / (1 + 0.5 * len(name.alike)),
                        explained_fraction=float(np.clip(name.share, 0.0, 1.0)),
                        parameters=_own(self.extended_fit, path),
                        confusable_with=name.alike,
                    )
                )
        effects.sort(key=lambda effect: -effect.explained_fraction)
        if self._shape_is_named and self.shape is not None:
            effects.append(
                NamedEffect(
                    name=HYSTERESIS_SHAPE.name,
                    site=HYSTERESIS_SHAPE.site,
                    probability=min(_SUREST, self.inquiry.seen.posterior.shape),
                    explained_fraction=self.shape.share,
                    parameters=(),
                    confusable_with=(),
                )
            )
        return tuple(effects)

    @property
    def verdict(self) -> Verdict:
        """The verdict, by the named effects and the excess over the noise."""
        if self.effects:
            return "confusable" if any(e.confusable_with for e in self.effects) else "missing"
        return "unexplained" if self.is_beyond_noise or self.jumps else "none"

    @cached_property
    def is_beyond_noise(self) -> bool:
        """Whether the base's residual significantly exceeds the noise."""
        return self.p_value < SIGNIFICANCE and (self.excess > self.doubt or self.follows_nothing)

    @property
    def follows_nothing(self) -> bool:
        """Whether the base explains too little of a response that moves far more than its noise,
        even if that noise could only be read from the residual itself."""
        scores = self.base_fit.scores
        return is_useless(scores.r_squared) and scores.rmse > FAR * self.noise.sigma

    @property
    def excess(self) -> float:
        """χ² per sample of the base, minus one."""
        gram = self.inquiry.first.gram
        return gram.square / gram.count - 1

    @property
    def doubt(self) -> float:
        """Three standard errors of the excess, with that of the noise level."""
        freedom = freedom_of(self.base.preparation, self.base.solved.kurtosis)
        return float(3 * np.sqrt(2 / self.inquiry.first.gram.count + 2 / freedom))

    @cached_property
    def p_value(self) -> float:
        """The p-value of the residual: of all places and columns, by Bonferroni."""
        largest = max(candidate.score for candidate in self.candidates)
        of_columns = min(1.0, 2 * self.inquiry.first.gram.width * float(norm.sf(largest)))
        tests = [of_columns, *(axis.p_value for axis in self.axes)]
        return min(1.0, min(tests) * len(tests))

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect of the catalogue, the one with most evidence first."""
        names = dict.fromkeys(kind.name for kind in self.inquiry.first.kinds)
        candidates = [self._candidate(name) for name in names]
        return tuple(sorted(candidates, key=lambda c: -c.log_evidence))

    def _candidate(self, name: str) -> Candidate:
        """One effect of the catalogue, tested."""
        inquiry = self.inquiry
        first, inner = inquiry.first, inquiry.judge.inner
        columns = np.concatenate(
            [np.arange(k.start, k.stop) for k in first.kinds if k.name == name]
        )
        lengths = np.sqrt(np.diag(inner.columns)[columns])
        scores = np.abs(inner.along[columns]) / np.maximum(lengths, 1e-300)
        best = int(np.argmax(np.where(lengths > 0, scores, -1.0)))
        column = inquiry.first.columns.matrix[:, columns[best]]
        size = float(np.sqrt(np.mean(column[self.base.counted] ** 2)))
        refits = {e.names: e for rivals in inquiry.rivals for e in rivals}
        own = [e for names, e in refits.items() if name in names]
        return Candidate(
            name=name,
            site=entry_of(name).site,
            score=float(scores[best]) if lengths[best] > 0 else 0.0,
            log_evidence=self._log_evidence(name),
            detectable_amplitude=DETECTED * size / max(float(lengths[best]), 1e-6),
            concealment=float(np.clip(first.gram.concealments[columns[best]], 0.0, 1.0)),
            reason=self._reason(name),
            delta_bic=self.base.solved.bic - own[0].fitted.solved.bic
            if own and not inquiry.is_shape
            else None,
            explained_fraction=inquiry.judge.fall((name,)) / inquiry.judge.excess,
        )

    def _log_evidence(self, name: str) -> float:
        """The logarithm of the Bayes factor for the effect alone, averaged over loop shapes."""
        hypotheses = self.inquiry.seen.posterior.hypotheses
        alone = float(np.logaddexp.reduce([h.log_posterior for h in hypotheses if not h.names]))
        own = [h.log_posterior for h in hypotheses if h.names == (name,)]
        return float(np.logaddexp.reduce(own)) - alone if own else float("-inf")

    def _reason(self, name: str) -> str:
        """Why an effect is named or not, in words."""
        inquiry = self.inquiry
        for named in inquiry.names:
            if name == named.effect:
                present = min(_SUREST, named.probability)
                return f"named: it, or one like it, is present with probability {present:.2f}"
            if name in named.alike:
                return f"this drive does not distinguish it from {named.effect}"
        judge = inquiry.judge
        if judge.is_inexact and next(k for k in inquiry.first.kinds if k.name == name).is_shape:
            return "cannot be distinguished from another shape of the loop"
        if judge.fall((name,)) < APART:
            return "not significant in the residual"
        if judge.fall((name,)) >= SHARE * judge.excess:
            if inquiry.names:
                return "explains less of the residual than what is named"
            if judge.is_inexact:
                return "follows the residual, but does not predict enough of the held-out parts"
        return "explains too small a share of the residual to be distinguished from misfit"

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """The axes: first those along which the named effect's signature stands out by the
        catalogue, then those whose places explain most of the residual."""
        natural = entry_of(self.names[0]).axes if self.names else ()
        axes = self._maps(self.base.error)

        def order(axis: Axis) -> tuple[bool, int, float, float]:
            silent = axis.p_value >= SIGNIFICANCE
            listed = axis.axis in natural and not (silent and self.layers)
            place = natural.index(axis.axis) if listed else len(natural)
            return silent and not listed, place, -axis.excess, axis.p_value

        axes = sorted(axes, key=order)
        own = next((axis for name in natural for axis in axes if axis.axis == name), None)
        if own is None or own.intervals or self.extended is None:
            return tuple(axes)
        acting = acting_at(own, self._maps(self.base.error - self.extended.error))
        return (acting, *(axis for axis in axes if axis is not own))

    @property
    def names(self) -> list[str]:
        """The named effects, without look-alikes."""
        named = [name.effect for name in self.inquiry.names]
        return named or ([HYSTERESIS_SHAPE.name] if self._shape_is_named else [])

    def _maps(self, error: np.ndarray) -> list[Axis]:
        """The axes of an error (ΣL,), in the response's unit, beside the base."""
        base = self.base
        residual = Residual.beside(base.whitened(error), base.whitened(base.tangent))
        freedom = freedom_of(base.preparation, base.solved.kurtosis)
        return locate(base.preparation, base.problems, residual, freedom)

    @cached_property
    def predicted(self) -> tuple[Prediction, Prediction | None]:
        """The predictions of held-out data by the base and by the extended model."""
        before, *extended = map(self._of_determined, self._all_predicted)
        return before, extended[0] if extended else None

    def predict_determined(self, fitted: Fitted) -> Prediction:
        """The prediction of the held-out folds that the others determine, if there are any: a
        recording's only step, held out, says nothing about creep."""
        return self._of_determined(self.predict(fitted))

    def _of_determined(self, prediction: Prediction) -> Prediction:
        return prediction.of(self._determined) if self._determined else prediction

    @cached_property
    def _all_predicted(self) -> list[Prediction]:
        """The predictions of all folds by the base, and by the extended model if there is one."""
        return [self.predict(fit) for fit in (self.base, self.extended) if fit is not None]

    @cached_property
    def _determined(self) -> list[int]:
        """The folds whose predictions by base and extended model the others determine."""
        each = zip(*(prediction.determined for prediction in self._all_predicted), strict=True)
        return [k for k, determined in enumerate(each) if all(determined)]

    @property
    def events(self) -> tuple[str, ...]:
        """What held-out data do not test, in words, if some stretches cannot be held out."""
        if len(self._determined) in (0, len(self._all_predicted[0].folds)):
            return ()
        return (
            "Some stretches were not held out, since the others do not determine the parameters "
            "without them: what is said rests on the events in those, such as a single step. A "
            "recording with more of them would confirm it.",
        )

    @property
    def _has_plays(self) -> bool:
        """Whether the extended model has a sum of plays for the loop's shape."""
        return self.inquiry.is_shape and self.with_plays

    @property
    def plays_predict_worse(self) -> bool:
        """Whether the extended model has plays and does not predict held-out data better."""
        before, after = self.predicted
        return self._has_plays and after is not None and after.rmse >= before.rmse

    @property
    def is_refuted(self) -> bool:
        """Whether held-out data are clearly further from the extended model than from the base:
        then the named effects have followed something else.  What rests on single events must
        explain a sufficient share of the others' error."""
        before, after = self.predicted
        if after is None:
            return False
        limit = np.sqrt(1 - SHARE) if self.events else REFUTED
        return after.rmse > limit * before.rmse

    @property
    def held_out(self) -> HeldOut:
        """The scores on held-out data."""
        take, (base, extended) = self.unseen, self.predicted
        method, source = (
            ("stretches set aside in turn", "")
            if take is None
            else ("recording", take.recording.source)
        )
        if extended is None:
            return HeldOut(method, base.rmse, None, base.folds, (), source)
        return HeldOut(method, base.rmse, extended.rmse, base.folds, extended.folds, source)


def _fit_of(model: Model, fitted: Fitted) -> Fit:
    """The result of a fit, with the simulations of the fine grid."""
    fit = fit_of(model, fitted.solved.on(fitted.preparation))
    return replace(fit, simulations=fitted.simulations)


def _with_memory(explanation: Explanation, memory: Layer) -> AbstractBlock:
    """An explanation as fitted, with plays beside its model."""
    block, parts = explanation.fitted.solved.block, []
    for layer in reversed(explanation.layers):
        parts.append(Layer(layer.effect, getattr(block, layer.place)))
        block = getattr(block, layer.inside)
    return wrapped(block, [memory, *parts[::-1]])


def _own(fit: Fit, path: str) -> tuple[Estimate, ...]:
    """The estimates of one layer, by its own names."""
    own: Sequence[Estimate] = [e for e in fit.estimates if e.path.startswith(path)]
    return tuple(replace(e, name=e.path.removeprefix(path)) for e in own)
