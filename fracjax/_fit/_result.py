"""The result of a fit: plain data, saved and read back without loss."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from .._blocks import Setting
from .._models import Model, parse_model
from .._prepare import Preparation
from .._recording import InputError
from ._combinations import Combination
from ._estimate import Estimate
from ._robust import Robust

SCHEMA = "fracjax.fit/1"

Interval = tuple[float | None, float | None]


@dataclass(frozen=True)
class Profile:
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


@dataclass(frozen=True)
class Fit:
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
        combinations: well-determined combinations of strongly correlated parameters.
        residual_order: the order of the whitened residual's autoregression, for which the standard
            errors allow.
        robust: how a robust loss weighted the samples, None for least squares.
        profiles: the profiles that were requested.
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
    combinations: tuple[Combination, ...] = ()
    residual_order: int = 0
    robust: Robust | None = None
    profiles: tuple[Profile, ...] = ()

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

    def to_dict(self) -> dict:
        """The fit as plain data, as in fit.json.

        Returns:
            Model, parameters, scores and assumptions by name.
        """
        first = self.preparation.takes[0]
        noise = first.noise
        assert noise is not None  # fit() always ends with a noise model
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
            "known_only_together": list(self.correlated),
            "combinations": [combination.to_dict() for combination in self.combinations],
            **self.preparation.conditions.to_dict(self.model.block),
            "offsets": list(self.offsets),
            "scores": asdict(self.scores),
            "noise": {"sigma": noise.sigma, "unit": noise.unit, "method": noise.method},
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
