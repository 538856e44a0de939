"""Sampling the posterior of a fit."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.signal import lfilter

from .._computing import compiled, computing
from .._fit import Fit
from .._prepare import free_parameters_of
from .._recording import InputError, require_kind
from ._discrepancy import discrepancy_of
from ._doubt import doubt_of
from ._laplace import Laplace
from ._likelihood import Target, compressed, log_posteriors_of, physical, target_of
from ._marginal import Marginal, completed, figures, marginal_of
from ._noise_models import AbstractGaussianNoise, AbstractNoiseModel, MeasuredNoise, Signals, Term
from ._prior import AbstractPrior
from ._result import Band, Posterior, Row, figures_of, inseparable
from ._sample import Chain, ChainFile, run_ensemble, split_r_hat

_FARTHEST_START = 4.0
_LEAST_WALKERS = 32
# A snooker move takes three of the other half.
_FEWEST_WALKERS = 6
_PRIOR_DRAWS = 2000
_BAND_DRAWS = 200
_CENTRAL = (2.5, 97.5)

Watch = Callable[[int, int, str], None]
"""Told steps done, steps at most, and the estimate so far."""


def unwatched(done: int, most: int, estimate: str) -> None:
    """Report no progress."""


def sample_posterior(
    fit: Fit,
    *,
    noise_model: AbstractNoiseModel | None = None,
    discrepancy: bool = False,
    diagnosis: str | Path | None = None,
    priors: Mapping[str, AbstractPrior] | None = None,
    walkers: int | None = None,
    steps: int = 10_000,
    seed: int = 0,
    chain: str | Path | None = None,
    resume: bool = False,
    progress: Watch = unwatched,
) -> Posterior:
    """The posterior of a fit's free parameters, and of the noise's, by an ensemble of walkers.

    Gains are integrated out where that is exact, under normal noise and priors, and drawn given the
    rest (`_marginal`); walkers move over the shapes and the noise's numbers alone.  The chain
    starts from the Laplace approximation and runs in its coordinates until it has 50
    autocorrelation times after burn-in and split R-hat below 1.01, at most `steps`.

    - `noise_model`: `MeasuredNoise` where none is given.
    - `discrepancy`: model what the model leaves out, so that intervals bear it (`_discrepancy`).
    - `diagnosis`: a diagnosis.json of the model, whose verdict the result then carries.
    - `priors`: by name, in place of the parameters' own.
    - `walkers`: an even number, at least twice that of what walkers move over, and six; by default
      four times, and at least 32.
    - `chain`: an HDF5 file that grows with the run; with `resume` the steps in it are gone on from.

    Raises InputError for unknown names, too few walkers or steps, a chain of another call, a
    diagnosis of another model, a discrepancy beside Student-t noise, and a fit with tied or own
    parameters.  A chain that has not converged says so in `converged`.
    Source: Foreman-Mackey et al., Publ. Astron. Soc. Pac. 125 (2013) 306; Goodman & Weare, Commun.
    Appl. Math. Comput. Sci. 5 (2010) 65.
    """
    require_kind(fit, Fit, "posterior", "fit the model first: sample_posterior(fit(...))")
    asked = fit.preparation.conditions
    own = free_parameters_of(fit.model.block, len(fit.preparation.takes), asked).own
    if asked.ties or own:
        raise InputError.at(
            "posterior",
            "a fit whose parameters are neither tied nor each recording's own",
            f"{', '.join((*asked.ties, *own))} so fitted",
            "fit without, or fix them",
        )
    noise = MeasuredNoise() if noise_model is None else noise_model
    if discrepancy and not isinstance(noise, AbstractGaussianNoise):
        raise InputError.at(
            "discrepancy", "normal noise beside it", f"{noise.name} noise", "choose another noise"
        )
    doubt = "" if diagnosis is None else doubt_of(diagnosis, fit.model.name)
    with computing():
        beyond = discrepancy_of(fit) if discrepancy else None
        target, terms = target_of(fit, noise, priors or {}, beyond)
        starts = _starts(terms)
        density, approximation = marginal_of(compressed(target, starts), starts)
        names = [terms[k].name for k in density.sampled]
        size = len(names)
        count = max(_LEAST_WALKERS, 4 * size) if walkers is None else walkers
        _check(count, size, steps)

        log_posteriors = log_posteriors_of(density)

        def log_density(coordinates: np.ndarray) -> np.ndarray:
            return log_posteriors(approximation.at(coordinates))

        def watch(running: Chain) -> None:
            last = running.kept[-min(len(running.kept), 500) :].reshape(-1, size)
            values = physical(density, approximation.at(last))
            progress(len(running.coordinates), steps, _estimate(names, values, running))

        found = run_ensemble(
            log_density,
            walkers=count,
            size=size,
            steps=steps,
            seed=seed,
            file=None if chain is None else ChainFile(Path(chain)),
            resume=resume,
            settings=_settings(fit, noise, terms, names, count, seed),
            watch=watch,
        )
        return _posterior_of(fit, target, terms, density, approximation, found, seed, doubt)


def _check(walkers: int, size: int, steps: int) -> None:
    least = max(_FEWEST_WALKERS, 2 * size)
    if walkers % 2 or walkers < least:
        raise InputError.at(
            "walkers", f"an even number of at least {least}", f"{walkers}", "give more"
        )
    if steps < 40:
        raise InputError.at("steps", "at least 40", f"{steps}", "give more")


def _starts(terms: Sequence[Term]) -> np.ndarray:
    """Where the search for the mode begins, (D,) in standard coordinates."""
    starts = np.array([float(term.prior.standard(term.start)) for term in terms])
    return np.clip(starts, -_FARTHEST_START, _FARTHEST_START)


def _estimate(names: Sequence[str], values: np.ndarray, running: Chain) -> str:
    """The first few numbers as they stand, and how long the chain is."""
    told = [
        f"{name} {column.mean():.4g} ± {column.std():.1g}"
        for name, column in zip(names, values.T[:3], strict=False)
    ]
    times = len(running.kept) / running.autocorrelation.max()
    return f"{times:.0f} autocorrelation times; {', '.join(told)}"


def _settings(
    fit: Fit,
    noise: AbstractNoiseModel,
    terms: Sequence[Term],
    sampled: Sequence[str],
    walkers: int,
    seed: int,
) -> dict[str, str]:
    """All that a chain depends on beside its length, as text, by name."""
    data = hashlib.sha256()
    for take in fit.preparation.takes:
        for signal in (take.recording.drive, take.recording.response, take.used):
            data.update(np.ascontiguousarray(signal).tobytes())
    with np.printoptions(precision=5):
        priors = [eqx.tree_pformat(term.prior, short_arrays=False) for term in terms]
    return {
        "model": fit.model.name,
        "noise model": noise.name,
        "parameters": ", ".join(term.name for term in terms),
        "walkers over": ", ".join(sampled),
        "priors": hashlib.sha256("".join(priors).encode()).hexdigest()[:12],
        "data": data.hexdigest()[:12],
        "walkers": str(walkers),
        "seed": str(seed),
    }


def _posterior_of(
    fit: Fit,
    target: Target,
    terms: Sequence[Term],
    density: Marginal,
    approximation: Laplace,
    chain: Chain,
    seed: int,
    doubt: str,
) -> Posterior:
    generator = np.random.default_rng(seed)
    names, size = [term.name for term in terms], len(terms)
    slowest = float(chain.autocorrelation.max())
    # At least a step of each quarter, by which the gains' R-hat goes.
    thinned = min(max(1, int(slowest / 2)), len(chain.kept) // 4)
    kept = chain.kept[::thinned]
    standards = approximation.at(kept.reshape(-1, kept.shape[2]))
    values = completed(density, standards, generator)
    drawn = values[:, :size].reshape(*kept.shape[:2], size)
    walking = np.moveaxis(drawn, 1, 0)
    r_hat = np.empty(size)
    r_hat[list(density.sampled)] = chain.r_hat
    r_hat[list(density.integrated)] = split_r_hat(drawn[:, :, list(density.integrated)])
    means, sds = figures(density, approximation)
    prior = physical(target, generator.standard_normal((_PRIOR_DRAWS, size)))
    ends = physical(target, 1.96 * np.array([[-1.0], [1.0]]) * np.ones(size))
    rows = []
    for k, term in enumerate(terms):
        mean, sd, interval, ess = figures_of(walking[:, :, k])
        rows.append(
            Row(
                name=term.name,
                unit=term.unit,
                mean=mean,
                sd=sd,
                interval=interval,
                ess=ess,
                r_hat=float(r_hat[k]),
                laplace_mean=float(means[k]),
                laplace_sd=float(sds[k]),
                prior=(float(ends[0, k]), float(ends[1, k])),
            )
        )
    first = fit.preparation.takes[0].recording
    return Posterior(
        model=fit.model.name,
        noise_model=target.noise.name,
        discrepancy=target.columns > 0,
        doubt=doubt,
        units=(first.drive_unit, first.response_unit),
        samples={name: walking[:, :, k] for k, name in enumerate(names)},
        log_posterior=chain.log_density[chain.burn_in :][::thinned].T,
        prior={name: prior[:, k] for k, name in enumerate(names)},
        summary=tuple(rows),
        known_only_together=inseparable(names, values[:, :size].T),
        bands=_bands(fit, target, values, generator),
        steps=len(chain.coordinates),
        burn_in=chain.burn_in,
        thinned=thinned,
        autocorrelation=slowest,
        acceptance=chain.acceptance,
        seed=seed,
        converged=chain.converged,
    )


@compiled
def _responses(target: Target, values: Array, normals: Signals) -> tuple[Signals, Signals]:
    """Responses (L,) with the recordings' own terms, and the filter (taps,) of each noise."""
    noise, own_values = target.noise, target.of_noise(values)
    residuals = target.residuals(values)
    own = noise.own(own_values, residuals, target.problems, normals)
    trios = zip(target.problems, residuals, own, strict=True)
    simulated = tuple(p.response - residual + term for p, residual, term in trios)
    filters = tuple(jnp.asarray(noise.scaled(own_values, p).whitening) for p in target.problems)
    return simulated, filters


def _bands(
    fit: Fit, target: Target, values: np.ndarray, generator: np.random.Generator
) -> tuple[Band, ...]:
    """What draws of the posterior predict of each recording, without and with noise."""
    takes = fit.preparation.takes
    model: list[list[np.ndarray]] = [[] for _ in takes]
    noisy: list[list[np.ndarray]] = [[] for _ in takes]
    for row in values[generator.integers(len(values), size=_BAND_DRAWS)]:
        normals = tuple(generator.standard_normal(p.own.shape[1]) for p in target.problems)
        simulated, filters = _responses(target, jnp.asarray(row), normals)
        for at, take in enumerate(takes):
            count = len(take.recording)
            clean = np.asarray(simulated[at])[:count]
            white = target.noise.innovations(target.of_noise(row), generator, 2 * count)
            # The first half runs the filter in.
            noise = np.asarray(lfilter([1.0], np.asarray(filters[at]), white))[count:]
            model[at].append(clean)
            noisy[at].append(clean + noise)
    return tuple(
        Band(
            source=take.recording.source,
            times=take.recording.times,
            drive=take.recording.drive,
            response=take.recording.response,
            used=take.used,
            median=np.median(model[at], axis=0),
            model=np.percentile(model[at], _CENTRAL, axis=0),
            predictive=np.percentile(noisy[at], _CENTRAL, axis=0),
        )
        for at, take in enumerate(takes)
    )
