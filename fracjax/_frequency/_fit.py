"""Fits of linear models to a measured frequency response.

    min_θ Σ_k (Re ε_k / σ_A,k)² + (Im ε_k / σ_φ,k)²,      ε_k = 1 - G(j2πf_k; θ)/G_k

To first order Re ε = ln |G_k/G| and Im ε = arg G_k/G.  These are the errors of a frequency-response
analyser: relative to the amplitude, and in angle, over decades of amplitude.  Unlike the complex
logarithm, ε has no phase wrapping, and it is linear in the gains, which are eliminated.
If no errors are given, all σ are equal and estimated from the residual.
Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012) chapter 9.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Unpack

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.flatten_util import ravel_pytree

from .._blocks import AbstractBlock, AbstractLinearBlock
from .._computing import compiled, computing
from .._fit import (
    SCHEMA,
    Combination,
    Estimate,
    combinations_among,
    parameter_table,
    uncertainty_of,
)
from .._models import Model, as_model
from .._naming import ByName
from .._parameters import named_parameters, set_values
from .._prepare import Conditions, ModelOptions, apply_options, require_whole_number
from .._recording import InputError, require_kind
from .._show import Shown, Table, View, figure
from .._solve import Objective, Progress, begin, descend, silent, starts_of
from ._table import FrequencyTable

_EVALUATIONS = 60
"""Most evaluations of the model in the descent from one start; chosen by judgement."""
_DECIBEL = 20 / np.log(10)


class FrequencyProblem(eqx.Module):
    """A frequency table as a least-squares problem.

    The target `response` (2F,) is [Re; Im] of G/G_k, which is 1; `weights` (2F,) whiten its errors;
    `own` (2F, 0) holds no columns.
    """

    table: FrequencyTable = eqx.field(static=True)
    response: np.ndarray
    weights: np.ndarray
    own: np.ndarray

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """G/G_k (2F,) as [Re; Im], and its derivatives (2F, Σ size) for the named parameters."""
        assert isinstance(block, AbstractLinearBlock)  # checked in fit_frequency_response
        s = jnp.asarray(2j * np.pi * self.table.frequencies_Hz)
        response, columns = (np.asarray(a) for a in _symbols(block, tuple(names), s))
        relative = (np.concatenate([response[:, None], columns], axis=1).T / self.table.response).T
        stacked = np.concatenate([relative.real, relative.imag])
        return stacked[:, 0], stacked[:, 1:]

    def whiten(self, signals: Any) -> np.ndarray:
        """Signals (2F, …) divided by the standard errors of the table."""
        return (np.transpose(signals) * self.weights).T

    @property
    def size(self) -> float:
        """Euclidean norm of the whitened response."""
        return float(np.linalg.norm(self.whiten(self.response)))


@compiled
def _symbols(block: AbstractLinearBlock, names: tuple[str, ...], s: Array) -> tuple[Array, Array]:
    """Complex G (F,) at s (F,) [rad/s] and its derivatives (F, Σ size) for the named parameters."""
    parameters = named_parameters(block)
    flat, unravel = ravel_pytree([jnp.asarray(parameters[name].value) for name in names])

    def response(vector: Array) -> Array:
        at_vector = set_values(block, dict(zip(names, unravel(vector), strict=True)))
        symbol = at_vector.symbol(s)
        return jnp.stack([jnp.real(symbol), jnp.imag(symbol)])

    derivative = jax.jacfwd(response)(flat) if names else jnp.zeros((2, s.size, 0))
    return block.symbol(s), derivative[0] + 1j * derivative[1]


def _complex(stacked: np.ndarray) -> np.ndarray:
    """Stacked real and imaginary parts (2F,) as complex numbers (F,)."""
    real, imaginary = np.split(stacked, 2)
    return real + 1j * imaginary


@dataclass(frozen=True, repr=False)
class FrequencyFit(Shown):
    """A linear model fitted to a frequency response.

    Attributes:
        model: The model with its fitted parameters.
        table: The measured frequency response.
        conditions: Priors and ties of the parameters.
        estimates: The parameters with standard errors and intervals, each in its unit.
        correlated: Pairs of parameters that are strongly correlated.
        combinations: Combinations of correlated parameters that the table determines.
        fitted: Frequency response of the model (F,), complex [response_unit/drive_unit].
        amplitude_rms_dB: Root mean square residual of the amplitude [dB].
        phase_rms_deg: Root mean square residual of the phase [degrees].
        e_r: Relative error ‖G_k - G‖/‖G_k‖.
        bic: χ² + n ln 2F for n parameters if the table has errors, otherwise 2F ln χ² + n ln 2F.
        converged: Whether the optimisation from the best start converged.
        start_costs: χ² reached from each start.
        warnings: What the user should know about the fit.
    """

    model: Model
    table: FrequencyTable
    conditions: Conditions
    estimates: tuple[Estimate, ...]
    correlated: tuple[str, ...]
    combinations: tuple[Combination, ...]
    fitted: np.ndarray
    amplitude_rms_dB: float
    phase_rms_deg: float
    e_r: float
    bic: float
    converged: bool
    start_costs: tuple[float, ...]
    warnings: tuple[str, ...] = ()

    @property
    def offsets(self) -> tuple[float, ...]:
        """Offsets of recordings; a frequency response has none."""
        return ()

    @property
    def parameters(self) -> ByName[Estimate]:
        """The estimates by name, each in its unit."""
        return ByName(self.model.block, ((e.name, e) for e in self.estimates))

    def _view(self) -> View:
        statistics = [
            ["frequencies", f"{len(self.table)}"],
            ["amplitude residual", f"{figure(self.amplitude_rms_dB)} dB rms"],
            ["phase residual", f"{figure(self.phase_rms_deg)} degrees rms"],
            ["BIC", f"{self.bic:.1f}"],
        ]
        state = "" if self.converged else "; not converged"
        return View(
            f"{self.model.name} fitted to {self.table.source}{state}.",
            [parameter_table(self.estimates, self.combinations), Table([], statistics)],
            self.warnings,
        )

    def to_dict(self) -> dict[str, Any]:
        """The fit as plain data, as in fit.json, from which `load_model` reads the model.

        Returns:
            A dictionary that JSON can store.
        """
        return {
            "schema": SCHEMA,
            "kind": "frequency response",
            "model": self.model.name,
            "setting": asdict(self.table.setting),
            "values": {n: np.asarray(p.value).tolist() for n, p in self.model.parameters.items()},
            "recordings": [self.table.source],
            "units": {"drive": self.table.drive_unit, "response": self.table.response_unit},
            "parameters": {e.name: e.to_dict() for e in self.estimates},
            "known_only_together": list(self.correlated),
            "combinations": [combination.to_dict() for combination in self.combinations],
            **self.conditions.to_dict(self.model.block),
            "scores": {
                "amplitude_rms_dB": self.amplitude_rms_dB,
                "phase_rms_deg": self.phase_rms_deg,
                "e_r": self.e_r,
                "bic": self.bic,
            },
            "frequencies_Hz": self.table.frequencies_Hz.tolist(),
            "amplitude": np.abs(self.fitted).tolist(),
            "phase_deg": np.degrees(np.unwrap(np.angle(self.fitted))).tolist(),
            "converged": self.converged,
            "warnings": list(self.warnings),
        }

    def save(self, path: str | Path) -> None:
        """Write the fit as fit.json.

        Args:
            path: The file to write.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def fit_frequency_response(
    model: Model | str,
    table: FrequencyTable,
    *,
    starts: int = 16,
    seed: int = 0,
    progress: Progress = silent,
    **options: Unpack[ModelOptions],
) -> FrequencyFit:
    """Fit a linear model to a measured frequency response.

        min_θ Σ_k (Re ε_k / σ_A,k)² + (Im ε_k / σ_φ,k)²,      ε_k = 1 - G(j2πf_k; θ)/G_k

    Args:
        model: The model, or its name.
        table: Frequencies [Hz] and the ratio of response to drive [response_unit/drive_unit].
        starts: Number of starting points.
        seed: Seed of the random starting points.
        progress: Called with a line of text at each stage.
        **options: Options for the model's parameters, such as fixed values, bounds and priors, as
            in `fit`.

    Returns:
        The fitted model, its parameters with uncertainties, and measures of the residual.

    Raises:
        InputError: The model has no transfer function, a name is unknown, or the table has fewer
            amplitudes and phases than the model has free parameters.

    Source: Pintelon & Schoukens, System Identification: A Frequency Domain Approach (2012)
    chapter 9.
    """
    model = as_model(model)
    require_kind(table, FrequencyTable, "table", "make one by frequency_table(...)")
    starts, seed = require_whole_number(starts, "starts", 1), require_whole_number(seed, "seed", 0)
    with computing():
        progress(f"fitting {model.name}")
        if not isinstance(model.block, AbstractLinearBlock):
            raise InputError.at(
                f'model "{model.name}"',
                "a linear model with a transfer function",
                "a model without one",
                "fit it to a recording, or choose lfdh, creep or pea_dynamics",
            )
        block, conditions = apply_options(model, **options)
        problem, errors_are_given = _problem_of(table)
        objective = Objective(block, (problem,), conditions)
        free = len(objective.parameters.labels)
        freedom = 2 * len(table) + len(conditions.priors) - free
        if freedom < 1:
            raise InputError.at(
                table.source,
                f"more than {free} amplitudes and phases for {free} parameters",
                f"{2 * len(table)}",
                "measure more frequencies, or fix parameters",
            )
        descents = [
            descend(begin(start, (problem,), conditions), _EVALUATIONS)
            for start in starts_of(block, starts, seed)
        ]
        best = min(descents, key=lambda descent: descent.cost)
        point = best.objective.at(best.position)
        residual = point.residual[: 2 * len(table)]
        cost = float(residual @ residual)
        scatter = float(np.sqrt(cost / freedom))
        uncertainty = uncertainty_of(
            point.blocks,
            (problem,),
            conditions,
            units=(table.drive_unit, table.response_unit),
            inflation=max(1.0, scatter) if errors_are_given else scatter,
        )
        fitted_block = jax.tree_util.tree_map(np.asarray, point.blocks[0])
        symbols = table.response * _complex(problem.linearised(fitted_block, ())[0])
    ratio = symbols / table.response
    count = 2 * len(table)
    return FrequencyFit(
        model=Model(fitted_block, model.name),
        table=table,
        conditions=conditions,
        estimates=uncertainty.estimates,
        correlated=uncertainty.correlated,
        combinations=combinations_among(uncertainty.estimates, uncertainty.correlation),
        fitted=symbols,
        amplitude_rms_dB=float(_DECIBEL * np.sqrt(np.mean(np.log(np.abs(ratio)) ** 2))),
        phase_rms_deg=float(np.degrees(np.sqrt(np.mean(np.angle(ratio) ** 2)))),
        e_r=float(np.linalg.norm(table.response - symbols) / np.linalg.norm(table.response)),
        bic=float((cost if errors_are_given else count * np.log(cost)) + free * np.log(count)),
        converged=bool(best.converged and np.isfinite(best.cost)),
        start_costs=tuple(descent.cost for descent in descents),
    )


def _problem_of(table: FrequencyTable) -> tuple[FrequencyProblem, bool]:
    """The table whitened by its errors, and whether it has any.

    If only one kind of errors is there, it is used for the other too.
    """
    amplitude_errors, phase_errors = table.amplitude_errors, table.phase_errors
    available = [errors for errors in (amplitude_errors, phase_errors) if errors is not None]
    substitute = available[0] if available else np.ones(len(table))
    errors = [
        substitute if column is None else column for column in (amplitude_errors, phase_errors)
    ]
    count = len(table)
    return FrequencyProblem(
        table=table,
        response=np.concatenate([np.ones(count), np.zeros(count)]),
        weights=1 / np.concatenate(errors),
        own=np.zeros((2 * count, 0)),
    ), bool(available)
