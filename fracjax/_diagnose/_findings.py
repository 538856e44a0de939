"""The results of an inquiry: named effects, candidates, places, held-out scores, the shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from .._fit import Estimate, Fit, Predicted, fit_of, is_useless
from .._models import Model
from .._path import Hypothesis, misfit
from .._prepare import Noise, Take
from .._show import pretty_unit
from ._extension import Extension
from ._fitted import Fitted
from ._held_out import Predict, Prediction, of_determined
from ._inquiry import Inquiry
from ._layers import written
from ._places import Residual, acting_at, doubt_of, freedom_of, locate
from ._result import Axis, Candidate, HeldOut, NamedEffect, Shape, Verdict
from ._shape import HYSTERESIS_SHAPE, entry_of
from ._thresholds import ADEQUATE, DETECTED, REFUTED, SIGNIFICANCE
from ._views import View

_ABSORBED = 1e-5
"""The length below which a projected column counts as absorbed, over its own."""
_FAR = 10.0
"""The rms of a residual over the noise from which a model that explains nothing is said to do so;
chosen by judgement."""


@dataclass(frozen=True, eq=False)
class Findings:
    """An inquiry into a model, with the held-out recording, if any, and how it is predicted, and
    the model extended by what is named; `doubts` are the reasons why the recording cannot be
    diagnosed."""

    model: Model
    inquiry: Inquiry
    unseen: Take | None
    predict: Predict
    doubts: tuple[str, ...] = ()
    extension: Extension | None = None

    @property
    def base(self) -> Fitted:
        """The fitted base model."""
        return self.inquiry.base

    @property
    def noise(self) -> Noise:
        """The noise of the first recording; inside a machine as what is named leaves it."""
        extension = self.extension
        own = extension.fitted if extension is not None and extension.inside else self.base
        noise = own.preparation.takes[0].noise
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
                    f"about {tone.rms:.2g} {pretty_unit(recording.response_unit)} rms is not "
                    "caused by the drive, such as interference or a vibration; keep it out of the "
                    "recording."
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
            listed.append(
                f"by {size:.3g} {pretty_unit(recording.response_unit)} at {time:.4g} s{of}"
            )
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

    @property
    def extended(self) -> Fitted | None:
        """The model with the named effects, if any."""
        return None if self.extension is None else self.extension.fitted

    @cached_property
    def extended_fit(self) -> Fit | None:
        """The extended model's fit, as a result."""
        if self.extension is None:
            return None
        name = written(self.extension.law, self.extension.layers)
        return _fit_of(Model(self.extension.fitted.solved.block, name), self.extension.fitted)

    @cached_property
    def shape(self) -> Shape | None:
        """How far the loop's shape is from the model's; None where it is the model's, or another
        law predicts no better."""
        if self.extension is None or not self.extension.is_other_law:
            return None
        change = (self.base.error - self.extension.fitted.error)[self.base.counted]
        rms = float(np.sqrt(np.mean((change - change.mean()) ** 2)))
        squares = [
            float(np.sum(f.whitened(f.error) ** 2)) for f in (self.base, self.extension.fitted)
        ]
        share = 1 - squares[1] / max(squares[0], 1e-300)
        unit = self.base.preparation.takes[0].recording.response_unit
        return Shape(rms, unit, float(np.clip(share, 0.0, 1.0)), self.model.name)

    @cached_property
    def effects(self) -> tuple[NamedEffect, ...]:
        """The named effects, the one that explains most first, and the loop's shape last."""
        effects = []
        for k, name in enumerate(self.inquiry.names):
            site, parameters = entry_of(name.effect).site, ()
            if self.extension is not None and self.extended_fit is not None:
                site = self.extension.layers[k].site if self.extension.layers else site
                parameters = _own(self.extended_fit, self.extension.path_of(k))
            effects.append(
                NamedEffect(
                    name=name.effect,
                    site=site,
                    probability=name.probability,
                    explained_fraction=self.inquiry.share_of(name.effect),
                    parameters=parameters,
                    confusable_with=name.alike,
                    explains="what no shape of the loop explains"
                    if self.shape is not None
                    else NamedEffect.explains,
                )
            )
        effects.sort(key=lambda effect: -effect.explained_fraction)
        if self.shape is not None:
            effects.append(
                NamedEffect(
                    name=HYSTERESIS_SHAPE.name,
                    site=HYSTERESIS_SHAPE.site,
                    probability=self._probability_of_shape,
                    explained_fraction=self.shape.share,
                    parameters=(),
                    confusable_with=(),
                )
            )
        return tuple(effects)

    @property
    def _probability_of_shape(self) -> float:
        """That another law predicts held-out folds better, by their count (Laplace's rule)."""
        before, after = self.predicted
        assert after is not None  # there is another law
        better = sum(b > a for b, a in zip(before.folds, after.folds, strict=True))
        return (better + 1) / (len(before.folds) + 2)

    @property
    def verdict(self) -> Verdict:
        """The verdict, by the named effects and the excess over the noise."""
        if self.effects:
            return "confusable" if any(e.confusable_with for e in self.effects) else "missing"
        return "unexplained" if self.is_beyond_noise or self.jumps else "none"

    @cached_property
    def is_beyond_noise(self) -> bool:
        """Whether the residual significantly exceeds the noise: the base's, or that of path curves
        where no model is asked about."""
        if self.inquiry.model is None:
            return self.excess > max(self.doubt, ADEQUATE - 1)
        return self.p_value < SIGNIFICANCE and (self.excess > self.doubt or self.follows_nothing)

    @property
    def follows_nothing(self) -> bool:
        """Whether the base explains too little of a response that moves far more than its noise,
        even if that noise could only be read from the residual itself."""
        scores = self.base_fit.scores
        return is_useless(scores.r_squared) and scores.rmse > _FAR * self.noise.sigma

    @property
    def excess(self) -> float:
        """χ² per sample minus one, without effects."""
        return self.inquiry.tested.base_misfit

    @property
    def doubt(self) -> float:
        """Three standard errors of the excess, with that of the noise level."""
        return doubt_of(self.base, self.inquiry.tested.law.count)

    @cached_property
    def p_value(self) -> float:
        """The p-value of the residual: of all places and columns, by Bonferroni."""
        largest = max(candidate.score for candidate in self.candidates)
        width = self.inquiry.tested.law.inner.along.size
        of_columns = min(1.0, 2 * width * float(ndtr(-largest)))
        tests = [of_columns, *(axis.p_value for axis in self.axes)]
        return min(1.0, min(tests) * len(tests))

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Every effect that was tested, the one with most evidence first."""
        names = dict.fromkeys(kind.name for kind in self.inquiry.tested.law.kinds)
        candidates = [self._candidate(name) for name in names]
        return tuple(sorted(candidates, key=lambda c: -c.log_evidence))

    def _candidate(self, name: str) -> Candidate:
        """One effect of the catalogue, tested."""
        inquiry = self.inquiry
        view = inquiry.tested
        inner, kinds = view.law.inner, view.law.kinds
        columns = np.concatenate([np.arange(k.start, k.stop) for k in kinds if k.name == name])
        lengths = np.sqrt(np.maximum(np.diag(inner.columns)[columns], 0.0))
        seen = lengths > _ABSORBED * view.whole[columns]
        scores = np.where(seen, np.abs(inner.along[columns]) / np.maximum(lengths, 1e-300), 0.0)
        best = int(np.argmax(scores))
        size = float(np.sqrt(np.mean(view.matrix[:, columns[best]] ** 2)))
        refits = [e.fitted.solved for e in inquiry.refits if e.names == (name,)]
        own = [solved for solved in refits if solved.converged]
        concealed = 1 - (lengths[best] / max(float(view.whole[columns[best]]), 1e-300)) ** 2
        alone = [h for h in _listed(view) if h.names == (name,)]
        explained = view.base_misfit - misfit(view.law, alone[0]) if alone else 0.0
        return Candidate(
            name=name,
            site=entry_of(name).site,
            score=float(scores[best]),
            log_evidence=self._log_evidence(name),
            detectable_amplitude=DETECTED * size / max(float(lengths[best]), 1e-6),
            concealment=float(np.clip(concealed, 0.0, 1.0)),
            reason=self._reason(name),
            delta_bic=self.base.solved.bic - own[0].bic if own else None,
            explained_fraction=float(np.clip(explained / max(self.excess, 1e-300), 0.0, 1.0)),
        )

    def _log_evidence(self, name: str) -> float:
        """The logarithm of the Bayes factor for the effect alone."""
        by_names = {h.names: h.log_posterior for h in _listed(self.inquiry.tested)}
        return by_names.get((name,), float("-inf")) - by_names[()]

    def _reason(self, name: str) -> str:
        """Why an effect is named or not, in words."""
        for named in self.inquiry.names:
            if name == named.effect:
                return f"named: present with probability {named.probability:.2f}"
            if name in named.alike:
                return f"this drive does not distinguish it from {named.effect}"
        if not self.inquiry.is_adequate and entry_of(name).rate_independent:
            return "cannot be distinguished from another shape of the loop"
        if self._log_evidence(name) < 0:
            return "not significant in the residual"
        if self.inquiry.names:
            return "explains less of the residual than what is named"
        return "does not explain the residual down to the noise"

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """The axes: first those along which the named effect's signature stands out by the
        catalogue, then those whose places explain most of the residual."""
        natural = entry_of(self.names[0]).axes if self.names else ()
        axes = self._maps(self.base.error)

        def order(axis: Axis) -> tuple[bool, int, float, float]:
            silent = axis.p_value >= SIGNIFICANCE
            listed = axis.axis in natural and not (silent and self.names)
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
        return named or ([HYSTERESIS_SHAPE.name] if self.shape is not None else [])

    def _maps(self, error: np.ndarray) -> list[Axis]:
        """The axes of an error (ΣL,), in the response's unit, beside the base."""
        base = self.base
        residual = Residual.beside(base.whitened(error), base.whitened(base.tangent))
        freedom = freedom_of(base.preparation, base.solved.kurtosis)
        return locate(base.preparation, base.problems, residual, freedom)

    @cached_property
    def predicted(self) -> tuple[Prediction, Prediction | None]:
        """The predictions of held-out data by the base and by the extended model."""
        before, *extended = of_determined(self._all_predicted)
        return before, extended[0] if extended else None

    @cached_property
    def _all_predicted(self) -> list[Prediction]:
        """The predictions of all folds by the base, and by the extended model if there is one."""
        return [self.predict(fit) for fit in (self.base, self.extended) if fit is not None]

    @property
    def events(self) -> tuple[str, ...]:
        """What held-out data do not test, in words, if some stretches cannot be held out."""
        if len(self.predicted[0].folds) == len(self._all_predicted[0].folds):
            return ()
        return (
            "Some stretches were not held out, since the others do not determine the parameters "
            "without them: what is said rests on the events in those, such as a single step. A "
            "recording with more of them would confirm it.",
        )

    @property
    def is_refuted(self) -> bool:
        """Whether held-out data are clearly further from the extended model than from the base, or,
        where that follows nothing, not clearly nearer: then the named effects have followed
        something else."""
        before, after = self.predicted
        worse = 1 / REFUTED if self.follows_nothing else REFUTED
        return after is not None and after.rmse > worse * before.rmse

    @property
    def held_out(self) -> HeldOut:
        """The scores on held-out data."""
        take, (base, extended) = self.unseen, self.predicted
        method, source = (
            ("stretches set aside in turn", "")
            if take is None
            else ("recording", take.recording.source)
        )
        models = [base] if extended is None else [base, extended]
        responses = tuple(each.response for each in models if each.response is not None)
        predicted = None
        if take is not None and base.scored is not None:
            predicted = Predicted(take.recording, base.scored, responses)
        return HeldOut(
            method,
            base.rmse,
            None if extended is None else extended.rmse,
            base.folds,
            () if extended is None else extended.folds,
            source,
            predicted,
        )


def _listed(view: View) -> list[Hypothesis]:
    """The hypotheses about a view's own columns."""
    return [h for h in view.posterior.hypotheses if h.law == view.law.name]


def _fit_of(model: Model, fitted: Fitted) -> Fit:
    """The result of a fit, with the simulations of the fine grid."""
    fit = fit_of(model, fitted.solved.on(fitted.preparation))
    return replace(fit, simulations=fitted.simulations)


def _own(fit: Fit, path: str) -> tuple[Estimate, ...]:
    """The estimates of one layer, as tables list them, by its own names."""
    own: Sequence[Estimate] = [e for e in fit.shown_estimates if e.path.startswith(path)]
    return tuple(replace(e, name=e.path.removeprefix(path)) for e in own)
