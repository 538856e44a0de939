r"""Creep from amplitude ratios: by a straight line (TFOCIM), or with the dynamics (OFOCIM).

Both start from the ratio A_r of response to drive amplitude at several frequencies [F 15, 16].
TFOCIM takes log A_r to be linear in log ω; OFOCIM fits |G(jω)| of [F 20], so that a resonance
above the table does not pass for creep.
Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, section 4.3.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jax import Array
from jax.flatten_util import ravel_pytree
from numpy.typing import ArrayLike
from scipy.stats import f as fisher
from scipy.stats import t as student

from .._blocks import AbstractLinearBlock, Creep, PEADynamics
from .._computing import compiled, computing
from .._fit import is_at_bound, logarithmic_interval
from .._parameters import Parameter, named_parameters, set_values
from .._recording import InputError

SCHEMA = "fracjax.creep/1"
_DECIBEL = 20 / np.log(10)
_BOUNDED = ("mu", "frequency", "damping")
_MODES = 48
_DAMPINGS = np.array([0.003, 0.02, 0.1, 0.5])
_CURVATURES = np.array([-0.7, -0.3, -0.1, 0.1, 0.3, 0.7])
_SLOPES = np.array([-0.3, -0.08, -0.02, 0.0, 0.02, 0.08, 0.3])
_STARTS = 24
_FIRST_STEPS = 30
_STEPS = 200
_ROUGH = optx.LevenbergMarquardt(rtol=1e-3, atol=1e-3)
_EXACT = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)


@dataclass(frozen=True)
class CreepEstimate:
    """A parameter with its standard error and 95 % interval [low, high], in `unit`.

    `identified` is false where the table leaves it open: by more than half its plausible range, or,
    of a gain, by more than half the whole gain; and where the fit ended on a bound.
    """

    name: str
    value: float
    standard_error: float
    low: float
    high: float
    unit: str
    identified: bool


@dataclass(frozen=True)
class CreepIdentification:
    """Creep identified from amplitude ratios (F,) at frequencies (F,) [Hz].

    `block` is the law at its optimum: Creep [F 11] by TFOCIM, PEADynamics [F 20] by OFOCIM.
    `scatter_dB` is the residual's standard deviation, 20 log10 of the ratio, degrees of freedom
    counted; from it come the standard errors.
    """

    method: Literal["TFOCIM", "OFOCIM"]
    block: AbstractLinearBlock
    estimates: tuple[CreepEstimate, ...]
    scatter_dB: float
    converged: bool
    frequencies_Hz: np.ndarray
    ratios: np.ndarray
    fitted: np.ndarray

    def __getitem__(self, name: str) -> CreepEstimate:
        return next(e for e in self.estimates if e.name == name)

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Names of the parameters that the table leaves open."""
        return tuple(e.name for e in self.estimates if not e.identified)

    def to_dict(self) -> dict:
        """Plain data."""
        return {
            "schema": SCHEMA,
            "method": self.method,
            "parameters": {e.name: asdict(e) for e in self.estimates},
            "unidentified": list(self.unidentified),
            "scatter_dB": self.scatter_dB,
            "converged": self.converged,
            "frequencies_Hz": self.frequencies_Hz.tolist(),
            "ratios": self.ratios.tolist(),
            "fitted": self.fitted.tolist(),
        }


def tfocim(
    frequencies_Hz: ArrayLike, ratios: ArrayLike, standard_errors: ArrayLike | None = None
) -> CreepIdentification:
    r"""Creep k_c s^-μ by the straight line y = 20 log10 k_c - 20 μ x [F 11, 15, 16].

    x = log10 ω, y = 20 log10 A_r, ω [rad/s] from frequencies (F,) [Hz], A_r (F,) [response/drive].
    Standard errors of the ratios (F,), where given, weigh the points; how large the scatter is, the
    residual says in any case.  The 95 % intervals are Student's t.  A negative μ says that the
    ratio rises with frequency: dynamics, not creep.
    Raises InputError for fewer than 3 frequencies, or numbers that are not positive.
    """
    frequencies, ratio, weights = _table("TFOCIM", frequencies_Hz, ratios, standard_errors, 3)
    x, y = np.log10(2 * np.pi * frequencies), 20 * np.log10(ratio)
    line = np.stack([np.ones_like(x), -20 * x], axis=1)
    level, mu = np.linalg.lstsq(line * weights[:, None], y * weights, rcond=None)[0]
    fitted = line @ np.array([level, mu])
    freedom = x.size - 2
    scatter = float(np.sqrt(np.sum((weights * (y - fitted)) ** 2) / freedom))
    covariance = scatter**2 * _inverse_square(line * weights[:, None])
    level_error, mu_error = (float(e) for e in np.sqrt(np.diag(covariance)))
    reach, k_c = float(student.ppf(0.975, freedom)), float(10 ** (level / 20))
    gain = (k_c, k_c * level_error / _DECIBEL, reach, "response/drive*s^-mu")
    block = set_values(Creep(), {"k_c": k_c, "mu": mu})
    widest = 0.5 * np.ptp(block.mu.plausible)
    return CreepIdentification(
        method="TFOCIM",
        block=block,
        estimates=(
            _logarithmic("k_c", *gain, bool(gain[1] <= 0.5 * k_c)),
            _straight("mu", float(mu), mu_error, reach, "1", bool(mu_error <= widest)),
        ),
        scatter_dB=scatter,
        converged=True,
        frequencies_Hz=frequencies,
        ratios=ratio,
        fitted=10 ** (fitted / 20),
    )


def ofocim(
    frequencies_Hz: ArrayLike, ratios: ArrayLike, standard_errors: ArrayLike | None = None
) -> CreepIdentification:
    r"""Creep and dynamics together: |G(jω)| of [F 20] fitted to the logarithms of the ratios.

        ln A_r = ln |(g + g_μ (jω)^μ) / (1 + 2ζ jω/ω_0 - ω²/ω_0²)|

    The parameters are those of PEADynamics, and `creep_order`: the order of the creep k_c s^-μ
    [F 11] of the same slope at the geometric centre of the table, which is known even where g, g_μ
    and μ are only known together, as they are where the interval of μ holds 0.  Of a mode
    that the table does not show (F-test, 1 %) the intervals are the whole of its bounds.
    Levenberg–Marquardt from the best of a grid; standard errors from the Jacobian and the
    residual's scatter, 95 % intervals from Student's t (on a logarithmic scale for f_0 and ζ).
    Arguments as of `tfocim`.
    Raises InputError for fewer than 6 frequencies, or numbers that are not positive.
    """
    frequencies, ratio, weights = _table("OFOCIM", frequencies_Hz, ratios, standard_errors, 6)
    with computing():
        table = (jnp.asarray(frequencies), jnp.asarray(np.log(ratio)), jnp.asarray(weights))
        creeps, modes = _candidates(frequencies)
        shape, cost, success = _solve(creeps, modes, *table)
        without_mode = _solve(creeps, jnp.zeros((1, 1, 0)), *table)[1]
        amplitude, values, along = jax.tree_util.tree_map(np.asarray, _derivatives(shape, table[0]))
        centre = float(_centre(table[0]))
    freedom = frequencies.size - amplitude.shape[1]
    variance = float(cost) / freedom
    covariance = variance * _inverse_square(weights[:, None] * amplitude)
    errors = {name: float(np.sqrt(a @ covariance @ a)) for name, a in along.items()}
    order = float(values.pop("creep_order"))
    block = set_values(PEADynamics(), values)
    reach = float(student.ppf(0.975, freedom))
    level, power = float(np.exp(shape.log_level)), (2 * np.pi * centre) ** -float(block.mu.value)
    found = _estimates(block, order, errors, reach, level, power)
    shows = float(without_mode - cost) > 2 * variance * fisher.ppf(0.99, 2, freedom)
    return CreepIdentification(
        method="OFOCIM",
        block=block,
        estimates=found if shows else tuple(_open(e) for e in found),
        scatter_dB=_DECIBEL * float(np.sqrt(variance)),
        converged=bool(success),
        frequencies_Hz=frequencies,
        ratios=ratio,
        fitted=np.abs(np.asarray(block.symbol(2j * np.pi * frequencies))),
    )


class _Shape(eqx.Module):
    """|G| of [F 20] in coordinates that stay apart from each other where creep is slight.

    G = T (1 + q ((s/ω_m)^μ - 1)/μ) / (1 + 2ζ s/ω_0 + s²/ω_0²), ω_m the table's centre.  T is the
    level there, q the slope and μ the curvature; as μ goes to 0 it becomes 1 + q ln(s/ω_m), the
    logarithmic law, where g = T (1 - q/μ) and g_μ = T q/μ ω_m^-μ grow without bound.
    """

    log_level: Array
    slope: Array
    mu: Array
    log_frequency: Array
    log_damping: Array

    def log_amplitude(self, frequencies: Array, centre: Array) -> Array:
        """ln |G| (F,) at frequencies (F,) [Hz], centre [Hz]."""
        x = 1j * frequencies / jnp.exp(self.log_frequency)
        mode = 1 + 2 * jnp.exp(self.log_damping) * x + x * x
        return self.log_level + jnp.log(jnp.abs(self._creep(frequencies / centre) / mode))

    def _creep(self, ratio: Array | float) -> Array:
        logarithm = jnp.log(ratio) + 0.5j * np.pi
        z = self.mu * logarithm
        slight = jnp.abs(z) < 1e-4
        quotient = jnp.expm1(jnp.where(slight, 1.0, z)) / jnp.where(slight, 1.0, z)
        return 1 + self.slope * logarithm * jnp.where(slight, 1 + z / 2 + z * z / 6, quotient)

    def physical(self, centre: Array) -> dict[str, Array]:
        """The parameters of PEADynamics, and the order of the creep [F 11] of the same slope."""
        level, share = jnp.exp(self.log_level), self.slope / self.mu
        j = jnp.exp(0.5j * np.pi * self.mu)
        return {
            "gain": level * (1 - share),
            "creep_gain": level * share * (2 * np.pi * centre) ** -self.mu,
            "mu": self.mu,
            "frequency": jnp.exp(self.log_frequency),
            "damping": jnp.exp(self.log_damping),
            "creep_order": -jnp.real(self.slope * j / self._creep(1.0)),
        }


# The fit of OFOCIM: level, slope, and angles that keep μ, f_0 and ζ within their bounds ----------


def _shape_of(coordinates: Array) -> _Shape:
    """Five coordinates, or three: then the mode is at its highest frequency, out of reach."""
    parameters = named_parameters(PEADynamics())
    angles = jnp.append(coordinates[2:], jnp.array([np.pi / 2, 0.0]))[:3]
    mu, frequency, damping = (
        parameters[name].from_share((1 + jnp.sin(angle)) / 2)
        for name, angle in zip(_BOUNDED, angles, strict=True)
    )
    return _Shape(coordinates[0], coordinates[1], mu, jnp.log(frequency), jnp.log(damping))


def _candidates(frequencies: np.ndarray) -> tuple[Array, Array]:
    """Coordinates to start from, of creep (C, 3), its level 0, and of modes (R, D, 2): a row per
    frequency, from the table's lowest to ten times its highest."""
    parameters = named_parameters(PEADynamics())
    places = np.geomspace(frequencies.min(), 10 * frequencies.max(), _MODES)
    mu, frequency, damping = (
        jnp.arcsin(2 * parameters[name].to_share(values) - 1)
        for name, values in zip(_BOUNDED, (_CURVATURES, places, _DAMPINGS), strict=True)
    )
    slopes, mu = (jnp.ravel(axis) for axis in jnp.meshgrid(_SLOPES, mu))
    creeps = jnp.stack([jnp.zeros_like(mu), slopes, mu], axis=1)
    return creeps, jnp.stack(jnp.meshgrid(frequency, damping, indexing="ij"), axis=2)


def _centre(frequencies: Array) -> Array:
    return jnp.exp(jnp.mean(jnp.log(frequencies)))


@compiled
def _solve(
    creeps: Array, modes: Array, frequencies: Array, target: Array, weights: Array
) -> tuple[_Shape, Array, Array]:
    """Shape, weighted sum of squares of ln |G|, and whether more steps gain nothing.

    Of every row of modes (R, D, 2) the best is taken, with any creep (C, 3); of those the 24 best
    a few steps on, and the best of them to convergence.  Modes (1, 1, 0) stand for none.
    """

    def amplitude(coordinates: Array) -> Array:
        return _shape_of(coordinates).log_amplitude(frequencies, _centre(frequencies))

    def residual(coordinates: Array, _) -> Array:
        return weights * (target - amplitude(coordinates))

    def cost(coordinates: Array) -> Array:
        return jnp.nan_to_num(jnp.sum(residual(coordinates, None) ** 2), nan=jnp.inf)

    def search(start: Array, solver: optx.LevenbergMarquardt, steps: int) -> Array:
        return optx.least_squares(residual, solver, start, max_steps=steps, throw=False).value

    of_creeps = jax.vmap(amplitude)(creeps)

    def best(row: Array) -> Array:
        # Creep and mode multiply, so that their logarithms add.
        of_modes = jax.vmap(lambda mode: amplitude(jnp.append(jnp.zeros(3), mode)))(row)
        rest = target - of_modes[:, None] - of_creeps
        level = rest @ weights**2 / jnp.sum(weights**2)
        costs = (rest - level[..., None]) ** 2 @ weights**2
        mode, creep = jnp.unravel_index(jnp.argmin(costs), costs.shape)
        return jnp.append(creeps[creep].at[0].set(level[mode, creep]), row[mode])

    starts = jax.vmap(best)(modes)
    starts = starts[jnp.argsort(jax.vmap(cost)(starts))[:_STARTS]]
    trials = jax.lax.map(lambda start: search(start, _ROUGH, _FIRST_STEPS), starts)
    nearly = search(trials[jnp.argmin(jax.vmap(cost)(trials))], _EXACT, _STEPS)
    found = search(nearly, _EXACT, _FIRST_STEPS)
    # At an optimum reached to rounding no step is taken, which the solver does not call success.
    settled = cost(found) >= cost(nearly) * (1 - 1e-6)
    return _shape_of(found), cost(found), settled


@compiled
def _derivatives(shape: _Shape, frequencies: Array) -> tuple[Array, dict, dict]:
    """∂ln|G| (F, 5), the physical parameters, and their derivatives (5,), by the shape's fields."""
    vector, unravel = ravel_pytree(shape)
    centre = _centre(frequencies)
    return (
        jax.jacfwd(lambda v: unravel(v).log_amplitude(frequencies, centre))(vector),
        shape.physical(centre),
        jax.jacfwd(lambda v: unravel(v).physical(centre))(vector),
    )


# Tables and intervals -----------------------------------------------------------------------------


def _table(
    where: str,
    frequencies_Hz: ArrayLike,
    ratios: ArrayLike,
    standard_errors: ArrayLike | None,
    least: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies, ratios and weights (F,), of mean square 1, once they are usable."""
    columns = {"frequencies_Hz": frequencies_Hz, "ratios": ratios}
    if standard_errors is not None:
        columns["standard_errors"] = standard_errors
    arrays = {name: np.asarray(column, dtype=float) for name, column in columns.items()}
    size = arrays["ratios"].size
    for name, array in arrays.items():
        if array.shape != (size,):
            raise InputError.at(
                f"{where}, {name}", f"a list of {size} numbers", f"shape {array.shape}", "match it"
            )
        if not np.all((array > 0) & np.isfinite(array)):
            raise InputError.at(f"{where}, {name}", "positive numbers", "others", "correct them")
    frequencies = arrays["frequencies_Hz"]
    if np.unique(frequencies).size < least:
        raise InputError.at(
            where,
            f"at least {least} frequencies",
            f"{np.unique(frequencies).size}",
            "measure more of them",
        )
    weights = arrays["ratios"] / arrays.get("standard_errors", arrays["ratios"])
    return frequencies, arrays["ratios"], weights / np.sqrt(np.mean(weights**2))


def _inverse_square(jacobian: np.ndarray) -> np.ndarray:
    """(JᵀJ)⁻¹, large but finite along what J (N, n) does not see."""
    lengths = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-9)
    _, singular, right = np.linalg.svd(jacobian / lengths, full_matrices=False)
    spread = right.T / np.maximum(singular, 1e-9) / lengths[:, None]
    return spread @ spread.T


def _half_width(parameter: Parameter) -> float:
    """Half the plausible range, as a standard error at the parameter's value."""
    low, high = parameter.plausible
    if parameter.logarithmic:
        return float(0.5 * np.log(high / low) * parameter.value)
    return float(0.5 * (high - low))


def _straight(
    name: str, value: float, error: float, reach: float, unit: str, identified: bool
) -> CreepEstimate:
    """An estimate with a symmetric interval."""
    low, high = value - reach * error, value + reach * error
    return CreepEstimate(name, value, error, low, high, unit, identified)


def _logarithmic(
    name: str, value: float, error: float, reach: float, unit: str, identified: bool
) -> CreepEstimate:
    """An estimate whose logarithm has a symmetric interval, finite where it is open."""
    low, high = logarithmic_interval(value, reach * error)
    return CreepEstimate(name, value, error, low, high, unit, identified)


def _estimates(
    block: PEADynamics,
    order: float,
    errors: dict[str, float],
    reach: float,
    level: float,
    power: float,
) -> tuple[CreepEstimate, ...]:
    """Estimates of the block's parameters and of the creep order; at the table's centre the whole
    gain is `level`, and s^-μ is `power`."""
    parameters = named_parameters(block)
    # Where μ may be 0 there is no telling g from g_μ.
    apart = abs(float(block.mu.value)) > reach * errors["mu"]
    largest = {name: _half_width(parameters[name]) for name in _BOUNDED}
    largest |= {"gain": 0.5 * level * apart, "creep_gain": 0.5 * level * apart * power}
    found = [
        (_logarithmic if p.logarithmic else _straight)(
            name,
            float(p.value),
            errors[name],
            reach,
            p.unit,
            bool(errors[name] <= largest[name]) and not is_at_bound(p, 0),
        )
        for name, p in parameters.items()
    ]
    known = bool(errors["creep_order"] <= largest["mu"])
    return (*found, _straight("creep_order", order, errors["creep_order"], reach, "1", known))


def _open(estimate: CreepEstimate) -> CreepEstimate:
    """An estimate of a mode that the table does not show: anything within its bounds."""
    if estimate.name not in ("frequency", "damping"):
        return estimate
    parameter = named_parameters(PEADynamics())[estimate.name]
    return replace(
        estimate,
        standard_error=_half_width(parameter),
        low=float(parameter.lower),
        high=float(parameter.upper),
        identified=False,
    )
