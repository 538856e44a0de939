"""The diagnosis as plain data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from .._fit import Estimate, Fit, Predicted, estimate_row
from .._frequency import LinearApproximation, best_linear_approximations
from .._models import Model
from .._operators import History
from .._path import Visible
from .._prepare import Noise
from .._protocol import Drive
from .._recording import Recording, item
from .._show import Shown, Table, View, figure, percent, pretty_unit, quantity

if TYPE_CHECKING:
    import pandas as pd

    from .._show.drawing import Drawing

SCHEMA = "fracjax.diagnosis/1"

Verdict = Literal["none", "missing", "confusable", "unexplained"]


@dataclass(frozen=True)
class Candidate:
    """One effect of the catalogue, tested against the recording.

    Attributes:
        name: the effect's name.
        site: where its block is inserted.
        score: the largest |z| over its trials, dimensionless.
        log_evidence: natural logarithm of the Bayes factor for it alone, averaged over the loop's
            shape, dimensionless.
        detectable_amplitude: the smallest rms change of the response that would have been detected,
            before any refit [response unit].
        concealment: the share of its signature that the base model absorbs, 0 to 1.
        reason: why it was named or rejected, in words.
        delta_bic: after a refit, BIC of the base minus that of the extended model; positive is
            better, dimensionless.
        explained_fraction: the share of the excess residual that its columns explain, 0 to 1.
    """

    name: str
    site: str
    score: float
    log_evidence: float
    detectable_amplitude: float
    concealment: float
    reason: str
    delta_bic: float | None = None
    explained_fraction: float | None = None

    def is_seen_within(self, span: float) -> bool:
        """Whether a change no larger than the response's own span would have been detected.

        Args:
            span: peak to peak of the response [response unit].

        Returns:
            True if it would.
        """
        return self.detectable_amplitude <= span


@dataclass(frozen=True)
class NamedEffect:
    """An effect that the recording shows, with its parameters and its look-alikes.

    Attributes:
        name: the effect's name.
        site: where its block is inserted.
        probability: that the name is right, 0 to 1.
        explained_fraction: the share that it explains of what `explains` names, 0 to 1.
        parameters: its parameters, each with its own unit.
        confusable_with: the effects that this recording does not distinguish from it.
        explains: what it explains, in words.
    """

    name: str
    site: str
    probability: float
    explained_fraction: float
    parameters: tuple[Estimate, ...]
    confusable_with: tuple[str, ...]
    explains: str = "the excess over the noise"


@dataclass(frozen=True)
class Axis:
    """Where along one axis the mismatch stands out.

    Attributes:
        axis: the axis' name.
        unit: unit of the axis, "1" if dimensionless.
        edges: of the bins (n+1,), in `unit`.
        strength: the |z|-equivalent of each bin (n,), dimensionless.
        threshold: the strength that 1 % of recordings without a mismatch exceed anywhere on the
            axis, dimensionless.
        intervals: the bins above the threshold, adjacent ones joined, in `unit`.  On the axis of a
            named effect, if there are none, the bins where the change by the effect is at least
            half as strong as at its maximum.
        p_value: of the whole axis, dimensionless.
        excess: the χ² that the bins together explain of the residual, minus its expectation and
            three standard deviations under noise alone, dimensionless.
    """

    axis: str
    unit: str
    edges: np.ndarray
    strength: np.ndarray
    threshold: float
    intervals: tuple[tuple[float, float], ...]
    p_value: float
    excess: float = 0.0


@dataclass(frozen=True)
class HeldOut:
    """Scores on data that no fit has used.

    Attributes:
        method: what was held out: a recording, or stretches in turn.
        base_rmse: RMSE of the base model [response unit].
        extended_rmse: RMSE of the extended model [response unit]; None without one.
        base_folds: RMSE of the base model in each fold that the others determine [response unit].
        extended_folds: RMSE of the extended model in each of these folds [response unit].
        source: the name of the held-out recording, "" for stretches.
        predicted: the recording and what the models predict of it, None for stretches.
    """

    method: str
    base_rmse: float
    extended_rmse: float | None
    base_folds: tuple[float, ...]
    extended_folds: tuple[float, ...]
    source: str
    predicted: Predicted | None = None


@dataclass(frozen=True)
class Shape:
    """How far the loop's shape is from the model's.

    Attributes:
        rms: of what rate-independent loop shapes add to the model's response, in `unit`.
        unit: the response's.
        share: of the mismatch that they explain, 0 to 1.
        model: the name of the base model.
    """

    rms: float
    unit: str
    share: float
    model: str

    @property
    def summary(self) -> str:
        """The same in words."""
        return (
            f"The loop's shape differs from that of {self.model} by "
            f"{figure(self.rms, 2)} {pretty_unit(self.unit)} rms, {percent(self.share)} of the "
            "mismatch"
        )


@dataclass(frozen=True)
class NextExperiment:
    """What to record next, and which effects it would distinguish.

    Attributes:
        sentence: the proposal in words.
        separates: the effects that it distinguishes.
        probability: with which it does, 0 to 1; None where there are none to distinguish.
        drive: the proposed drive.
    """

    sentence: str
    separates: tuple[str, ...]
    probability: float | None
    drive: Drive


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """What a model does not explain in a recording, where, and which physics would explain it.

    Attributes:
        verdict: "none", "missing", "confusable" or "unexplained".
        sentence: the diagnosis in words.
        base: the fit of the base model.
        extended: the fit with the named effects, or None.
        effects: the effects that are named.
        candidates: all effects of the catalogue, those with the most evidence first.
        axes: the axes along which the mismatch was located, the most significant first.
        where: the place of the mismatch in words.
        noise: the noise of the first recording [response unit].
        numerics: discretisation error as a share of the noise, dimensionless.
        p_value: of the residual, if the base model were right.
        held_out: the scores of both models on data that no fit has used.
        next_experiment: what to record next, or None.
        warnings: reasons for doubt, in words.
        shape: how far the loop's shape is from the model's, None where another law does not
            predict better.
        can_show: the smallest size of each effect of dynamics that the recordings would show,
            whatever their law of hysteresis, from drive and noise alone.
        complete: false if the time was over, or the user interrupted, before all refits were made.
    """

    verdict: Verdict
    sentence: str
    base: Fit
    extended: Fit | None
    effects: tuple[NamedEffect, ...]
    candidates: tuple[Candidate, ...]
    axes: tuple[Axis, ...]
    where: str
    noise: Noise
    numerics: float
    p_value: float
    held_out: HeldOut
    next_experiment: NextExperiment | None
    warnings: tuple[str, ...]
    shape: Shape | None = None
    can_show: tuple[Visible, ...] = ()
    complete: bool = True

    @property
    def extended_model(self) -> Model:
        """The model with the named effects, or the base model if there are none."""
        return self.fit.model

    @property
    def fit(self) -> Fit:
        """The fit with the named effects, or that of the base model if there are none."""
        return self.extended or self.base

    @cached_property
    def linear_approximations(self) -> tuple[LinearApproximation, ...]:
        """The best linear approximations about the levels of the recordings' small tones."""
        takes = self.base.preparation.takes
        return tuple(one for t in takes for one in best_linear_approximations(t.recording))

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> np.ndarray:
        """The response that the model with the named effects predicts, as `Fit.predict`.

        Args:
            drive: (N,) in the recording's drive unit, or a recording in the same units.
            step: the time between samples [s], by default that of the first recording.
            history: the drive before the first sample, by default as in the first recording.

        Returns:
            The response (N,) in the recording's response unit, offset included.
        """
        return self.fit.predict(drive, step, history)

    def plot(self, recording: int = 0) -> Drawing:
        """Draw the residual without and with the named effects, and the evidence for each effect.

        Args:
            recording: which of the recordings, from 0.

        Returns:
            A matplotlib figure, in the recording's units.

        Raises:
            InputError: where there is no such recording.
        """
        from ._picture import draw_diagnosis

        take = item(self.base.preparation.takes, recording, "recording")
        fits = [self.base] if self.extended is None else [self.base, self.extended]
        named = [effect.name for effect in self.effects]
        evidence = {c.name: (c.score, c.name in named) for c in self.candidates}
        simulations = {fit.model.name: fit.simulations[recording] for fit in fits}
        return draw_diagnosis(take, self.noise, simulations, evidence)

    def plot_residuals(self, recording: int = 0) -> Drawing:
        """Draw the tests of the residual that remains with the named effects.

        Args:
            recording: which of the recordings, from 0.

        Returns:
            A matplotlib figure, the residual in units of the noise.

        Raises:
            InputError: where there is no such recording.
        """
        return self.fit.plot_residuals(recording)

    def to_dataframe(self) -> pd.DataFrame:
        """The candidates as a table, a row per effect of the catalogue.

        Returns:
            A pandas table with the attributes of `Candidate`, in their units.
        """
        import pandas as pd

        return pd.DataFrame([vars(candidate) for candidate in self.candidates]).set_index("name")

    def _view(self) -> View:
        unit = self.noise.unit
        extended = self.extended
        scores = [
            ["rmse, fitted", quantity(self.base.scores.rmse, unit)],
            ["rmse, held out", quantity(self.held_out.base_rmse, unit)],
            ["noise floor", f"{quantity(self.noise.sigma, unit)} ({self.noise.method})"],
        ]
        headers = ["", self.base.model.name]
        if extended is not None:
            headers.append(extended.model.name)
            scores[0].append(quantity(extended.scores.rmse, unit))
            scores[1].append(quantity(self.held_out.extended_rmse, unit))
            scores[2].append("")
        parameters = [
            [effect.name, *list(estimate_row(estimate).values())]
            for effect in self.effects
            for estimate in effect.parameters
        ]
        candidates = [[c.name, figure(c.score), c.reason] for c in self.candidates]
        following = [] if self.next_experiment is None else [self.next_experiment.sentence]
        return View(
            f"{self.verdict}: {self.sentence}",
            [
                Table(headers, scores),
                Table(["effect", "parameter", "value", "95 % interval", "unit", ""], parameters),
                Table(["candidate", "|z|", ""], candidates, detail=True),
            ],
            [self.where, *self.warnings, *following],
        )

    def to_dict(self) -> dict:
        """The diagnosis as plain data, with its units, as in diagnosis.json.

        Returns:
            The content of the file, by the schema fracjax.diagnosis/1.
        """
        takes = self.base.preparation.takes
        scores: dict = {"unit": takes[0].recording.response_unit, "noise_floor": self.noise.sigma}
        scores["base"] = _scores(self.base, self.held_out.base_rmse)
        if self.extended is not None and self.held_out.extended_rmse is not None:
            scores["extended"] = _scores(self.extended, self.held_out.extended_rmse)
            scores["extended"]["model"] = self.extended.model.name
        result: dict = {
            "schema": SCHEMA,
            "model": self.base.model.name,
            "recordings": [take.recording.source for take in takes],
            "verdict": self.verdict,
            "sentence": self.sentence,
            "p_value": self.p_value,
            "noise": {
                "sigma": self.noise.sigma,
                "unit": self.noise.unit,
                "method": self.noise.method,
            },
            "numerics": {"error_over_noise": self.numerics},
            "effects": [
                {
                    "name": e.name,
                    "site": e.site,
                    "probability": e.probability,
                    "explained_fraction": e.explained_fraction,
                    "parameters": {
                        p.name: {
                            "value": p.value,
                            "low": p.interval[0],
                            "high": p.interval[1],
                            "unit": p.unit,
                        }
                        for p in e.parameters
                    },
                    "confusable_with": list(e.confusable_with),
                }
                for e in self.effects
            ],
            "candidates": [
                {k: v for k, v in vars(c).items() if v is not None} for c in self.candidates
            ],
            "where": {
                "summary": self.where,
                "axes": [
                    {
                        "axis": a.axis,
                        "unit": a.unit,
                        "p_value": a.p_value,
                        "intervals": [list(i) for i in a.intervals],
                        "edges": a.edges.tolist(),
                        "strength": a.strength.tolist(),
                        "threshold": a.threshold,
                    }
                    for a in self.axes
                ],
            },
            "fit": scores,
            "held_out": {
                "method": self.held_out.method,
                "source": self.held_out.source,
                "base_folds": list(self.held_out.base_folds),
                "extended_folds": list(self.held_out.extended_folds),
            },
            "warnings": list(self.warnings),
            "can_show": [vars(shown) for shown in self.can_show],
            "linear_approximations": [one.to_dict() for one in self.linear_approximations],
            "complete": self.complete,
        }
        if self.shape is not None:
            result["shape"] = vars(self.shape) | {"summary": self.shape.summary}
        if self.next_experiment is not None:
            result["next_experiment"] = {
                "sentence": self.next_experiment.sentence,
                "separates": list(self.next_experiment.separates),
                "probability": self.next_experiment.probability,
                "drive": self.next_experiment.drive.description,
            }
        return result

    def save(self, path: str | Path) -> None:
        """Write diagnosis.json.

        Args:
            path: of the file, which is overwritten.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def _scores(fit: Fit, holdout_rmse: float) -> dict:
    """The scores of one fit as plain data, errors in the response's unit."""
    return {
        "train_rmse": fit.scores.rmse,
        "holdout_rmse": holdout_rmse,
        "bic": fit.scores.bic,
        "nrmse_percent": fit.scores.nrmse_percent,
        "r_squared": fit.scores.r_squared,
    }
