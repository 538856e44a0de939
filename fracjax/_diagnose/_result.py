"""The diagnosis as plain data."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from .._fit import Estimate, Fit, estimate_row
from .._models import Model
from .._operators import History
from .._prepare import Noise
from .._recording import Recording, item
from .._show import Shown, Table, View, figure, quantity
from ._next_experiment import Drive

if TYPE_CHECKING:
    import pandas as pd

    from .._show.drawing import Drawing

SCHEMA = "fracjax.diagnosis/1"

Verdict = Literal["none", "missing", "confusable", "unexplained"]


@dataclass(frozen=True)
class Candidate:
    """One effect of the catalogue, tested against the recording.

    `score` is the largest |z| over its shapes and `log_evidence` the natural logarithm of the Bayes
    factor for it: the mean of BIC's and Laplace's after a refit, by which names are given, else the
    score's; `detectable_amplitude` the smallest rms change of the response, in the response's unit
    and before any refit, that would have been seen; `concealment` the share of its signature that
    the base model absorbs (0–1).  After a refit: `delta_bic` (base minus extended, positive is
    better) and `explained_fraction` of the excess residual; `held_out_gain` the fall of held-out
    RMSE as a share.  `reason` says in words why it was kept or rejected.
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
    held_out_gain: float | None = None

    def is_seen_within(self, span: float) -> bool:
        """Whether a change no larger than the response's own span would have been seen."""
        return self.detectable_amplitude <= span


@dataclass(frozen=True)
class NamedEffect:
    """An effect the recording shows, with its parameters and what it may be mistaken for.

    `explained_fraction` is the share that it takes of what `explains` says.
    """

    name: str
    site: str
    probability: float
    explained_fraction: float
    parameters: tuple[Estimate, ...]
    confusable_with: tuple[str, ...]
    explains: str = "what exceeds the noise"


@dataclass(frozen=True)
class Axis:
    """Where along one axis the mismatch stands out.

    `edges` (n+1,) bound the bins, in `unit`; `strength` (n,) is each bin's |z|-equivalent and
    `threshold` the level that 1 % of clean recordings exceed anywhere on the axis; `intervals` are
    the bins above it, joined where they touch; on a named effect's own axis, where there are none,
    those where what it changes is at least half as strong as anywhere.  `excess` is the χ² that the
    bins together take from the residual beyond three standard deviations of what noise would give
    them.
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
    """Scores on data no fit has seen: RMSE per fold, for the base and the extended model.

    `method` says what was held out; of stretches those count that the others foretell better than
    the models differ.  `source` names the recording where it is one of its own.
    """

    method: str
    base_rmse: float
    extended_rmse: float | None
    base_folds: tuple[float, ...]
    extended_folds: tuple[float, ...]
    source: str


@dataclass(frozen=True)
class Shape:
    """How far the loop's shape is from the model's: what rate-independent loop shapes add to its
    response, rms, in `unit`, and the share of the mismatch that they carry."""

    rms: float
    unit: str
    share: float
    model: str

    @property
    def summary(self) -> str:
        """It in words."""
        return (
            f"The loop's shape differs from {self.model}'s by {self.rms:.2g} {self.unit} rms, "
            f"{100 * self.share:.3g} % of the mismatch"
        )


@dataclass(frozen=True)
class NextExperiment:
    """What to record next, and which effects it would tell apart."""

    sentence: str
    separates: tuple[str, ...]
    probability: float
    drive: Drive


@dataclass(frozen=True, repr=False)
class Diagnosis(Shown):
    """What a model leaves unexplained in a recording, where, and what physics would explain it.

    `verdict` is "none", "missing", "confusable" or "unexplained", and `sentence` says it in words.
    `base` and `extended` are the fits before and after, `effects` what was named and `candidates`
    all that were tried.  `axes`, the most telling first, and `where` place the mismatch.  `noise`
    is in the response's unit; `numerics`, the discretisation error, is a share of it.  `p_value` is
    that of a recording the base model explains; `held_out` scores both models on data no fit has
    seen.  `shape` says how far the loop's shape is from the model's, where it surely is, and
    `complete` is false where time or an interruption ended it with the verdict so far.
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
    complete: bool = True

    @property
    def extended_model(self) -> Model:
        """The model with the adopted effects, or the base model if there are none."""
        return self.fit.model

    @property
    def fit(self) -> Fit:
        """The fit with the adopted effects, or that of the base model if there are none."""
        return self.extended or self.base

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> np.ndarray:
        """The response that the model with the adopted effects predicts, as `Fit.predict`.

        Args:
            drive: (N,) in the recording's drive unit, or a recording in the same units.
            step: the time between samples [s], by default that of the first recording.
            history: the drive before the first sample, by default as in the first recording.

        Returns:
            The response (N,) in the recording's response unit, offset included.
        """
        return self.fit.predict(drive, step, history)

    def plot(self, recording: int = 0) -> Drawing:
        """Draw the residual without and with the adopted effects, and the evidence for each effect.

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
        """Draw the tests of the residual that remains with the adopted effects.

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
        """Plain data, as in diagnosis.json (schema fracjax.diagnosis/1)."""
        takes = self.base.preparation.takes
        unit = takes[0].recording.response_unit
        scores: dict = {"unit": unit, "noise_floor": self.noise.sigma}
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
            "complete": self.complete,
        }
        if self.shape is not None:
            result["shape"] = {
                "rms": self.shape.rms,
                "unit": self.shape.unit,
                "share": self.shape.share,
                "summary": self.shape.summary,
            }
        if self.next_experiment is not None:
            result["next_experiment"] = {
                "sentence": self.next_experiment.sentence,
                "separates": list(self.next_experiment.separates),
                "probability": self.next_experiment.probability,
                "drive": self.next_experiment.drive.description,
            }
        return result

    def save(self, path: str | Path) -> None:
        """Write diagnosis.json."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def _scores(fit: Fit, holdout_rmse: float) -> dict:
    return {
        "train_rmse": fit.scores.rmse,
        "holdout_rmse": holdout_rmse,
        "bic": fit.scores.bic,
        "nrmse_percent": fit.scores.nrmse_percent,
        "r_squared": fit.scores.r_squared,
    }
