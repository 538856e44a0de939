"""Models compared on the same recordings: on the data fitted, and on data held out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import log
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._computing import computing
from .._models import Model
from .._operators import History
from .._recording import InputError, Recording, item, require_units_of
from .._show import Shown, Table, View, figure, quantity
from .._solve import Progress, silent
from ._fit import Fit, fit
from ._held_out import (
    FOLDS,
    HeldOutScores,
    Predicted,
    prediction,
    scores_of_predictions,
    scores_on_stretches,
)

if TYPE_CHECKING:
    import pandas as pd

    from .._show.drawing import Drawing

SCHEMA = "fracjax.comparison/2"
_REFUTED = 2.0
"""Ratio of a model's error on data held out to that of another from which it is refuted, whatever
its BIC, which takes every correlated sample for a new one.  Chosen by judgement."""


@dataclass(frozen=True)
class Row:
    """One model of a comparison.

    Attributes:
        model: the model's name.
        parameters: the number of free parameters, offsets included.
        rmse: on the data fitted, in the response's unit.
        e_r: ‖y-ŷ‖/‖y - mean‖ on the data fitted, dimensionless.
        nrmse_percent: 100 (1 - e_r), dimensionless.
        bic: dimensionless, comparable between models whose noise was read from their own residuals.
        unseen: scores on the data held out, None where there are too few samples.
        converged: whether the fit has converged.
    """

    model: str
    parameters: int
    rmse: float
    e_r: float
    nrmse_percent: float
    bic: float
    unseen: HeldOutScores | None
    converged: bool


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """Fits of several models to the same recordings, best first: by BIC, those last that data held
    out refute, where another predicts them with half of the error.

    Attributes:
        fits: the fits.
        rows: one row per fit, errors in the response's unit.
        method: what was held out.
        predicted: the recordings that were held out, with the predictions.
    """

    fits: tuple[Fit, ...]
    rows: tuple[Row, ...]
    method: str
    predicted: tuple[Predicted, ...] = ()

    @property
    def best(self) -> str:
        """The name of the model with the least BIC of those that data held out do not refute."""
        return self.rows[0].model

    @property
    def refuted(self) -> tuple[str, ...]:
        """Sentences on models with a smaller BIC than the best that data held out refute."""
        best = self.rows[0]
        return tuple(
            f"{row.model} has a smaller BIC, and predicts data held out with an error "
            f"{figure(row.unseen.rmse / best.unseen.rmse)} times that of {best.model}: it is not "
            "chosen."
            for row in self.rows[1:]
            if row.unseen and best.unseen and row.bic < best.bic
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What data held out say against the order by BIC, in sentences."""
        rows = {row.model: row.unseen for row in self.rows}
        best, name = self.rows[0].unseen, self.best_unseen
        other = rows.get(name or "")
        if best is None or other is None or name == self.best:
            return self.refuted
        unit = self.fits[0].noise.unit
        return (
            *self.refuted,
            f"On data held out {name} has the smaller error, {quantity(other.rmse, unit)}; "
            f"{self.best} has {quantity(best.rmse, unit)}.",
        )

    @property
    def best_unseen(self) -> str | None:
        """The name of the model with the least rmse on data held out, None where none is scored."""
        scored = [(row.unseen.rmse, row.model) for row in self.rows if row.unseen is not None]
        return min(scored)[1] if scored else None

    def _view(self) -> View:
        unit = self.fits[0].noise.unit
        headers = ["", "free", f"rmse, fitted [{unit}]", f"rmse, held out [{unit}]", "BIC", ""]
        rows = [
            [
                row.model,
                f"{row.parameters}",
                figure(row.rmse),
                figure(row.unseen.rmse if row.unseen else None),
                f"{row.bic:.1f}",
                "" if row.converged else "not converged",
            ]
            for row in self.rows
        ]
        unseen = f", on data held out {self.best_unseen}" if self.best_unseen else ""
        by = "of those that data held out do not refute" if self.refuted else "by BIC"
        if self.best == self.best_unseen:
            by, unseen = "on data held out" if self.refuted else "by BIC and on data held out", ""
        best = f"best {by} is {self.best}{unseen}"
        return View(
            f"{len(self.rows)} models compared: {best}.",
            [Table(headers, rows)],
            [f"Held out: {self.method}.", *self.remarks],
        )

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> np.ndarray:
        """The response that the best model predicts, as `Fit.predict`.

        Args:
            drive: (N,) in the recording's drive unit, or a recording in the same units.
            step: the time between samples [s], by default that of the first recording.
            history: the drive before the first sample, as in `Fit.predict`.

        Returns:
            The response (N,) in the recording's response unit, offset included.

        Raises:
            InputError: as `Fit.predict` does.
        """
        return self.fits[0].predict(drive, step, history)

    def plot(self) -> Drawing:
        """Draw the rms error of each model on the data fitted and on data held out.

        Returns:
            A matplotlib figure, in the response's unit.
        """
        from ._pictures import draw_errors

        unseen = [row.unseen.rmse if row.unseen else np.nan for row in self.rows]
        names, fitted = [row.model for row in self.rows], [row.rmse for row in self.rows]
        return draw_errors(names, fitted, unseen, self.fits[0].noise)

    def plot_residuals(self, recording: int = 0) -> Drawing:
        """Draw the residual of each model over time, with the noise band.

        Args:
            recording: which of the recordings, from 0.

        Returns:
            A matplotlib figure, in the recording's units.

        Raises:
            InputError: where there is no such recording.
        """
        from ._pictures import draw_residuals

        first = self.fits[0]
        take = item(first.preparation.takes, recording, "recording")
        simulations = [one.simulations[recording] for one in self.fits]
        names = [one.model.name for one in self.fits]
        return draw_residuals(take, take.noise or first.noise, names, simulations)

    def to_dataframe(self) -> pd.DataFrame:
        """The scores as a table, a row per model.

        Returns:
            A pandas table; errors in the response's unit.
        """
        import pandas as pd

        rows = [asdict(row) for row in self.rows]
        for row in rows:
            unseen = row.pop("unseen") or {}
            row |= {f"held_out_{name}": unseen.get(name, np.nan) for name in ("rmse", "e_r")}
        return pd.DataFrame(rows).set_index("model")

    def to_dict(self) -> dict[str, Any]:
        """The comparison as plain data, as in comparison.json.

        Returns:
            The rows, the fits and the names of the best models.
        """
        return {
            "schema": SCHEMA,
            "best": self.best,
            "best_on_held_out": self.best_unseen,
            "held_out": self.method,
            "rows": [asdict(row) for row in self.rows],
            "fits": [
                {"bic": row.bic, **fit.to_dict()}
                for row, fit in zip(self.rows, self.fits, strict=True)
            ],
        }

    def save(self, path: str | Path) -> None:
        """Write comparison.json.

        Args:
            path: the file to write.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def compare(
    models: Sequence[Model | str],
    recordings: Recording | Sequence[Recording],
    *,
    holdout: Recording | Sequence[Recording] | None = None,
    progress: Progress = silent,
    **options: Any,
) -> Comparison:
    """Fit several models to the same recordings and score them on data held out.

    Args:
        models: models, or their names.
        recordings: one recording or several, with their units.
        holdout: recordings that no fit uses; without them, stretches of the recordings themselves
            are held out in turn.
        progress: called with a sentence at each stage.
        options: those of `fit`.

    Returns:
        The fits, best first, with scores on the data fitted and held out.

    Raises:
        InputError: as `fit` does, where no model is given, and where the holdout has other units.
    """
    fits = [fit(model, recordings, progress=progress, **options) for model in models]
    return compare_fits(fits, holdout=holdout, progress=progress)


def compare_fits(
    fits: Sequence[Fit],
    *,
    holdout: Recording | Sequence[Recording] | None = None,
    progress: Progress = silent,
) -> Comparison:
    """Fits of the same recordings, ranked and scored as by `compare`.  Raises InputError."""
    held_out = [holdout] if isinstance(holdout, Recording) else list(holdout or ())
    if not fits:
        raise InputError("expected at least one model, found none; give one")
    for recording in held_out:
        require_units_of(fits[0].preparation.takes[0].recording, recording)
    rows = []
    with computing():
        for one, bic in rank_fits(fits):
            progress(f"scoring {one.model.name} on data held out")
            predictions = [prediction(one, recording) for recording in held_out]
            scores = (
                scores_of_predictions(predictions, held_out)
                if held_out
                else scores_on_stretches(one)
            )
            rows.append((one, bic, scores, predictions))
    least = min((scores.rmse for _, _, scores, _ in rows if scores), default=0.0)
    rows.sort(key=lambda row: row[2] is not None and row[2].rmse > _REFUTED * least)
    names = ", ".join(Path(recording.source).name for recording in held_out)
    return Comparison(
        fits=tuple(one for one, *_ in rows),
        rows=tuple(
            Row(
                model=one.model.name,
                parameters=len(one.estimates) + len(one.offsets),
                rmse=one.scores.rmse,
                e_r=one.scores.e_r,
                nrmse_percent=one.scores.nrmse_percent,
                bic=bic,
                unseen=scores,
                converged=one.converged,
            )
            for one, bic, scores, _ in rows
        ),
        method=names
        or f"{FOLDS} folds of stretches, each by a fit without it and the samples next to it",
        predicted=tuple(
            Predicted(
                recording,
                np.arange(len(recording)) >= rows[0][3][at][1],
                tuple(predictions[at][0] for *_, predictions in rows),
            )
            for at, recording in enumerate(held_out)
        ),
    )


def rank_fits(fits: Sequence[Fit]) -> list[tuple[Fit, float]]:
    """Fits of the same recordings with their BIC, best first.

    If a noise was read from the residuals, each fit has a noise of its own.  The BIC is then that
    of an unknown noise level, n ln(rmse²) + k ln n, which makes the fits comparable.
    """
    noises = [take.noise for one in fits for take in one.preparation.takes]
    if all(noise is not None and noise.method != "residual" for noise in noises):
        return sorted(((one, one.scores.bic) for one in fits), key=lambda pair: pair[1])
    count = int(sum(take.used.sum() for take in fits[0].preparation.takes))

    def bic(one: Fit) -> float:
        """The BIC of a noise with unknown level."""
        free = len(one.estimates) + len(one.offsets)
        return 2 * count * log(one.scores.rmse) + free * log(count)

    return sorted(((one, bic(one)) for one in fits), key=lambda pair: pair[1])
