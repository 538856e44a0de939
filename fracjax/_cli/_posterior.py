"""`fracjax posterior`: the posterior of a model's parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ._files import Content, folder
from ._given import Given, models_for
from ._options import (
    folder_option,
    model_option,
    recording_argument,
    takes_given,
    takes_results,
)
from ._progress import chain_bar
from ._results import Results, Summary
from ._statuses import NOT_CONVERGED, fail
from ._tables import Figures

if TYPE_CHECKING:
    from .._fit import Fit
    from .._posterior import AbstractNoiseModel, Posterior


@click.command("posterior")
@recording_argument
@model_option
@folder_option
@click.option("--resume", is_flag=True, help="Continue from the chain in DIR.")
@click.option(
    "--noise-model",
    type=click.Choice(["white", "ar", "measured", "student"]),
    default="measured",
    show_default=True,
    help="Its parameters are sampled too; `student` gives outliers less weight.",
)
@click.option(
    "--repeat", metavar="FILE", help="A second recording with the same drive, for the noise floor."
)
@click.option(
    "--discrepancy", is_flag=True, help="Widen intervals by what the model does not describe."
)
@click.option(
    "--diagnosis", metavar="FILE", help="A diagnosis.json, whose verdict is reported too."
)
@click.option("--walkers", type=int, help="Number of walkers, even; by default it suits the model.")
@click.option(
    "--steps", type=int, default=10_000, show_default=True, help="Largest number of steps."
)
@click.option(
    "--target-ess",
    type=click.IntRange(min=1),
    default=400,
    show_default=True,
    help="Effective draws of each parameter, in bulk and tails, with which it ends.",
)
@takes_given
@takes_results
def posterior_command(
    recording: str | None,
    name: str,
    out: Path,
    resume: bool,
    noise_model: str,
    repeat: str | None,
    discrepancy: bool,
    diagnosis: str | None,
    walkers: int | None,
    steps: int,
    target_ess: int,
    given: Given,
    results: Results,
) -> int:
    """Sample the posterior of the parameters of a model and of its noise.

    Writes posterior.nc (which ArviZ reads), posterior.json, report.html and fit.json.  The chain is
    saved in chain.h5 as it grows; --resume continues an interrupted run from it.
    """
    from .._fit import fit
    from .._prepare import measured_noise

    data = [given.the_one(recording)]
    (model,) = models_for([name], data)
    settings = given.how(data)
    noise = measured_noise(data[0], given.read(repeat)) if repeat else None
    from .._posterior import sample_posterior

    chain = out / "chain.h5"
    with folder(out, Content("posterior", [data[0].source], [model.name])):
        try:
            with chain_bar(results.quiet, steps) as (begin, count):
                fitted = fit(model, data, noise=noise, progress=begin, **settings)
                results.save(fitted.save, out / "fit.json")
                begin("finding the mode, and how wide the posterior is there")
                posterior = sample_posterior(
                    fitted,
                    noise_model=_noise_model(noise_model, fitted),
                    discrepancy=discrepancy,
                    diagnosis=diagnosis,
                    walkers=walkers,
                    steps=steps,
                    target_ess=target_ess,
                    seed=given.seed,
                    chain=chain,
                    resume=resume,
                    progress=count,
                )
        finally:
            if chain.exists():
                results.saved.append(chain)
        posterior.save(out)
        results.saved.extend([out / "posterior.nc", out / "posterior.json"])
        results.save_report(posterior, out / "report.html", given.seed)
    results.show(posterior.to_dict, lambda: _summary(posterior))
    if posterior.converged:
        return 0
    return fail(
        f"The chain of {name} did not converge in {posterior.steps} steps; its draws were saved in "
        f"{out}; continue with --resume and more --steps.",
        NOT_CONVERGED,
    )


def _noise_model(name: str, fit: Fit) -> AbstractNoiseModel:
    """The noise model of a name; an autoregression takes its order from the fit."""
    from .._posterior import MeasuredNoise, StudentNoise, WhiteNoise, ar_noise_of

    if name == "ar":
        return ar_noise_of(fit)
    return {"white": WhiteNoise, "measured": MeasuredNoise, "student": StudentNoise}[name]()


def _summary(posterior: Posterior) -> Summary:
    """The sentence, the table of parameters, and those that are strongly correlated."""
    correlated = posterior.known_only_together
    notes = [f"Strongly correlated: {'; '.join(correlated)}."] if correlated else []
    return Summary(posterior.sentence, _figures(posterior), notes)


def _figures(posterior: Posterior) -> Figures:
    """The table of parameters."""
    from .._posterior import posterior_row

    headers = ["", "mean", "sd", "95 % interval", "unit", "draws", "R-hat", "Laplace"]
    fields = ("name", "mean", "sd", "interval", "unit", "ess", "r_hat", "laplace")
    rows = [posterior_row(row) for row in posterior.rows]
    return headers, [[row[field] for field in fields] for row in rows]
