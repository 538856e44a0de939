"""The posterior's density: prediction, noise and priors, over standard normal coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, Protocol, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._computing import compiled, compiler_options
from .._fit import Fit, physical_unit
from .._naming import shown_name
from .._parameters import named_parameters, set_values
from .._prepare import AbstractProblem, Problem, layout_of, values_by_name
from .._programs import obtain
from .._recording import InputError, closest
from .._solve import compress, jacobian
from ._discrepancy import Discrepancy
from ._noise_models import AbstractNoiseModel, Signals, Term
from ._prior import AbstractPrior, prior_of, values_of

Values = TypeVar("Values", Array, np.ndarray)
_PART = 512
"""Rows that are computed in one call, so that one compiled program serves any number of rows."""
_FARTHEST, _ROUNDING = 8.0, 1e-9
"""Largest standard coordinate that a chain can reach in practice (a prior probability of 1e-15),
and the rounding error allowed for a share of a parameter's bounds."""


class Prediction(eqx.Module):
    """The response of every recording as a function of the model's parameters.

    Shapes (p,) and gains (g,) are physical and ordered as in `layout_of`.  The responses are
    without the recordings' own terms: in samples (L,), or in coordinates (m,) if the problem is
    compressed.
    """

    block: AbstractBlock
    problems: tuple[AbstractProblem, ...]

    @property
    def shapes(self) -> int:
        """p, the number of components of the shapes."""
        return sum(size for _, size in layout_of(self.block).shapes)

    def __call__(self, shapes: Array, gains: Array) -> tuple[Array, ...]:
        """The responses (L,) or (m,) of all recordings."""
        block, layout = self.block, layout_of(self.block)
        named = values_by_name(block, layout.shapes, shapes) | values_by_name(
            block, layout.gains, gains
        )
        at_values = set_values(block, named)
        return tuple(problem.simulate(at_values) for problem in self.problems)


_predicted = compiled(Prediction.__call__)


class Density(Protocol):
    """A posterior's density over coordinates v (D,) that are standard normal a priori."""

    def values(self, standard: Array) -> Array:
        """Physical values (D,)."""
        ...

    def log_posterior(self, standard: Array) -> Array:
        """ln p(data | v) + ln p(v); -∞ if it is not finite."""
        ...


class Target(eqx.Module):
    """The density that is sampled.

    The first `size` parameters are the model's; those of the noise follow.  `discrepancy` holds the
    columns (L, K) of each recording, whose coefficients (K,) come after all parameters with a
    prior; the last of the model's parameters is then the size of these coefficients.
    """

    predict: Prediction
    noise: AbstractNoiseModel
    problems: tuple[AbstractProblem, ...]
    priors: tuple[AbstractPrior, ...]
    discrepancy: tuple[np.ndarray | Array, ...]
    size: int = eqx.field(static=True)

    @property
    def columns(self) -> int:
        """K, the number of columns of the discrepancy."""
        return self.discrepancy[0].shape[1]

    def values(self, standard: Array) -> Array:
        """Physical values (D,) at standard coordinates (D,)."""
        return values_of(self.priors, standard)

    def gains(self, values: Array) -> Array:
        """The model's gains, and the discrepancy's size, out of all values (D,)."""
        return values[self.predict.shapes : self.size]

    def residuals(self, values: Array, gains: Array | None = None) -> Signals:
        """Measured minus predicted response (L,) of each recording, including its own terms.

        Values (D + K,) with coefficients include the discrepancy in the prediction.  `gains`
        replace those among the values; as a separate argument they let vmap over gains simulate
        each shape only once.
        """
        gains = self.gains(values) if gains is None else gains
        predictions = self.predict(values[: self.predict.shapes], gains)
        coefficients = values[len(self.priors) :]
        trios = zip(self.problems, predictions, self.discrepancy, strict=True)
        if not coefficients.size:
            return tuple(problem.response - prediction for problem, prediction, _ in trios)
        return tuple(
            p.response - prediction - columns @ coefficients for p, prediction, columns in trios
        )

    def noise_values(self, values: Values) -> Values:
        """The noise's parameters, out of all values (D,)."""
        return values[self.size : len(self.priors)]

    def log_likelihood(self, values: Array) -> Array:
        """ln p(data | values) at physical values (D,), for a target without discrepancy."""
        return self.noise.log_density(
            self.noise_values(values), self.residuals(values), self.problems
        )

    def log_posterior(self, standard: Array) -> Array:
        """ln p(data | v) + ln p(v), v standard normal a priori; -∞ if it is not finite."""
        prior = -(jnp.dot(standard, standard) + standard.size * np.log(2 * np.pi)) / 2
        density = self.log_likelihood(self.values(standard)) + prior
        return jnp.asarray(jnp.where(jnp.isfinite(density), density, -jnp.inf))


def _log_posteriors(arrays: list[Array], scalar: tuple[bool, ...], structure: Any) -> Array:
    """`log_posterior` (K,) of a target given as leaves and structure.

    The arrays are its leaves that are no scalars, then the scalars in one, then coordinates (K, D).
    """
    *rest, scalars, standards = arrays
    remaining, others = iter(scalars), iter(rest)
    leaves = [next(remaining if is_scalar else others) for is_scalar in scalar]
    target: Density = jax.tree_util.tree_unflatten(structure, leaves)
    return jax.vmap(target.log_posterior)(standards)


@cache
def _log_posteriors_program() -> Any:
    """The compiled `_log_posteriors`, made once."""
    options = compiler_options()
    return jax.jit(_log_posteriors, static_argnums=(1, 2), compiler_options=options)


def log_posteriors_of(target: Density) -> Callable[[np.ndarray], np.ndarray]:
    """A function that gives `log_posterior` (K,) at coordinates (K, D), in one call.

    The target is flattened and moved to the device only once, with its many scalars in one array;
    at every call this would take longer than a compressed density does.
    """
    leaves, structure = jax.tree_util.tree_flatten(jax.tree_util.tree_map(jnp.asarray, target))
    scalar = tuple(leaf.ndim == 0 for leaf in leaves)
    scalars = jnp.stack([leaf for leaf in leaves if leaf.ndim == 0])
    fixed = [*(leaf for leaf in leaves if leaf.ndim), scalars]

    @cache
    def program_for(shape: tuple[int, ...]) -> Callable[[list[Any]], Array]:
        arrays = [*fixed, np.zeros(shape)]
        return obtain(_log_posteriors, _log_posteriors_program, arrays, scalar, structure)

    return lambda standards: np.asarray(program_for(standards.shape)([*fixed, standards]))


@compiled
def _compiled_values(target: Density, standards: np.ndarray) -> Array:
    """Physical values (K, D) at coordinates (K, D), compiled."""
    return jax.vmap(target.values)(jnp.asarray(standards))


def physical_values(target: Density, standards: np.ndarray) -> np.ndarray:
    """Physical values (K, D) at coordinates (K, D)."""
    # In parts of one size, so that one compiled program serves every K.
    padded = np.pad(standards, ((0, -len(standards) % _PART), (0, 0)))
    parts = [
        _compiled_values(target, part) for part in padded.reshape(-1, _PART, standards.shape[1])
    ]
    return np.concatenate([np.asarray(part) for part in parts])[: len(standards)]


def target_of(
    fit: Fit,
    noise: AbstractNoiseModel,
    priors: Mapping[str, AbstractPrior],
    discrepancy: Discrepancy | None = None,
) -> tuple[Target, tuple[Term, ...]]:
    """The posterior of a fit's free parameters and the noise's, and what is sampled, in order.

    With a discrepancy its size is sampled too.  `priors` replace the default ones, by name.

    Raises:
        InputError: A name is not one of a sampled parameter.
    """
    problems = tuple(_orthonormal(p) for p in noise.prepared(fit.preparation).problems())
    model = _model_terms(fit)
    if discrepancy is None:
        columns = tuple(np.zeros((p.own.shape[0], 0)) for p in problems)
    else:
        model, columns = (*model, discrepancy.term), discrepancy.columns
    predict = Prediction(fit.model.block, problems)
    values = jnp.array([term.start for term in model])
    predicted = _predicted(predict, values[: predict.shapes], values[predict.shapes :])
    residuals = tuple(
        p.response - prediction for p, prediction in zip(problems, predicted, strict=True)
    )
    terms = (*model, *noise.terms(fit, residuals, problems))
    names = [term.name for term in terms]
    priors = {shown_name(name, fit.model.block): prior for name, prior in priors.items()}
    for name in priors:
        if name not in names:
            raise InputError.at(
                f'prior of "{name}"',
                f"one of {', '.join(names)}",
                f"no parameter of this name{closest(name, names)}",
                "correct it",
            )
    terms = tuple(t._replace(prior=priors.get(t.name, t.prior)) for t in terms)
    sampled = tuple(term.prior for term in terms)
    return Target(predict, noise, problems, sampled, columns, len(model)), terms


def compressed(target: Target, start: np.ndarray) -> Target:
    """The target with a likelihood whose cost does not depend on the number of samples.

    Its error is far below the noise at `start` (D,) in standard coordinates.  If no compression is
    that accurate, the target itself is returned.
    """
    block, taps = target.predict.block, target.noise.taps
    # In a compressed problem the own columns, with those of the discrepancy, come first.
    problems = tuple(
        eqx.tree_at(lambda p: p.own, problem, np.concatenate([problem.own, columns], axis=1))
        for problem, columns in zip(target.problems, target.discrepancy, strict=True)
        if isinstance(problem, Problem)
    )
    compression = None if taps is None else compress(block, problems, taps)
    if compression is None or not _within_bounds(target):
        return target
    noise_values = target.noise_values(target.values(jnp.asarray(start)))
    scales = [
        problem.whitening[0] / target.noise.scaled(noise_values, problem).whitening[0]
        for problem in target.problems
    ]
    if not compression.is_accurate_for(float(min(scales))):
        return target
    own_counts = [problem.own.shape[1] - target.columns for problem in compression.problems]
    columns = tuple(
        p.own[:, count:] for p, count in zip(compression.problems, own_counts, strict=True)
    )
    short_problems = tuple(
        eqx.tree_at(lambda p: p.own, problem, problem.own[:, :count])
        for problem, count in zip(compression.problems, own_counts, strict=True)
    )
    predict = Prediction(block, short_problems)
    return Target(predict, target.noise, short_problems, target.priors, columns, target.size)


def _within_bounds(target: Target) -> bool:
    """Whether the priors keep the shapes within the bounds for which a problem is compressed."""
    block = target.predict.block
    parameters = named_parameters(block)
    names = [name for name, _ in layout_of(block).shapes]
    shares = [
        parameters[name].to_share(prior.value(jnp.array([-_FARTHEST, _FARTHEST])))
        for name, prior in zip(names, target.priors, strict=False)
    ]
    return all(low > -_ROUNDING and high < 1 + _ROUNDING for low, high in shares)


def _orthonormal(problem: Problem) -> Problem:
    """The problem with its own columns (L, q) orthogonal, the first still a constant of 1."""
    columns, factor = np.linalg.qr(problem.own)
    scaled = np.sqrt(len(columns)) * columns * np.sign(np.diag(factor))
    return eqx.tree_at(lambda p: p.own, problem, scaled)


def _model_terms(fit: Fit) -> tuple[Term, ...]:
    """The model's free parameters as sampled parameters, the gains' priors scaled by the data."""
    block = fit.model.block
    problems = fit.preparation.problems()
    used = np.concatenate([np.asarray(p.weights) > 0 for p in problems])
    response = np.concatenate([np.asarray(p.response) for p in problems])[used]
    layout, parameters = layout_of(block), named_parameters(block)
    labels = layout.labels(block)
    columns = np.asarray(jacobian(block, problems)[0])[used][:, : len(labels)]
    sizes = response.std() / np.maximum(columns.std(axis=0), 1e-300)
    recording = fit.preparation.takes[0].recording
    units = (recording.drive_unit, recording.response_unit)
    components = [(n, k) for n, size in layout.shapes + layout.gains for k in range(size)]
    return tuple(
        Term(
            label,
            physical_unit(parameters[name].unit, units),
            prior_of(parameters[name], k, size),
            float(np.ravel(parameters[name].value)[k]),
        )
        for label, (name, k), size in zip(labels, components, sizes, strict=True)
    )
