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
from .._naming import shown_names
from .._prepare import free_parameters_of, layout_of, require_whole_number, values_by_name
from .._recording import InputError, require_kind
from ._discrepancy import discrepancy_of
from ._doubt import doubt_of, misfit_of
from ._laplace import Laplace
from ._likelihood import Target, compressed, log_posteriors_of, physical_values, target_of
from ._marginal import Marginal, complete_draws, figures, marginal_of
from ._noise_models import AbstractGaussianNoise, AbstractNoiseModel, MeasuredNoise, Signals, Term
from ._prediction import CENTRAL, Predictor
from ._prior import AbstractPrior
from ._result import Posterior, strongly_correlated_pairs, summary_of
from ._rows import Band, Row
from ._sample import BLOCK, TARGET_ESS, Chain, ChainFile, run_ensemble, split_r_hat

_FARTHEST_START = 4.0
"""Largest standard coordinate at which the search for the mode begins; chosen by judgement."""
_LEAST_WALKERS = 32
"""Fewest walkers by default; chosen by judgement."""
_FEWEST_WALKERS = 6
"""Fewest walkers: a snooker move needs three of the other half."""
_PRIOR_DRAWS = 2000
"""Draws of the prior that are stored; chosen by judgement."""
_BAND_DRAWS = 200
"""Draws of the posterior that make the bands; chosen by judgement."""

ProgressCallback = Callable[[int, int, str], None]
"""Called with the steps done, the largest number of steps, and the estimate so far."""


def no_progress(done: int, most: int, estimate: str) -> None:
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
    target_ess: int = TARGET_ESS,
    seed: int = 0,
    chain: str | Path | None = None,
    resume: bool = False,
    progress: ProgressCallback = no_progress,
) -> Posterior:
    """Sample the posterior of a fit's free parameters and the noise's, by an ensemble.

    Under normal noise and priors the gains are integrated out exactly and drawn given the other
    parameters, so the walkers move over the shapes and the noise's parameters only.  The chain
    starts from the Laplace approximation and runs in its coordinates until it has `target_ess`
    effective draws after burn-in and a split R-hat below 1.01, or has `steps` steps.

    Args:
        fit: The fit.
        noise_model: The noise model; `MeasuredNoise` by default.
        discrepancy: Whether to model the discrepancy between model and actuator as well, so that
            the intervals include its effect.
        diagnosis: A diagnosis.json of the model, whose verdict the result then carries.
        priors: Priors by the parameters' names, which replace their own.
        walkers: Number of walkers: even, at least twice the number of parameters that they move
            over, and at least 6; by default four times that number, and at least 32.
        steps: Largest number of steps, at least 40.
        target_ess: Effective draws of every parameter, in the bulk and in the tails, with which the
            chain ends; 400 is ArviZ' recommendation, and intervals take more to have two digits.
        seed: Seed of all random numbers.
        chain: HDF5 file that grows with the run.
        resume: Whether to continue from the steps in that file.
        progress: Called with the steps done, the number expected, and the estimate so far.

    Returns:
        Draws, their summary and bands of the response.  `converged` is false if the chain reached
        `steps` first.

    Raises:
        InputError: A name is unknown; walkers or steps are too few; the chain belongs to another
            call or the diagnosis to another model; a discrepancy is combined with Student-t noise;
            or the fit has parameters that are tied or differ between recordings.

    Source: Foreman-Mackey et al., Publ. Astron. Soc. Pac. 125 (2013) 306; Goodman & Weare, Commun.
    Appl. Math. Comput. Sci. 5 (2010) 65.
    """
    require_kind(fit, Fit, "posterior", "fit the model first: sample_posterior(fit(...))")
    conditions = fit.preparation.conditions
    own = free_parameters_of(fit.model.block, len(fit.preparation.takes), conditions).own
    shown = shown_names(fit.model.block)
    if conditions.ties or own:
        raise InputError.at(
            "posterior",
            "a fit without parameters that are tied or differ between recordings",
            f"{', '.join(shown[name] for name in (*conditions.ties, *own))} fitted in this way",
            "fit without these options, or fix the parameters",
        )
    noise = MeasuredNoise() if noise_model is None else noise_model
    if discrepancy and not isinstance(noise, AbstractGaussianNoise):
        raise InputError.at(
            "discrepancy", "normal noise with it", f"{noise.name} noise", "choose another noise"
        )
    doubt = misfit_of(fit)
    if diagnosis is not None:
        doubt = doubt_of(diagnosis, fit.model.name) or doubt
    with computing():
        discrepancy_model = discrepancy_of(fit) if discrepancy else None
        target, terms = target_of(fit, noise, priors or {}, discrepancy_model)
        starts = _starts(terms)
        density, approximation = marginal_of(compressed(target, starts), starts)
        sampled_names = [terms[k].name for k in density.sampled]
        size = len(sampled_names)
        count = max(_LEAST_WALKERS, 4 * size) if walkers is None else walkers
        _check_run_length(count, size, steps)

        log_posteriors = log_posteriors_of(density)

        def log_density(coordinates: np.ndarray) -> np.ndarray:
            """Log posteriors (K,) at the approximation's coordinates (K, D')."""
            return log_posteriors(approximation.at(coordinates))

        # How many steps the chain needs is known after the first of its blocks.
        estimates, expected = [f"at most; how many it needs is said after {BLOCK}"], [steps]

        def report(partial_chain: Chain) -> None:
            """Report the chain's estimates so far."""
            # The estimate comes from the last 500 steps, a number chosen by judgement.
            recent = partial_chain.kept[-min(len(partial_chain.kept), 500) :].reshape(-1, size)
            values = physical_values(density, approximation.at(recent))
            estimates.append(_estimate(sampled_names, values, partial_chain))
            done = len(partial_chain.coordinates)
            expected.append(min(max(partial_chain.forecast, done), steps))
            progress(done, expected[-1], estimates[-1])

        samples = run_ensemble(
            log_density,
            walkers=count,
            size=size,
            steps=steps,
            seed=seed,
            file=None if chain is None else ChainFile(Path(chain)),
            resume=resume,
            settings=_settings(fit, noise, terms, sampled_names, count, seed),
            watch=report,
            step=lambda done: progress(done, max(done, expected[-1]), estimates[-1]),
            target=require_whole_number(target_ess, "target_ess", 1),
        )
        return _posterior_of(fit, target, terms, density, approximation, samples, seed, doubt)


def _check_run_length(walkers: int, size: int, steps: int) -> None:
    """Raise InputError if walkers or steps are too few for chains of `size` coordinates."""
    least = max(_FEWEST_WALKERS, 2 * size)
    if walkers % 2 or walkers < least:
        raise InputError.at(
            "walkers", f"an even number of at least {least}", f"{walkers}", "give more"
        )
    if steps < 40:  # ten for each quarter of the chain, which R-hat compares; by judgement
        raise InputError.at("steps", "at least 40", f"{steps}", "give more")


def _starts(terms: Sequence[Term]) -> np.ndarray:
    """Where the search for the mode begins: standard coordinates (D,)."""
    starts = np.array([float(term.prior.standard(term.start)) for term in terms])
    return np.clip(starts, -_FARTHEST_START, _FARTHEST_START)


def _estimate(names: Sequence[str], values: np.ndarray, chain: Chain) -> str:
    """The first three parameters with their standard deviations, and what the chain holds."""
    estimates = [
        f"{name} {column.mean():.4g} ± {column.std():.1g}"
        for name, column in zip(names, values.T[:3], strict=False)
    ]
    draws = f"{chain.ess.min():.0f} of {chain.target} effective draws"
    return f"{draws}, R-hat {chain.r_hat.max():.3f}; {', '.join(estimates)}"


def _settings(
    fit: Fit,
    noise: AbstractNoiseModel,
    terms: Sequence[Term],
    sampled: Sequence[str],
    walkers: int,
    seed: int,
) -> dict[str, str]:
    """Everything but its length that a chain depends on, as text, by name."""
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
    """The result: draws with all parameters, their summary, and bands of the response."""
    generator = np.random.default_rng(seed)
    names, size = [term.name for term in terms], len(terms)
    slowest = float(chain.autocorrelation.max())
    # At least one step of each quarter of the chain, from which the gains' R-hat is computed.
    thinned = min(max(1, int(slowest / 2)), len(chain.kept) // 4)
    thinned_chain = chain.kept[::thinned]
    coordinates = approximation.at(thinned_chain.reshape(-1, thinned_chain.shape[2]))
    values = complete_draws(density, coordinates, generator)
    drawn = values[:, :size].reshape(*thinned_chain.shape[:2], size)
    by_walker = np.moveaxis(drawn, 1, 0)
    r_hat = np.empty(size)
    r_hat[list(density.sampled)] = chain.r_hat
    r_hat[list(density.integrated)] = split_r_hat(drawn[:, :, list(density.integrated)])
    means, sds = figures(density, approximation)
    prior = physical_values(target, generator.standard_normal((_PRIOR_DRAWS, size)))
    prior_ends = physical_values(target, 1.96 * np.array([[-1.0], [1.0]]) * np.ones(size))
    rows = []
    for k, term in enumerate(terms):
        mean, sd, interval, ess = summary_of(by_walker[:, :, k])
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
                prior=(float(prior_ends[0, k]), float(prior_ends[1, k])),
            )
        )
    first_recording = fit.preparation.takes[0].recording
    bands, predictor = _predictions(fit, target, values, generator)
    return Posterior(
        model=fit.model.name,
        noise_model=target.noise.name,
        discrepancy=target.columns > 0,
        doubt=doubt,
        units=(first_recording.drive_unit, first_recording.response_unit),
        samples={name: by_walker[:, :, k] for k, name in enumerate(names)},
        log_posterior=chain.log_density[chain.burn_in :][::thinned].T,
        prior={name: prior[:, k] for k, name in enumerate(names)},
        rows=tuple(rows),
        known_only_together=strongly_correlated_pairs(names, values[:, :size].T),
        bands=bands,
        steps=len(chain.coordinates),
        burn_in=chain.burn_in,
        thinned=thinned,
        autocorrelation=slowest,
        acceptance=chain.acceptance,
        seed=seed,
        converged=chain.converged,
        predictor=predictor,
    )


@compiled
def _responses(target: Target, values: Array, normals: Signals) -> tuple[Signals, Signals, Signals]:
    """Responses (L,) with their own terms, these, and noise filter (taps,), of each recording."""
    noise, noise_values = target.noise, target.noise_values(values)
    residuals = target.residuals(values)
    own = noise.own(noise_values, residuals, target.problems, normals)
    trios = zip(target.problems, residuals, own, strict=True)
    simulated = tuple(p.response - residual + term for p, residual, term in trios)
    filters = tuple(jnp.asarray(noise.scaled(noise_values, p).whitening) for p in target.problems)
    return simulated, own, filters


def _predictions(
    fit: Fit, target: Target, values: np.ndarray, generator: np.random.Generator
) -> tuple[tuple[Band, ...], Predictor]:
    """What 200 draws of the posterior predict for each recording, without and with noise, and what
    predicts for another drive."""
    takes = fit.preparation.takes
    own_columns = np.asarray(fit.preparation.problems()[0].own)
    model: list[list[np.ndarray]] = [[] for _ in takes]
    noisy: list[list[np.ndarray]] = [[] for _ in takes]
    offsets = []
    rows = values[generator.integers(len(values), size=_BAND_DRAWS)]
    for row in rows:
        normals = tuple(generator.standard_normal(p.own.shape[1]) for p in target.problems)
        simulated, own, filters = _responses(target, jnp.asarray(row), normals)
        offsets.append(np.linalg.lstsq(own_columns, np.asarray(own[0]), rcond=None)[0][0])
        for at, take in enumerate(takes):
            count = len(take.recording)
            clean = np.asarray(simulated[at])[:count]
            white = target.noise.innovations(target.noise_values(row), generator, 2 * count)
            # The first half is the filter's transient.
            noise = np.asarray(lfilter([1.0], np.asarray(filters[at]), white))[count:]
            model[at].append(clean)
            noisy[at].append(clean + noise)
    bands = tuple(
        Band(
            source=take.recording.source,
            times=take.recording.times,
            drive=take.recording.drive,
            response=take.recording.response,
            used=take.used,
            median=np.median(model[at], axis=0),
            model=np.percentile(model[at], CENTRAL, axis=0),
            predictive=np.percentile(noisy[at], CENTRAL, axis=0),
        )
        for at, take in enumerate(takes)
    )
    block, layout = fit.model.block, layout_of(fit.model.block)
    shown, drawn = (
        shown_names(block),
        [values_by_name(block, layout.shapes + layout.gains, row) for row in rows],
    )
    first = takes[0]
    predictor = Predictor(
        model=fit.model,
        values={n: np.asarray(p.value).tolist() for n, p in fit.model.parameters.items()},
        setting=fit.preparation.setting,
        draws={shown[path]: np.stack([each[path] for each in drawn]) for path in drawn[0]},
        offsets=np.array(offsets),
        step=first.recording.dt,
        history="constant" if first.history == "estimated" else first.history,
    )
    return bands, predictor
