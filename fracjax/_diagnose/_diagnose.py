"""The procedure: noise, numerics, base fit, detection, location, shortlist, refit, naming."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import numpy as np
from scipy.special import softmax

from .._blocks import EFFECTS, AbstractBlock
from .._fit import (
    Estimate,
    Fit,
    Noise,
    Past,
    Preparation,
    Progress,
    Solved,
    Take,
    fit_of,
    jacobian,
    layout_of,
    measured_noise,
    orthonormal,
    prepare,
    settle,
    silent,
    simulate_all,
    solve_from,
    take_of,
)
from .._models import Model
from .._parameters import named_parameters
from .._recording import Recording, require_units_of
from ._held_out import Gain, Prediction, gain, predict_recording, predict_stretches
from ._locate import locate
from ._next_experiment import Limits, propose, recorded_limits
from ._refit import Refit, refit
from ._result import (
    Axis,
    Candidate,
    Diagnosis,
    HeldOut,
    NamedEffect,
    NextExperiment,
    Verdict,
)
from ._score import EffectScore, Residual, Scorer, confusability, family_wise_p
from ._sentence import next_experiment, sentence_of, where_of

_SIGNIFICANCE = 0.01
_FINEST = 8
_NUMERICS_TARGET, _NUMERICS_LIMIT = 0.5, 1.0
_STARTS = 8
_SHORTLIST, _LONGEST_SHORTLIST = 4, 8
_LIKE = 0.9
_DELTA_BIC = 10.0
_EXPLAINED = 0.9
_ROUNDS = 3
_MOST_RIVALS = 4


@dataclass(frozen=True)
class Stage:
    """The model as far as it has been extended, with what it leaves."""

    name: str
    solved: Solved
    nominal: AbstractBlock
    preparation: Preparation
    adopted: tuple[str, ...] = ()

    @property
    def excess(self) -> float:
        """χ² beyond what noise explains."""
        return self.solved.cost - self.solved.samples


@dataclass(frozen=True)
class Judged:
    """A refitted candidate with everything the naming rule asks."""

    refit: Refit
    preparation: Preparation
    delta_bic: float
    explained: float
    numerics: float
    gain: Gain
    prediction: Prediction
    plausible: bool

    @property
    def name(self) -> str:
        return self.refit.name

    @property
    def admissible(self) -> bool:
        """Better beyond doubt, also on data held out, within its range, and not an artefact."""
        return (
            self.delta_bic >= _DELTA_BIC
            and self.gain.convincing
            and self.plausible
            and self.numerics <= _NUMERICS_LIMIT
        )


def numerical_error(block: AbstractBlock, preparation: Preparation, basis: np.ndarray) -> float:
    """√λ_num: what halving the step changes beyond what the fit can absorb, in noise units.

    The order of the quadrature is four, so that the change is the coarser grid's error to 7 %.
    """
    fine = replace(preparation, oversampling=2 * preparation.oversampling)
    coarse = simulate_all([block], preparation.problems())[1][0]
    halved = simulate_all([block], fine.problems())[1][0]
    change = halved - coarse
    return float(np.linalg.norm(change - basis @ (basis.T @ change)))


def residual_of(solved: Solved, preparation: Preparation) -> Residual:
    """Whitened residual and basis of a solved block."""
    problems = preparation.problems()
    whitened = []
    for take, problem, simulation in zip(
        preparation.takes, problems, solved.simulations, strict=True
    ):
        error = np.zeros(problem.response.shape[0])
        error[: len(take.recording)] = take.recording.response - simulation
        whitened.append(problem.whiten(error))
    basis = orthonormal(jacobian(solved.block, problems)[1])
    residual = np.concatenate(whitened)
    return Residual(residual - basis @ (basis.T @ residual), basis)


def diagnose(
    model: Model,
    recordings: Recording | Sequence[Recording],
    *,
    holdout: Recording | None = None,
    repeat: Recording | None = None,
    noise: float | None = None,
    history: Past | None = None,
    settling: int | None = None,
    limits: Limits | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> Diagnosis:
    """Say whether, where and why a model and recordings differ beyond noise.

    `holdout` is a recording that no fit sees; without one, stretches are set aside in turn.
    `repeat` holds the drive a second time, for the noise floor; `noise` is the sensor's
    specification [response unit, rms], used where neither repeats nor rests show the noise.
    `limits` of the drive bound the next experiment; without them the range that was recorded and
    ten times its fastest change do.
    Raises InputError where the recordings do not fit together.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    with jax.enable_x64(True):
        progress("reading the noise floor")
        preparation = prepare(
            listed, repeat=repeat, specification=noise, history=history, settling=settling
        )
        progress(f"fitting {model.name} from {_STARTS} starts")
        solved, preparation = settle(
            model.block, preparation, history=history, starts=_STARTS, seed=seed
        )
        solved, preparation, numerics = _fine_enough(solved, preparation, progress)
        base = Stage(model.name, solved, model.block, preparation)
        limits = limits or recorded_limits(listed)
        return _Procedure(base, numerics, holdout, limits, seed, progress).run(model)


def _fine_enough(
    solved: Solved, preparation: Preparation, progress: Progress
) -> tuple[Solved, Preparation, float]:
    """Refine the grid until the numerical error is far under the noise, or the grid is finest."""
    while True:
        progress(f"checking the numerics with {preparation.oversampling} steps per sample")
        basis = residual_of(solved, preparation).basis
        error = numerical_error(solved.block, preparation, basis)
        if error <= _NUMERICS_TARGET or preparation.oversampling >= _FINEST:
            return solved, preparation, error
        preparation = preparation.with_oversampling(2 * preparation.oversampling)
        solved = solve_from([solved.block], preparation)


class _Procedure:
    """Steps 5 to 12 on a fitted base."""

    def __init__(
        self,
        base: Stage,
        numerics: float,
        holdout: Recording | None,
        limits: Limits,
        seed: int,
        progress: Progress,
    ):
        self.base, self.numerics, self.seed, self.progress = base, numerics, seed, progress
        self.limits = limits
        self.setting = base.preparation.setting
        self.take = None if holdout is None else self._take(holdout)
        self.base_prediction = self._predict(base.solved, base.preparation)

    def _take(self, holdout: Recording) -> Take:
        """The held-out recording under the assumptions of the first training recording."""
        first = self.base.preparation.takes[0]
        require_units_of(first.recording, holdout)
        history = first.history if first.history != "periodic" else None
        return take_of(holdout, measured_noise(holdout) or first.noise, history, None)

    def _predict(self, solved: Solved, preparation: Preparation) -> Prediction:
        if self.take is None:
            return predict_stretches(solved, preparation)
        return predict_recording(solved, preparation, self.take)

    def run(self, model: Model) -> Diagnosis:
        stage, first_scores, first_axes, first_p = self.base, [], [], 1.0
        winners: list[tuple[Judged, list[Judged]]] = []
        judged: dict[str, Judged] = {}
        for round_ in range(_ROUNDS + 1):
            scores, axes, p_value = self._detect(stage)
            if round_ == 0:
                first_scores, first_axes, first_p = scores, axes, p_value
            # A mismatch no larger than the simulation's own error is never given a name.
            if p_value >= _SIGNIFICANCE or round_ == _ROUNDS or self.numerics > _NUMERICS_LIMIT:
                break
            found = self._judge(stage, scores)
            judged = {**{j.name: j for j in found}, **judged}
            winner = self._best(found)
            if winner is None:
                break
            winners.append((winner, found))
            stage = Stage(
                _extended_name(stage.name, winner),
                winner.refit.solved,
                winner.refit.score.effect.insert(
                    stage.nominal, winner.refit.score.trials[winner.refit.score.best]
                ),
                winner.preparation,
                (*stage.adopted, winner.name),
            )
        return self._conclude(model, stage, winners, judged, first_scores, first_axes, first_p)

    def _detect(self, stage: Stage) -> tuple[list[EffectScore], list[Axis], float]:
        """Score every effect not yet adopted and every place; one p-value, Holm-adjusted."""
        what = " >> ".join(("base", *stage.adopted)) if stage.adopted else "the base model"
        self.progress(f"testing what {what} leaves")
        problems = stage.preparation.problems()
        residual = residual_of(stage.solved, stage.preparation)
        scorer = Scorer(stage.solved.block, problems, residual)
        scores = [
            scorer.score(effect, self.setting)
            for name, effect in EFFECTS.items()
            if name not in stage.adopted
        ]
        self.progress("locating the mismatch")
        axes = locate(stage.preparation, problems, residual)
        tests = [family_wise_p(scores, self.seed), *(axis.p_value for axis in axes)]
        return scores, axes, min(1.0, min(tests) * len(tests))

    def _judge(self, stage: Stage, scores: list[EffectScore]) -> list[Judged]:
        """Refit the shortlist and put every candidate to the naming rule's questions."""
        # What a refit can gain is about z²; where even twice that is no evidence, none is needed.
        least = _DELTA_BIC + np.log(stage.solved.samples)
        promising = [s for s in scores if 2 * float(np.max(s.z**2)) >= least]
        ranked = sorted(promising, key=lambda s: -s.log_evidence)
        shortlist = ranked[:_SHORTLIST] + [
            s
            for s in ranked[_SHORTLIST:]
            if any(confusability(s, t) > _LIKE for t in ranked[:_SHORTLIST])
        ]
        before = self._predict(stage.solved, stage.preparation)
        found: list[Judged] = []
        hopeless = np.inf
        for score in shortlist[:_LONGEST_SHORTLIST]:
            self.progress(f"refitting with {score.effect.name}")
            attempt = refit(
                score, stage.solved.block, stage.nominal, stage.preparation, self.seed, hopeless
            )
            # A rival that is not halfway to the best after its first steps will not overtake it.
            hopeless = min(hopeless, 0.5 * (stage.solved.cost + attempt.solved.cost))
            found.append(self._questions(stage, attempt, before))
        return found

    def _questions(self, stage: Stage, attempt: Refit, before: Prediction) -> Judged:
        solved, preparation, numerics = attempt.solved, stage.preparation, 0.0
        if self._delta_bic(stage, solved) >= _DELTA_BIC:
            solved, preparation, numerics = _fine_enough(solved, preparation, self.progress)
            attempt = replace(attempt, solved=solved)
        fall = stage.solved.cost - solved.cost
        # The excess itself is uncertain by the χ² distribution and by the noise level's own error.
        doubt = 3 * np.sqrt(6 * solved.samples)
        total_fall = self.base.solved.cost - solved.cost
        prediction = self._predict(solved, preparation)
        return Judged(
            refit=attempt,
            delta_bic=self._delta_bic(stage, solved),
            explained=float(total_fall / max(total_fall, self.base.excess - doubt))
            if fall > 0
            else 0.0,
            numerics=numerics,
            preparation=preparation,
            gain=gain(before, prediction),
            prediction=prediction,
            plausible=_plausible(attempt),
        )

    @staticmethod
    def _delta_bic(stage: Stage, solved: Solved) -> float:
        """Evidence in units of what is left unexplained, where that exceeds the noise."""
        return (stage.solved.bic - solved.bic) / max(1.0, solved.cost / solved.samples)

    def _best(self, found: list[Judged]) -> Judged | None:
        admissible = [j for j in found if j.admissible]
        return max(admissible, key=lambda j: j.delta_bic, default=None)

    def _conclude(
        self,
        model: Model,
        stage: Stage,
        winners: list[tuple[Judged, list[Judged]]],
        judged: dict[str, Judged],
        scores: list[EffectScore],
        axes: list[Axis],
        p_value: float,
    ) -> Diagnosis:
        self.progress("writing the verdict")
        noise = self.base.preparation.takes[0].noise
        assert noise is not None  # settle() leaves none unknown
        base_fit = fit_of(model, self.base.solved, self.base.preparation)
        extended = None
        effects: tuple[NamedEffect, ...] = ()
        verdict: Verdict = "none" if p_value >= _SIGNIFICANCE else "unexplained"
        if winners:
            extended = fit_of(
                Model(stage.solved.block, stage.name), stage.solved, stage.preparation
            )
            last = winners[-1][0]
            if last.explained >= _EXPLAINED:
                effects = tuple(
                    self._named(winner, found, extended, stage) for winner, found in winners
                )
                confused = any(e.confusable_with for e in effects)
                verdict = "confusable" if confused else "missing"
        candidates = tuple(
            self._candidate(s, judged.get(s.effect.name), stage, p_value)
            for s in sorted(scores, key=lambda s: -s.log_evidence)
        )
        natural = [axis for w, _ in winners[:1] for axis in w.refit.score.effect.axes]
        axes = sorted(
            axes,
            key=lambda a: (
                natural.index(a.axis) if a.axis in natural and a.p_value < _SIGNIFICANCE else 99,
                a.p_value,
                -a.strength.max(),
            ),
        )
        held_out = self._held_out(winners[-1][0].prediction if winners else None)
        warnings = self._warnings(noise)
        where = where_of(axes, verdict)
        return Diagnosis(
            verdict=verdict,
            sentence=sentence_of(
                verdict, effects, stage.adopted, candidates, axes, base_fit, noise, held_out
            ),
            base=base_fit,
            extended=extended,
            effects=effects,
            candidates=candidates,
            axes=tuple(axes),
            where=where,
            noise=noise,
            numerics=self.numerics,
            p_value=p_value,
            held_out=held_out,
            next_experiment=self._next_experiment(verdict, winners, judged),
            warnings=warnings,
        )

    def _next_experiment(
        self,
        verdict: Verdict,
        winners: list[tuple[Judged, list[Judged]]],
        judged: dict[str, Judged],
    ) -> NextExperiment | None:
        """The drive that tells apart what this recording cannot: the look-alikes of an effect, or
        the best guesses where none explains the mismatch."""
        if verdict == "confusable":
            sets = [[w, *_rivals(w, found)] for w, found in winners]
            rivals = max(sets, key=len)
        elif verdict == "unexplained":
            rivals = sorted(judged.values(), key=lambda j: -j.delta_bic)
        else:
            return None
        rivals = rivals[:_MOST_RIVALS]
        if len(rivals) < 2:
            return None
        proposal = propose(
            [j.refit.solved.block for j in rivals],
            rivals[0].preparation,
            self.limits,
            self.progress,
        )
        return next_experiment([j.name for j in rivals], proposal)

    def _named(
        self, winner: Judged, found: list[Judged], extended: Fit, stage: Stage
    ) -> NamedEffect:
        rivals = [j for j in found if j.admissible]
        weights = softmax([0.5 * j.delta_bic for j in rivals])
        effect = winner.refit.score.effect
        own = _own_parameters(stage, winner, extended)
        return NamedEffect(
            name=winner.name,
            site=effect.site,
            probability=float(weights[[j.name for j in rivals].index(winner.name)]),
            explained_fraction=float(np.clip(winner.explained, 0.0, 1.0)),
            parameters=own,
            confusable_with=tuple(j.name for j in _rivals(winner, found)),
        )

    def _candidate(
        self, score: EffectScore, judged: Judged | None, stage: Stage, p_value: float
    ) -> Candidate:
        return Candidate(
            name=score.effect.name,
            site=score.effect.site,
            score=float(np.abs(score.z[score.best])),
            log_evidence=score.log_evidence,
            detectable_amplitude=score.detectable_amplitude,
            concealment=float(np.clip(score.concealments[score.best], 0.0, 1.0)),
            reason=_reason(score, judged, stage, p_value, self.numerics),
            delta_bic=None if judged is None else judged.delta_bic,
            explained_fraction=None if judged is None else judged.explained,
            held_out_gain=None if judged is None else judged.gain.share_of_rmse,
        )

    def _held_out(self, extended: Prediction | None) -> HeldOut:
        return HeldOut(
            method="stretches set aside in turn" if self.take is None else "recording",
            base_rmse=self.base_prediction.rmse,
            extended_rmse=None if extended is None else extended.rmse,
            base_folds=self.base_prediction.folds,
            extended_folds=() if extended is None else extended.folds,
            source="" if self.take is None else self.take.recording.source,
        )

    def _warnings(self, noise: Noise) -> tuple[str, ...]:
        found = [
            warning
            for take in self.base.preparation.takes
            for warning in (*take.recording.warnings, *take.recording.checks())
        ]
        if noise.method == "residual":
            found.append(
                "The noise floor was taken from the residual itself, for want of repeats, rests or "
                "a specification: mismatch that looks like noise cannot be excluded."
            )
        if self.numerics > _NUMERICS_TARGET:
            found.append(
                f"The discretisation error is {self.numerics:.2g} noise units (target 0.5) on the "
                "finest grid: a higher sampling rate of the drive would help."
            )
        if not self.base.solved.converged:
            found.append("The base fit did not converge; its figures are those of its best point.")
        return tuple(found)


def _rivals(winner: Judged, found: list[Judged]) -> list[Judged]:
    """The admissible effects that fit as well as the winner, best first."""
    close = [
        j
        for j in found
        if j.admissible and j is not winner and winner.delta_bic - j.delta_bic < _DELTA_BIC
    ]
    return sorted(close, key=lambda j: -j.delta_bic)


def _extended_name(base: str, winner: Judged) -> str:
    name, site = winner.name, winner.refit.score.effect.site
    grouped = f"({base})" if " " in base else base
    if site == "drive":
        return f"{name} >> {grouped}"
    return f"{grouped} + {name}" if site == "additive" else f"{grouped} >> {name}"


def _effect_parameters(block: AbstractBlock, trial: AbstractBlock) -> list[str]:
    """Dotted names, within an extended block, of the parameters that came with the effect."""
    own = named_parameters(trial)
    kind = type(trial)
    names: list[str] = []

    def search(node: object, path: str) -> None:
        if type(node) is kind:
            names.extend(f"{path}{n}" for n, p in own.items() if not p.fixed)
            return
        for field in ("first", "second"):
            if hasattr(node, field):
                search(getattr(node, field), f"{path}{field}.")

    search(block, "")
    return names


def _own_parameters(stage: Stage, winner: Judged, extended: Fit) -> tuple[Estimate, ...]:
    score = winner.refit.score
    names = _effect_parameters(stage.solved.block, score.trials[score.best])
    chosen = []
    for estimate in extended.estimates:
        stem = estimate.name.split("[")[0]
        if stem in names:
            chosen.append(replace(estimate, name=estimate.name.split(".")[-1]))
    return tuple(chosen)


def _plausible(attempt: Refit) -> bool:
    """Whether the effect's shapes ended within their expected ranges."""
    trial = attempt.score.trials[attempt.score.best]
    block = attempt.solved.block
    shapes = {n for n, _ in layout_of(block).shapes}
    parameters = named_parameters(block)
    for name in _effect_parameters(block, trial):
        if name in shapes:
            parameter = parameters[name]
            low, high = parameter.plausible
            value = np.asarray(parameter.value)
            if not (np.all(value >= low) and np.all(value <= high)):
                return False
    return True


def _reason(
    score: EffectScore, judged: Judged | None, stage: Stage, p_value: float, numerics: float
) -> str:
    """Why a candidate was kept or rejected, in words."""
    if p_value >= _SIGNIFICANCE:
        return "nothing in the residual beyond noise"
    if numerics > _NUMERICS_LIMIT:
        return f"not refitted: the discretisation error is {numerics:.2g} noise units"
    if judged is None:
        return "not refitted: other effects have more evidence in the residual"
    if judged.name in stage.adopted:
        return "adopted: better beyond doubt, also on data held out"
    if judged.numerics > _NUMERICS_LIMIT:
        return f"rejected: its discretisation error is {judged.numerics:.2g} noise units"
    if judged.delta_bic < _DELTA_BIC:
        return f"rejected: the refit gains only {judged.delta_bic:.3g} in BIC"
    if not judged.plausible:
        return "rejected: its refitted parameters lie outside their plausible range"
    if not judged.gain.convincing:
        return "rejected: the refit does not predict held-out data better beyond doubt"
    return "fits less well than the adopted effect"
