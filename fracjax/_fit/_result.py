"""The result of a fit: plain data, saved and read back without loss."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._blocks import Setting
from .._models import Model, parse_model
from .._naming import ByName
from .._operators import History
from .._prepare import Noise, Preparation
from .._recording import InputError, Recording, item
from .._show import Shown, Table, View, figure, quantity
from .._simulate import simulate, step_to_predict
from ._combinations import Combination, combinations_among
from ._estimate import Estimate
from ._grade import shortcomings_of
from ._linear import LinearSystem, to_control, to_scipy
from ._pooled import pooled
from ._robust import Robust
from ._rows import correlation_table, parameter_table
from ._whiteness import ResidualAnalysis, analyses_of

if TYPE_CHECKING:
    import pandas as pd

    from .._show.drawing import Drawing

SCHEMA = "fracjax.fit/1"

Interval = tuple[float | None, float | None]


@dataclass(frozen=True, repr=False)
class Profile(Shown):
    """The profile likelihood of a parameter: Δχ² at values of the parameter.

    Attributes:
        name: the parameter's name.
        unit: the parameter's unit.
        estimate: the fit's, in `unit`.
        standard_error: the fit's, in `unit`.
        values: (K,) in `unit`.
        delta: (K,) Δχ², dimensionless, 0 at its minimum.
        interval_68: its ends in `unit`; an end is None where Δ stays below its level up to the
            parameter's bound, or to the last point.
        interval_95: the same at 95 %.
        lower_found: whether a smaller χ² than the fit's was reached, so that the fit had not
            reached the optimum.

    Source: Venzon & Moolgavkar, Appl. Stat. 37 (1988) 87.
    """

    name: str
    unit: str
    estimate: float
    standard_error: float
    values: np.ndarray
    delta: np.ndarray
    interval_68: Interval
    interval_95: Interval
    lower_found: bool

    @property
    def open(self) -> bool:
        """Whether the 95 % interval is open on a side."""
        return None in self.interval_95

    def to_dict(self) -> dict:
        """The profile as plain data.

        Returns:
            The attributes by name, and `open`.
        """
        return {
            "name": self.name,
            "unit": self.unit,
            "estimate": self.estimate,
            "standard_error": self.standard_error,
            "values": self.values.tolist(),
            "delta": self.delta.tolist(),
            "interval_68": list(self.interval_68),
            "interval_95": list(self.interval_95),
            "open": self.open,
            "lower_found": self.lower_found,
        }


@dataclass(frozen=True)
class Scores:
    """How well a model reproduces the recordings, over the samples that count.

    Attributes:
        rmse: the papers' e_RMS, in the response's unit.
        e_r: ‖y-ŷ‖/‖y - mean‖, dimensionless.
        nrmse_percent: 100 (1 - e_r), as MATLAB's `compare`, dimensionless.
        r_squared: 1 - e_r², dimensionless.
        bic: χ² + k ln n, the noise being known, dimensionless.
    """

    rmse: float
    e_r: float
    nrmse_percent: float
    r_squared: float
    bic: float


@dataclass(frozen=True, repr=False)
class Fit(Shown):
    """A fitted model with its uncertainty, its scores and the assumptions of the fit.

    Attributes:
        model: the fitted model; where recordings have parameters of their own, the first
            recording's.
        preparation: the recordings with noise, history, weights and conditions.
        estimates: the free parameters with standard errors, in their units.
        correlated: pairs of parameters that are strongly correlated, as texts.
        offsets: each recording's offset, in the response's unit.
        simulations: per recording (N,) the model's response, offset included, in the response's
            unit.
        scores: on the data fitted.
        converged: whether the fit has converged.
        start_costs: χ² at the end of each start, dimensionless.
        warnings: sentences about doubts in the fit.
        models: each recording's model.
        residual_order: the order of the whitened residual's autoregression, for which the standard
            errors allow.
        robust: how a robust loss weighted the samples, None for least squares.
        profiles: the profiles that were requested.
        correlation: (n, n) of the estimates, dimensionless.
    """

    model: Model
    preparation: Preparation
    estimates: tuple[Estimate, ...]
    correlated: tuple[str, ...]
    offsets: tuple[float, ...]
    simulations: tuple[np.ndarray, ...]
    scores: Scores
    converged: bool
    start_costs: tuple[float, ...]
    warnings: tuple[str, ...] = ()
    models: tuple[Model, ...] = ()
    residual_order: int = 0
    robust: Robust | None = None
    profiles: tuple[Profile, ...] = ()
    correlation: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def parameters(self) -> ByName[Estimate]:
        """The estimates by name, each in its unit: `fit.parameters["resonance.damping"].value`."""
        return ByName(self.model.block, ((e.name, e) for e in self.estimates))

    @property
    def shown_estimates(self) -> tuple[Estimate, ...]:
        """The estimates as tables list them: weights of plays that the data do not tell apart as
        their sum, in their units."""
        first = self.preparation.takes[0].recording
        units = first.drive_unit, first.response_unit
        return pooled(self.estimates, self.correlation, self.model.block, units)

    @cached_property
    def combinations(self) -> tuple[Combination, ...]:
        """Well-determined combinations of strongly correlated parameters, in their units."""
        return combinations_among(self.estimates, self.correlation)

    @property
    def noise(self) -> Noise:
        """The noise of the first recording, in the response's unit."""
        noise = self.preparation.takes[0].noise
        assert noise is not None  # fit() always ends with a noise model
        return noise

    @property
    def weighed(self) -> Preparation:
        """The recordings with the final weights of a robust loss."""
        if self.robust is None:
            return self.preparation
        return self.preparation.with_trust(self.robust.weights)

    @property
    def residuals(self) -> tuple[np.ndarray, ...]:
        """Measured minus simulated, (N,) per recording, in the response's unit."""
        pairs = zip(self.preparation.takes, self.simulations, strict=True)
        return tuple(take.recording.response - simulation for take, simulation in pairs)

    @property
    def at_bound(self) -> tuple[str, ...]:
        """The parameters that ended on a bound."""
        return tuple(estimate.name for estimate in self.estimates if estimate.at_bound)

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """Why the model does not describe the recordings, as clauses; empty where it does."""
        scores = self.scores
        return shortcomings_of(scores.rmse, self.noise.sigma, scores.r_squared, self.at_bound)

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> np.ndarray:
        """The response that the fitted model predicts, as the first recording's sensor reads it.

        Args:
            drive: (N,) in the recording's drive unit, or a recording in the same units.
            step: the time between samples [s], by default that of the first recording.
            history: the drive before the first sample, as in `simulate`; by default as it was in
                the first recording, or "constant" where that was estimated.

        Returns:
            The response (N,) in the recording's response unit, offset included.

        Raises:
            InputError: where the drive is no finite signal, or a recording has other units.
        """
        take = self.preparation.takes[0]
        first = take.recording
        if history is None:
            history = "constant" if take.history == "estimated" else take.history
        units = first.drive_unit, first.response_unit
        step = step_to_predict(drive, step, first.dt, units, first.source)
        return np.asarray(simulate(self.model, drive, step, history).response) + self.offsets[0]

    def residual_tests(self) -> tuple[ResidualAnalysis, ...]:
        """The tests of the residual of each recording, as `analyse_residuals` makes them.

        Returns:
            One analysis per recording, the residual in units of the noise.
        """
        return analyses_of(self.preparation, self.residuals)

    def to_scipy(self, band: tuple[float, float] | None = None) -> LinearSystem:
        """The fitted linear model as a state space of SciPy, from drive to response.

        Powers of s become Oustaloup's filters, so that it holds on a band and to an error, which
        both come with it.  Its offset is that of the sensor, `offsets`, which is not part of it.

        Args:
            band: lowest and highest frequency [Hz]; by default from one period in the recording to
                half its sampling rate.

        Returns:
            The scipy.signal.StateSpace, the band [Hz] and the relative error.

        Raises:
            InputError: where the model is not linear, or holds more than powers of s.

        Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25.
        """
        return to_scipy(self.model, self._band if band is None else band)

    def to_control(self, band: tuple[float, float] | None = None) -> LinearSystem:
        """The fitted linear model as a state space of python-control, as `to_scipy`.

        Args:
            band: lowest and highest frequency [Hz], as in `to_scipy`.

        Returns:
            The control.StateSpace, the band [Hz] and the relative error.

        Raises:
            InputError: as in `to_scipy`, or where python-control is not installed.
        """
        return to_control(self.model, self._band if band is None else band)

    @property
    def _band(self) -> tuple[float, float]:
        """The frequencies [Hz] of which the first recording can hold a period."""
        recording = self.preparation.takes[0].recording
        return 1 / (len(recording) * recording.dt), 0.5 * recording.rate

    def plot(self, recording: int = 0) -> Drawing:
        """Draw measured and simulated response, and the residual, over the drive and over time.

        Args:
            recording: which of the recordings, from 0.

        Returns:
            A matplotlib figure, in the recording's units.

        Raises:
            InputError: where there is no such recording.
        """
        from ._pictures import draw_fit

        take = item(self.preparation.takes, recording, "recording")
        noise, simulation = take.noise or self.noise, self.simulations[recording]
        return draw_fit(take, noise, simulation, self.model.name)

    def plot_residuals(self, recording: int = 0) -> Drawing:
        """Draw the residual's distribution, its correlations and its level over time.

        Args:
            recording: which of the recordings, from 0.

        Returns:
            A matplotlib figure, the residual in units of the noise.

        Raises:
            InputError: where there is no such recording.
        """
        return item(self.residual_tests(), recording, "recording").plot()

    def to_dataframe(self) -> pd.DataFrame:
        """The parameters as a table, a row each by name.

        Returns:
            A pandas table: value, standard error and 95 % interval, in the unit that it states.
        """
        import pandas as pd

        return pd.DataFrame({e.name: e.to_dict() for e in self.estimates}).T

    def _view(self) -> View:
        recordings = [take.recording for take in self.preparation.takes]
        names = ", ".join(dict.fromkeys(Path(recording.source).name for recording in recordings))
        noise, scores = self.noise, self.scores
        floor = f"{quantity(noise.sigma, noise.unit)} ({noise.method})"
        ratio = f", {figure(scores.rmse / noise.sigma)} times the noise floor of {floor}"
        error = quantity(scores.rmse, noise.unit) + (ratio if noise.method != "residual" else "")
        state = "" if self.converged else "; not converged"
        used = sum(int(take.used.sum()) for take in self.preparation.takes)
        loss = "least squares" if self.robust is None else self.robust.loss
        statistics = [
            ["samples used", f"{used} of {sum(map(len, recordings))}"],
            ["free parameters and offsets", f"{len(self.estimates) + len(self.offsets)}"],
            ["rms error", quantity(scores.rmse, noise.unit)],
            ["noise floor", floor],
            ["NRMSE fit, R²", f"{scores.nrmse_percent:.5g} %, {scores.r_squared:.7g}"],
            ["BIC", f"{scores.bic:.1f}"],
            ["loss, starts", f"{loss}, {len(self.start_costs)}"],
        ]
        return View(
            f"{self.model.name} fitted to {names}: error {error}{state}.",
            [
                parameter_table(self.shown_estimates, self.combinations),
                Table([], statistics, detail=True),
                correlation_table([e.name for e in self.estimates], self.correlation),
            ],
            self.warnings,
        )

    def to_dict(self) -> dict:
        """The fit as plain data, as in fit.json.

        Returns:
            Model, parameters, scores and assumptions by name.
        """
        first = self.preparation.takes[0]

        return {
            "schema": SCHEMA,
            "model": self.model.name,
            "setting": asdict(self.preparation.setting),
            "values": {n: np.asarray(p.value).tolist() for n, p in self.model.parameters.items()},
            "recordings": [take.recording.source for take in self.preparation.takes],
            "units": {
                "drive": first.recording.drive_unit,
                "response": first.recording.response_unit,
            },
            "parameters": {e.name: e.to_dict() for e in self.estimates},
            "correlation": self.correlation.tolist(),
            "known_only_together": list(self.correlated),
            "combinations": [combination.to_dict() for combination in self.combinations],
            **self.preparation.conditions.to_dict(self.model.block),
            "offsets": list(self.offsets),
            "scores": asdict(self.scores),
            "noise": self.noise.to_dict(),
            "shortcomings": list(self.shortcomings),
            "assumptions": [
                {"history": t.history, "settling_samples": t.settling}
                for t in self.preparation.takes
            ],
            "samples_left_out": [
                int(np.count_nonzero(~t.used[t.settling :])) for t in self.preparation.takes
            ],
            "profiles": [profile.to_dict() for profile in self.profiles],
            "residual_order": self.residual_order,
            "loss": {"name": "least_squares"} if self.robust is None else self.robust.to_dict(),
            "oversampling": self.preparation.oversampling,
            "converged": self.converged,
            "warnings": list(self.warnings),
        }

    def save(self, path: str | Path) -> None:
        """Write fit.json; `load_model` reads the model back.

        Args:
            path: the file to write.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def load_model(path: str | Path) -> Model:
    """The fitted model from a fit.json.

    Args:
        path: the file that `Fit.save` wrote.

    Returns:
        The model with its fitted values.

    Raises:
        InputError: where there is no such file, or it is no fit of fracjax.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise KeyError(content["schema"])
        values = content["values"]
        model = parse_model(content["model"], Setting(**content["setting"]), values)
        return model.with_values(values)
    except FileNotFoundError:
        raise InputError(
            f"{path}: expected a fit.json, found no such file; check the path"
        ) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, ValueError):
        raise InputError(
            f'{path}: expected a fit saved by fracjax (schema "{SCHEMA}"), found something else; '
            "save it again by `fracjax fit`"
        ) from None
