r"""Fits of linear laws to a measured frequency response.

    min_θ Σ_k (Re ε_k / σ_A,k)² + (Im ε_k / σ_φ,k)²,      ε_k = 1 - G(j2πf_k; θ)/G_k

To first order Re ε = ln |G_k/G| and Im ε = arg G_k/G: the errors of a frequency-response analyser
are relative ones of the amplitude, and angles, over decades of amplitude.  Unlike the complex
logarithm ε knows no winding of the phase, and it is linear in the gains, which are eliminated.
Without errors all σ are one number, read from what is left over.
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
from .._fit import SCHEMA, Combination, Estimate, uncertainty_of
from .._models import Model, as_model
from .._parameters import named_parameters, set_values
from .._prepare import Conditions, OfModel, conditioned, whole
from .._recording import InputError, require_kind
from .._solve import Objective, Progress, begin, descend, silent, starts_of
from ._table import FrequencyTable

_LOOKS = 60
_DECIBEL = 20 / np.log(10)


class FrequencyProblem(eqx.Module):
    """A table as a fit sees it: [Re; Im] (2F,) of G/G_k, which shall be 1, and what whitens it."""

    table: FrequencyTable = eqx.field(static=True)
    response: np.ndarray
    weights: np.ndarray
    own: np.ndarray

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """G/G_k (2F,) and its derivatives (2F, Σ size) with respect to the named parameters."""
        assert isinstance(block, AbstractLinearBlock)  # asked for at the border
        s = jnp.asarray(2j * np.pi * self.table.frequencies_Hz)
        response, columns = (np.asarray(a) for a in _symbols(block, tuple(names), s))
        relative = (np.concatenate([response[:, None], columns], axis=1).T / self.table.response).T
        both = np.concatenate([relative.real, relative.imag])
        return both[:, 0], both[:, 1:]

    def whiten(self, signals: Any) -> np.ndarray:
        """Signals (2F, …) in units of their errors."""
        return (np.transpose(signals) * self.weights).T

    @property
    def size(self) -> float:
        """Length of the whitened response."""
        return float(np.linalg.norm(self.whiten(self.response)))


@compiled
def _symbols(block: AbstractLinearBlock, names: tuple[str, ...], s: Array) -> tuple[Array, Array]:
    """G (F,) and its derivatives (F, Σ size), complex."""
    parameters = named_parameters(block)
    flat, unravel = ravel_pytree([jnp.asarray(parameters[name].value) for name in names])

    def response(vector: Array) -> Array:
        moved = set_values(block, dict(zip(names, unravel(vector), strict=True)))
        found = moved.symbol(s)
        return jnp.stack([jnp.real(found), jnp.imag(found)])

    derivative = jax.jacfwd(response)(flat) if names else jnp.zeros((2, s.size, 0))
    return block.symbol(s), derivative[0] + 1j * derivative[1]


def _complex(both: np.ndarray) -> np.ndarray:
    """[Re; Im] (2F,) as complex numbers (F,)."""
    real, imaginary = np.split(both, 2)
    return real + 1j * imaginary


@dataclass(frozen=True)
class FrequencyFit:
    """A linear law fitted to a frequency response.

    `fitted` (F,) is the model's, complex, in response unit per drive unit.  `amplitude_rms_dB` and
    `phase_rms_deg` are what is left of amplitude [dB] and phase [degrees], `e_r` =
    ‖G_k - G‖/‖G_k‖; `bic` is χ² + n ln 2F where the errors are known, 2F ln χ² + n ln 2F where not.
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
        """A frequency response has none."""
        return ()

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in fit.json; `load_model` reads the model back."""
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
            **self.conditions.to_dict(),
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
        """Write fit.json."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def fit_frequency_response(
    model: Model | str,
    table: FrequencyTable,
    *,
    starts: int = 16,
    seed: int = 0,
    progress: Progress = silent,
    **asked: Unpack[OfModel],
) -> FrequencyFit:
    """Fit a linear model to a measured frequency response.

    The table's amplitudes are in response unit per drive unit, over frequencies [Hz].  What is
    `asked` of the model is as in `fit`.  Raises InputError for a model that has no transfer
    function, for unknown names, and for fewer numbers in the table than the model has parameters.
    """
    model = as_model(model)
    require_kind(table, FrequencyTable, "table", "make one by frequency_table(...)")
    starts, seed = whole(starts, "starts", 1), whole(seed, "seed", 0)
    with computing():
        progress(f"fitting {model.name}")
        if not isinstance(model.block, AbstractLinearBlock):
            raise InputError.at(
                f'model "{model.name}"',
                "a linear law given by its transfer function",
                "one that is not",
                "fit it to a recording, or choose lfdh, creep or pea_dynamics",
            )
        block, conditions = conditioned(model, **asked)
        problem, known = _problem_of(table)
        objective = Objective(block, (problem,), conditions)
        free = len(objective.numbers.labels)
        freedom = 2 * len(table) + len(conditions.priors) - free
        if freedom < 1:
            raise InputError.at(
                table.source,
                f"more than {free} amplitudes and phases for {free} parameters",
                f"{2 * len(table)}",
                "measure more frequencies, or fix parameters",
            )
        descents = [
            descend(begin(start, (problem,), conditions), _LOOKS)
            for start in starts_of(block, starts, seed)
        ]
        best = min(descents, key=lambda d: d.cost)
        point = best.objective.at(best.position)
        residual = point.residual[: 2 * len(table)]
        cost = float(residual @ residual)
        spread = float(np.sqrt(cost / freedom))
        uncertain = uncertainty_of(
            point.blocks,
            (problem,),
            conditions,
            units=(table.drive_unit, table.response_unit),
            inflation=max(1.0, spread) if known else spread,
        )
        fitted_block = jax.tree_util.tree_map(np.asarray, point.blocks[0])
        symbols = table.response * _complex(problem.linearised(fitted_block, ())[0])
    ratio = symbols / table.response
    count = 2 * len(table)
    return FrequencyFit(
        model=Model(fitted_block, model.name),
        table=table,
        conditions=conditions,
        estimates=uncertain.estimates,
        correlated=uncertain.correlated,
        combinations=uncertain.combinations,
        fitted=symbols,
        amplitude_rms_dB=float(_DECIBEL * np.sqrt(np.mean(np.log(np.abs(ratio)) ** 2))),
        phase_rms_deg=float(np.degrees(np.sqrt(np.mean(np.angle(ratio) ** 2)))),
        e_r=float(np.linalg.norm(table.response - symbols) / np.linalg.norm(table.response)),
        bic=float((cost if known else count * np.log(cost)) + free * np.log(count)),
        converged=bool(best.converged and np.isfinite(best.cost)),
        start_costs=tuple(d.cost for d in descents),
    )


def _problem_of(table: FrequencyTable) -> tuple[FrequencyProblem, bool]:
    """The table whitened by its errors, and whether it has any; one kind stands for the other."""
    one, other = table.amplitude_errors, table.phase_errors
    known = [errors for errors in (one, other) if errors is not None]
    equal = known[0] if known else np.ones(len(table))
    errors = [equal if given is None else given for given in (one, other)]
    count = len(table)
    return FrequencyProblem(
        table=table,
        response=np.concatenate([np.ones(count), np.zeros(count)]),
        weights=1 / np.concatenate(errors),
        own=np.zeros((2 * count, 0)),
    ), bool(known)
