"""Creep from amplitude ratios: by a straight line (TFOCIM), or with the dynamics (OFOCIM).

Both start from the ratio A_r of response to drive amplitude at several frequencies [F 15, 16].
TFOCIM assumes that log A_r is linear in log ω.  OFOCIM fits |G(jω)| of [F 20], so that a resonance
above the table's frequencies is not mistaken for creep.
Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, section 4.3.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
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
from .._parameters import named_parameters, set_values
from .._recording import InputError
from .._show import Shown
from ._creep_estimates import (
    BOUNDED,
    CreepEstimate,
    estimates_of,
    inverse_square,
    linear_estimate,
    logarithmic_estimate,
    mode_unidentified,
)

SCHEMA = "fracjax.creep/1"
_DECIBEL = 20 / np.log(10)
# The grid of starting values and the budgets below were chosen by judgement.
_MODES = 48
"""Starting values of the mode's frequency, evenly spaced in its logarithm."""
_DAMPINGS = np.array([0.003, 0.02, 0.1, 0.5])
"""Starting values of the damping ratio ζ."""
_CURVATURES = np.array([-0.7, -0.3, -0.1, 0.1, 0.3, 0.7])
"""Starting values of μ, the curvature of the creep over the logarithm of frequency."""
_SLOPES = np.array([-0.3, -0.08, -0.02, 0.0, 0.02, 0.08, 0.3])
"""Starting values of q, the slope of the creep over the logarithm of frequency."""
_STARTS = 24
"""How many of the best starting points are improved."""
_FIRST_STEPS = 30
"""Most steps from each of them, and most steps of the check for convergence."""
_STEPS = 200
"""Most steps from the best of them."""
_ROUGH = optx.LevenbergMarquardt(rtol=1e-3, atol=1e-3)
_ACCURATE = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)


@dataclass(frozen=True, repr=False)
class CreepIdentification(Shown):
    """Creep identified from amplitude ratios [response/drive].

    Attributes:
        method: "TFOCIM" or "OFOCIM".
        block: The fitted block: Creep [F 11] by TFOCIM, PEADynamics [F 20] by OFOCIM.
        estimates: The parameters with their uncertainties.
        scatter_dB: Standard deviation of the residual of 20 log10 of the ratio [dB], corrected for
            the degrees of freedom; the standard errors follow from it.
        converged: Whether the optimisation converged.
        frequencies_Hz: Frequencies (F,) [Hz].
        ratios: Measured ratios (F,) [response/drive].
        fitted: Ratios of the fitted block (F,) [response/drive].
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
        """The estimate of one parameter.

        Args:
            name: The parameter's name.

        Returns:
            The estimate with its standard error and interval.
        """
        return next(e for e in self.estimates if e.name == name)

    @property
    def unidentified(self) -> tuple[str, ...]:
        """Names of the parameters that the table does not determine."""
        return tuple(e.name for e in self.estimates if not e.identified)

    def to_dict(self) -> dict:
        """The result as plain data.

        Returns:
            A dictionary that JSON can store.
        """
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
    """Creep k_c s^-μ by the straight line y = 20 log10 k_c - 20 μ x [F 11, 15, 16].

    Here x = log10 ω with ω in rad/s, and y = 20 log10 A_r.  The standard errors of the parameters
    follow from the residual, their 95 % intervals from Student's t.  A negative μ means that the
    ratio rises with frequency: dynamics, not creep.

    Args:
        frequencies_Hz: Frequencies (F,) [Hz].
        ratios: Ratios A_r (F,) of response to drive amplitude [response/drive].
        standard_errors: Their standard errors (F,) [response/drive], which weight the points
            relative to each other; all points weigh the same by default.

    Returns:
        The fitted creep with its uncertainties.

    Raises:
        InputError: There are fewer than 3 frequencies, or values that are not positive.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, section 4.3.
    """
    frequencies, ratio, weights = _table("TFOCIM", frequencies_Hz, ratios, standard_errors, 3)
    x, y = np.log10(2 * np.pi * frequencies), 20 * np.log10(ratio)
    line = np.stack([np.ones_like(x), -20 * x], axis=1)
    level, mu = np.linalg.lstsq(line * weights[:, None], y * weights, rcond=None)[0]
    fitted = line @ np.array([level, mu])
    freedom = x.size - 2
    scatter = float(np.sqrt(np.sum((weights * (y - fitted)) ** 2) / freedom))
    covariance = scatter**2 * inverse_square(line * weights[:, None])
    level_error, mu_error = (float(e) for e in np.sqrt(np.diag(covariance)))
    quantile, k_c = float(student.ppf(0.975, freedom)), float(10 ** (level / 20))
    gain = (k_c, k_c * level_error / _DECIBEL, quantile, "response/drive*s^-mu")
    block = set_values(Creep(), {"k_c": k_c, "mu": mu})
    largest = 0.5 * np.ptp(block.mu.plausible)
    return CreepIdentification(
        method="TFOCIM",
        block=block,
        estimates=(
            logarithmic_estimate("k_c", *gain, bool(gain[1] <= 0.5 * k_c)),
            linear_estimate("mu", float(mu), mu_error, quantile, "1", bool(mu_error <= largest)),
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
    """Creep and dynamics together: |G(jω)| of [F 20] fitted to the logarithms of the ratios.

        ln A_r = ln |(g + g_μ (jω)^μ) / (1 + 2ζ jω/ω_0 - ω²/ω_0²)|

    The parameters are those of PEADynamics, and `creep_order`: the order of the creep k_c s^-μ
    [F 11] that has the same slope at the geometric centre of the table.  It is determined even
    where g, g_μ and μ are strongly correlated, as they are if the interval of μ contains 0.  If the
    table does not show the mode (F-test, 1 %), the intervals of its frequency and damping are all
    of their bounds.

    The optimiser is Levenberg–Marquardt from the best points of a grid.  Standard errors follow
    from the Jacobian and the residual's scatter, 95 % intervals from Student's t (on a logarithmic
    scale for f_0 and ζ).

    Args:
        frequencies_Hz: Frequencies (F,) [Hz].
        ratios: Ratios A_r (F,) of response to drive amplitude [response/drive].
        standard_errors: Their standard errors (F,) [response/drive], which weight the points
            relative to each other; all points weigh the same by default.

    Returns:
        The fitted creep and dynamics with their uncertainties.

    Raises:
        InputError: There are fewer than 6 frequencies, or values that are not positive.

    Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, section 4.3.
    """
    frequencies, ratio, weights = _table("OFOCIM", frequencies_Hz, ratios, standard_errors, 6)
    with computing():
        table = (jnp.asarray(frequencies), jnp.asarray(np.log(ratio)), jnp.asarray(weights))
        creeps, modes = _candidates(frequencies)
        shape, cost, success = _solve(creeps, modes, *table)
        without_mode = _solve(creeps, jnp.zeros((1, 1, 0)), *table)[1]
        amplitude, values, gradients = jax.tree_util.tree_map(
            np.asarray, _derivatives(shape, table[0])
        )
        centre = float(_centre(table[0]))
    freedom = frequencies.size - amplitude.shape[1]
    variance = float(cost) / freedom
    covariance = variance * inverse_square(weights[:, None] * amplitude)
    errors = {name: float(np.sqrt(a @ covariance @ a)) for name, a in gradients.items()}
    order = float(values.pop("creep_order"))
    block = set_values(PEADynamics(), values)
    quantile = float(student.ppf(0.975, freedom))
    level, power = float(np.exp(shape.log_level)), (2 * np.pi * centre) ** -float(block.mu.value)
    estimates = estimates_of(block, order, errors, quantile, level, power)
    mode_is_significant = float(without_mode - cost) > 2 * variance * fisher.ppf(0.99, 2, freedom)
    return CreepIdentification(
        method="OFOCIM",
        block=block,
        estimates=estimates
        if mode_is_significant
        else tuple(mode_unidentified(e) for e in estimates),
        scatter_dB=_DECIBEL * float(np.sqrt(variance)),
        converged=bool(success),
        frequencies_Hz=frequencies,
        ratios=ratio,
        fitted=np.abs(np.asarray(block.symbol(2j * np.pi * frequencies))),
    )


class _Shape(eqx.Module):
    """|G| of [F 20] in coordinates that stay weakly correlated if the creep is slight.

    G = T (1 + q ((s/ω_m)^μ - 1)/μ) / (1 + 2ζ s/ω_0 + s²/ω_0²), with ω_m the table's centre.  T is
    the level there, q the slope and μ the curvature over the logarithm of frequency.  As μ tends to
    0 the creep becomes the logarithmic law 1 + q ln(s/ω_m), while g = T (1 - q/μ) and
    g_μ = T q/μ ω_m^-μ grow without bound.
    """

    log_level: Array
    slope: Array
    mu: Array
    log_frequency: Array
    log_damping: Array

    def log_amplitude(self, frequencies: Array, centre: Array) -> Array:
        """ln |G| (F,) at frequencies (F,) [Hz] for a table with this centre [Hz]."""
        x = 1j * frequencies / jnp.exp(self.log_frequency)
        mode = 1 + 2 * jnp.exp(self.log_damping) * x + x * x
        return self.log_level + jnp.log(jnp.abs(self._creep(frequencies / centre) / mode))

    def _creep(self, ratio: Array | float) -> Array:
        """Creep factor 1 + q ((s/ω_m)^μ - 1)/μ at s = j ratio ω_m, by its series for small μ."""
        logarithm = jnp.log(ratio) + 0.5j * np.pi
        z = self.mu * logarithm
        small = jnp.abs(z) < 1e-4  # here the series below is exact to rounding
        quotient = jnp.expm1(jnp.where(small, 1.0, z)) / jnp.where(small, 1.0, z)
        return 1 + self.slope * logarithm * jnp.where(small, 1 + z / 2 + z * z / 6, quotient)

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


# The fit of OFOCIM: level, slope, and angles that keep μ, f_0 and ζ within their bounds -----------


def _shape_of(coordinates: Array) -> _Shape:
    """The shape at five coordinates: level, slope, and the angles of μ, f_0 and ζ.

    With three coordinates the mode is placed at its highest frequency, far above the table's.
    """
    parameters = named_parameters(PEADynamics())
    angles = jnp.append(coordinates[2:], jnp.array([np.pi / 2, 0.0]))[:3]
    mu, frequency, damping = (
        parameters[name].from_share((1 + jnp.sin(angle)) / 2)
        for name, angle in zip(BOUNDED, angles, strict=True)
    )
    return _Shape(coordinates[0], coordinates[1], mu, jnp.log(frequency), jnp.log(damping))


def _candidates(frequencies: np.ndarray) -> tuple[Array, Array]:
    """Starting coordinates of the creep (C, 3), its level 0, and of the mode (R, D, 2).

    A row of the latter holds one frequency; rows span the table's lowest frequency to ten times its
    highest.
    """
    parameters = named_parameters(PEADynamics())
    places = np.geomspace(frequencies.min(), 10 * frequencies.max(), _MODES)
    mu, frequency, damping = (
        jnp.arcsin(2 * parameters[name].to_share(values) - 1)
        for name, values in zip(BOUNDED, (_CURVATURES, places, _DAMPINGS), strict=True)
    )
    slopes, mu = (jnp.ravel(axis) for axis in jnp.meshgrid(_SLOPES, mu))
    creeps = jnp.stack([jnp.zeros_like(mu), slopes, mu], axis=1)
    return creeps, jnp.stack(jnp.meshgrid(frequency, damping, indexing="ij"), axis=2)


def _centre(frequencies: Array) -> Array:
    """Geometric mean of frequencies (F,) [Hz]."""
    return jnp.exp(jnp.mean(jnp.log(frequencies)))


@compiled
def _solve(
    creeps: Array, modes: Array, frequencies: Array, target: Array, weights: Array
) -> tuple[_Shape, Array, Array]:
    """Fitted shape, weighted sum of squares of ln |G|, and whether further steps gain nothing.

    For every row of modes (R, D, 2) the best combination with any creep (C, 3) is selected.  The 24
    best of these are improved by a few steps, and the best result is iterated to convergence.
    Modes (1, 1, 0) mean: no mode.
    """

    def amplitude(coordinates: Array) -> Array:
        return _shape_of(coordinates).log_amplitude(frequencies, _centre(frequencies))

    def residual(coordinates: Array, _) -> Array:
        return weights * (target - amplitude(coordinates))

    def cost(coordinates: Array) -> Array:
        return jnp.nan_to_num(jnp.sum(residual(coordinates, None) ** 2), nan=jnp.inf)

    def search(start: Array, solver: optx.LevenbergMarquardt, steps: int) -> Array:
        return optx.least_squares(residual, solver, start, max_steps=steps, throw=False).value

    creep_amplitudes = jax.vmap(amplitude)(creeps)

    def best(row: Array) -> Array:
        # Creep and mode multiply, so their logarithms add.
        mode_amplitudes = jax.vmap(lambda mode: amplitude(jnp.append(jnp.zeros(3), mode)))(row)
        remainder = target - mode_amplitudes[:, None] - creep_amplitudes
        level = remainder @ weights**2 / jnp.sum(weights**2)
        costs = (remainder - level[..., None]) ** 2 @ weights**2
        mode, creep = jnp.unravel_index(jnp.argmin(costs), costs.shape)
        return jnp.append(creeps[creep].at[0].set(level[mode, creep]), row[mode])

    starts = jax.vmap(best)(modes)
    starts = starts[jnp.argsort(jax.vmap(cost)(starts))[:_STARTS]]
    trials = jax.lax.map(lambda start: search(start, _ROUGH, _FIRST_STEPS), starts)
    nearly_optimal = search(trials[jnp.argmin(jax.vmap(cost)(trials))], _ACCURATE, _STEPS)
    optimum = search(nearly_optimal, _ACCURATE, _FIRST_STEPS)
    # At an optimum within rounding the solver takes no step and reports no success.
    is_converged = cost(optimum) >= cost(nearly_optimal) * (1 - 1e-6)
    return _shape_of(optimum), cost(optimum), is_converged


@compiled
def _derivatives(shape: _Shape, frequencies: Array) -> tuple[Array, dict, dict]:
    """∂ln|G| (F, 5), physical parameters and their gradients (5,), by the shape's fields."""
    vector, unravel = ravel_pytree(shape)
    centre = _centre(frequencies)
    return (
        jax.jacfwd(lambda v: unravel(v).log_amplitude(frequencies, centre))(vector),
        shape.physical(centre),
        jax.jacfwd(lambda v: unravel(v).physical(centre))(vector),
    )


# Tables -------------------------------------------------------------------------------------------


def _table(
    where: str,
    frequencies_Hz: ArrayLike,
    ratios: ArrayLike,
    standard_errors: ArrayLike | None,
    least: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies [Hz], ratios and weights (F,), of mean square 1, after checking all values."""
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
            raise InputError.at(
                f"{where}, {name}", "positive numbers", "other values", "correct them"
            )
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
