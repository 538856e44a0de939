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
    """Δχ² (K,) at values (K,) of a parameter, in `unit`.

    `estimate` and `standard_error` are the fit's.  Of the intervals an end is None where Δ stays
    below its level up to the parameter's bound, or as far as was looked.  `lower_found` says that a
    better fit than the fit itself was met: it had stopped short of the optimum.
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
        """Whether the data leave the 95 % interval open on a side."""
        return None in self.interval_95

    def to_dict(self) -> dict:
        """Plain data."""
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
    """How well a model reproduces a recording, over the samples that count.

    rmse (the papers' e_RMS) in the response's unit; e_r = ‖y-ŷ‖/‖y - mean‖; nrmse_percent is
    MATLAB's `compare`, 100 (1 - e_r); bic with the noise known.
    """

    rmse: float
    e_r: float
    nrmse_percent: float
    r_squared: float
    bic: float


@dataclass(frozen=True)
class Fit:
    """A fitted model with its uncertainty, scores and the assumptions it rests on.

    `simulations` are the model's responses at the recordings' samples, offset included, in the
    response's unit; `correlated` names parameters that the data only know together, `combinations`
    what they know of them; `warnings` are what later checks held against it.  `residual_order` is
    that of the whitened residual's autoregression, which the standard errors allow for; `robust`
    says how a robust loss weighed the samples; `profiles` are those that were asked for.  Where
    recordings have parameters of their own, `models` are theirs and `model` is the first's.
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
        """The recordings with the weights that a robust loss ended with."""
        if self.robust is None:
            return self.preparation
        return self.preparation.with_trust(self.robust.weights)

    @property
    def residuals(self) -> tuple[np.ndarray, ...]:
        """Measured minus simulated, (N,) per recording, in the response's unit."""
        pairs = zip(self.preparation.takes, self.simulations, strict=True)
        return tuple(take.recording.response - simulation for take, simulation in pairs)

    def to_dict(self) -> dict:
        """Plain data, as in fit.json."""
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
            **self.preparation.conditions.to_dict(),
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
        """Write fit.json; `load_model` reads the model back."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def load_model(path: str | Path) -> Model:
    """The fitted model from a fit.json.  Raises InputError where the file is none."""
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
