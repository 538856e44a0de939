"""`fracjax posterior`: the posterior of a model's parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ._files import folder
from ._given import Given, models_for
from ._jax import prepare_jax
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
@click.option("--resume", is_flag=True, help="Go on from the chain in DIR.")
@click.option(
    "--noise-model",
    type=click.Choice(["white", "ar", "measured", "student"]),
    default="measured",
    show_default=True,
    help="Its parameters are sampled too; `student` lets outliers weigh little.",
)
@click.option("--repeat", metavar="FILE", help="The same drive again, for the measured noise.")
@click.option("--discrepancy", is_flag=True, help="Let intervals bear what the model leaves out.")
@click.option("--diagnosis", metavar="FILE", help="diagnosis.json, whose verdict is carried along.")
@click.option("--walkers", type=int, help="An even number; by default as many as suit the model.")
@click.option("--steps", type=int, default=10_000, show_default=True, help="At most.")
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
    given: Given,
    results: Results,
) -> int:
    """Sample the posterior of a model's parameters and of the noise's.

    Writes posterior.nc (which ArviZ reads), posterior.json, report.html and fit.json; chain.h5
    grows meanwhile, and a run that was killed goes on from it by --resume.
    """
    from .._fit import fit, measured_noise

    taken = [given.the_one(recording)]
    (model,) = models_for([name], taken)
    how = given.how(taken)
    noise = measured_noise(taken[0], given.read(repeat)) if repeat else None
    from .._posterior import sample_posterior
    from .._report import write_report

    prepare_jax()
    chain = out / "chain.h5"
    with folder(out):
        try:
            with chain_bar(results.quiet, steps) as progress:
                found = fit(model, taken, noise=noise, **how)
                results.save(found.save, out / "fit.json")
                posterior = sample_posterior(
                    found,
                    noise_model=_noise_model(noise_model, found),
                    discrepancy=discrepancy,
                    diagnosis=diagnosis,
                    walkers=walkers,
                    steps=steps,
                    seed=given.seed,
                    chain=chain,
                    resume=resume,
                    progress=progress,
                )
        finally:
            if chain.exists():
                results.saved.append(chain)
        posterior.save(out)
        results.saved.extend([out / "posterior.nc", out / "posterior.json"])
        results.save(lambda path: write_report(posterior, path), out / "report.html")
    results.tell(posterior.to_dict, lambda: _summary(posterior))
    if posterior.converged:
        return 0
    return fail(
        f"The chain of {name} did not converge in {posterior.steps} steps; what it reached was "
        f"saved in {out}; go on with --resume and more --steps.",
        NOT_CONVERGED,
    )


def _noise_model(name: str, found: Fit) -> AbstractNoiseModel:
    from .._posterior import MeasuredNoise, StudentNoise, WhiteNoise, ar_noise_of

    if name == "ar":
        return ar_noise_of(found)
    return {"white": WhiteNoise, "measured": MeasuredNoise, "student": StudentNoise}[name]()


def _summary(posterior: Posterior) -> Summary:
    together = posterior.known_only_together
    notes = [f"Known only together: {'; '.join(together)}."] if together else []
    return Summary(posterior.sentence, _figures(posterior), notes)


def _figures(posterior: Posterior) -> Figures:
    from .._report._posterior_page import cells

    heads = ["", "mean", "sd", "95 % interval", "unit", "draws", "R-hat", "Laplace"]
    fields = ("name", "mean", "sd", "interval", "unit", "ess", "r_hat", "laplace")
    rows = [cells(row) for row in posterior.summary]
    return heads, [[row[field] for field in fields] for row in rows]
