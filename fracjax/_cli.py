"""The command line: reads, calls the package, writes what it found, and says it plainly.

Whatever takes long to import is imported by the command that needs it, so that help is instant.
"""

from __future__ import annotations

import _thread
import json
import logging
import os
import re
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from . import __version__

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from ._batch import Count
    from ._blocks import AbstractBlock
    from ._compensate import Compensation, Trajectory
    from ._diagnose import Diagnosis
    from ._fit import Fit, FrequencyFit, Loss, Past
    from ._models import Model
    from ._operators._grid import History
    from ._posterior import AbstractNoiseModel, Posterior
    from ._recording import Recording

UNUSABLE, NOT_CONVERGED, INTERRUPTED = 2, 3, 130
_NOTES = 5
_ASKED = ("fix", "bound", "prior", "tie", "own", "mask")

Progress = Callable[[str], None]


def main() -> None:
    """The program `fracjax`."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    sys.unraisablehook = heed_interrupt
    sys.exit(run())


def heed_interrupt(unraisable: sys.UnraisableHookArgs) -> None:
    """Ctrl-C once more, where it met a callback of the garbage collector, which swallows it.

    JAX has one, and it is the first Python to run after a long computation.
    """
    if isinstance(unraisable.exc_value, KeyboardInterrupt):
        threading.Timer(0.05, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(unraisable)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; what went wrong is one sentence on stderr."""
    saved: list[Path] = []
    try:
        return cli.main(arguments, prog_name="fracjax", standalone_mode=False, obj=saved) or 0
    except click.Abort:
        kept = f"kept {', '.join(map(str, saved))}" if saved else "nothing had been written yet"
        return _fail(f"Interrupted; {kept}.", INTERRUPTED)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "fracjax"
        message = " ".join(error.format_message().split()).rstrip(".?").replace(". ", "; ")
        return _fail(f"{command}: {message}; see {command} --help.", UNUSABLE)
    except OSError as error:
        place, reason = error.filename or "output", (error.strerror or str(error)).lower()
        return _fail(
            f"{place}: expected a place that can be written, found {reason}; choose another.",
            UNUSABLE,
        )
    except ValueError as error:
        from ._recording import InputError

        if not isinstance(error, InputError):
            raise
        return _fail(f"{str(error).rstrip('.')}.", UNUSABLE)


def _fail(sentence: str, status: int) -> int:
    print(sentence, file=sys.stderr)
    return status


# Options ------------------------------------------------------------------------------------------


def _options(*options: Callable) -> Callable:
    """Several options as one decorator."""

    def decorate(command: Callable) -> Callable:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


_quiet = click.option("--quiet", is_flag=True, help="Show no progress and no summary.")
_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
_seed = click.option("--seed", type=int, default=0, show_default=True, help="Of random starts.")
_time = click.option("--time", metavar="COLUMN", help="The time: a name, or an index from 0.")
_input = click.option("--input", metavar="COLUMN", help="The drive, likewise.")
_output = click.option("--output", metavar="COLUMN", help="The response, likewise.")
_rate = click.option("--rate", metavar="200Hz", help="Needed where there is no time column.")
_input_unit = click.option("--input-unit", metavar="V", help="Unit of the drive.")
_output_unit = click.option("--output-unit", metavar="um", help="Unit of the response.")
_resample = click.option(
    "--resample", metavar="200Hz", help="Interpolate to this rate where the times are not uniform."
)
_reading = _options(_time, _input, _output, _rate, _input_unit, _output_unit, _resample)
_history = click.option(
    "--history",
    type=click.Choice(["auto", "rest", "constant", "periodic", "estimated"]),
    default="auto",
    show_default=True,
    help="What the drive did before the first sample.",
)
_settle = click.option(
    "--settle", metavar='"1 s"', help="Leave out the first samples, whose memory is unknown."
)
_recordings = click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...")
_folder_option = click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="For the results."
)


@click.group(
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=False,
    epilog='Completion of words: eval "$(_FRACJAX_COMPLETE=bash_source fracjax)", or zsh_source, '
    "fish_source.",
)
@click.version_option(__version__, prog_name="fracjax")
def cli() -> None:
    """What a simulation of an actuator left out, and by how much."""


# fit ----------------------------------------------------------------------------------------------


_asking = _options(
    click.option("--fix", multiple=True, metavar='"alpha=0.1"', help="Hold a parameter."),
    click.option("--bound", multiple=True, metavar='"alpha=0.05..0.2"', help="Narrow its range."),
    click.option(
        "--prior", multiple=True, metavar='"alpha=0.1±0.02"', help="What was known of it (or +-)."
    ),
    click.option(
        "--tie", multiple=True, metavar='"second.mu=2*first.alpha"', help="Let one equal another."
    ),
    click.option(
        "--own", multiple=True, metavar="NAME", help="A value of its own for every recording."
    ),
    click.option("--mask", multiple=True, metavar='"3 s..4 s"', help="Leave out these times."),
)
_loss = click.option(
    "--loss",
    type=click.Choice(["least_squares", "huber", "soft_l1", "student_t"]),
    default="least_squares",
    show_default=True,
    help="All but the first let outliers weigh less.",
)


@cli.command("fit")
@_recordings
@click.option("--model", "names", multiple=True, required=True, help="Once or more; see `models`.")
@_folder_option
@click.option(
    "--holdout", "unseen", multiple=True, metavar="FILE", help="A recording that no fit sees."
)
@click.option(
    "--profile", "profiled", multiple=True, metavar="NAME", help="Its profile likelihood too."
)
@click.option(
    "--frequency-response",
    "of_frequency",
    is_flag=True,
    help="Of a table of frequency, amplitude and phase, by a linear law.",
)
@_asking
@_options(_loss, _reading, _history, _settle, _seed, _quiet, _json)
@click.pass_obj
def fit_command(
    saved: list[Path],
    recordings: tuple[str, ...],
    names: tuple[str, ...],
    out: Path,
    unseen: tuple[str, ...],
    profiled: tuple[str, ...],
    of_frequency: bool,
    loss: Loss,
    history: str,
    settle: str | None,
    seed: int,
    quiet: bool,
    as_json: bool,
    **others: Any,
) -> int:
    """Fit models to recordings, jointly where there are several.

    Writes fit.json (of the best model by BIC), report.html and, for several models, one
    fit_MODEL.json each and comparison.json: all of them on the data fitted and on data held out,
    the recordings of --holdout or stretches set aside in turn.  What is asked of a parameter
    concerns the models that have it; --fix to --mask may be given more than once.
    """
    if of_frequency:
        return _fit_table(
            recordings, names, out, others, seed=seed, quiet=quiet, as_json=as_json, saved=saved
        )
    from ._fit import Comparison, compared, fit, options_for, options_of, with_profiles
    from ._io import read
    from ._report import write_report
    from ._report._text import file_name, fit_sentence, key_figures

    asked = options_of(**{name: others.pop(name) for name in _ASKED})
    taken, models = _understood(recordings, names, others)
    settling = _samples(settle, taken)
    held_out = [read(path, **others) for path in unseen]
    everything = {name for model in models for name in model.parameters}

    _prepare_jax()
    with _folder(out):
        fits = []
        with _stages(quiet) as progress:
            for model in models:
                told = options_for(
                    {**asked, "profiled": profiled}, model.parameters.keys(), everything
                )
                wanted = told.pop("profiled")
                found = fit(
                    model,
                    taken,
                    history=_known(history),
                    settling=settling,
                    loss=loss,
                    seed=seed,
                    progress=progress,
                    **told,
                )
                found = with_profiles(found, wanted, progress)
                fits.append(found)
                if len(models) > 1:
                    _save(found.save, out / f"fit_{file_name(model.name)}.json", saved)
            several = len(models) > 1 or bool(held_out)
            result = compared(fits, holdout=held_out, progress=progress) if several else fits[0]
            best = list(result.fits) if isinstance(result, Comparison) else fits
            progress("writing the report")
            _save(best[0].save, out / "fit.json", saved)
            if several:
                _save(result.save, out / "comparison.json", saved)
            _save(lambda path: write_report(result, path), out / "report.html", saved)
    if as_json:
        print(json.dumps(result.to_dict(), indent=1))
    elif not quiet:
        notes = [note for found in best for note in (*_profile_notes(found), *_doubts(found))]
        notes.append(_leftovers(best[0]))
        figures = key_figures(result if isinstance(result, Comparison) else fits)
        _summary(fit_sentence(best), figures, notes, saved, _parameter_figures(best[0]))
    return _status(fits, out)


def _fit_table(
    paths: Sequence[str],
    names: Sequence[str],
    out: Path,
    options: dict[str, Any],
    *,
    seed: int,
    quiet: bool,
    as_json: bool,
    saved: list[Path],
) -> int:
    """`fracjax fit --frequency-response`: linear laws, fitted to one table."""
    from ._fit import fit_frequency_response, options_for, options_of, read_frequency_table
    from ._models import parse_model
    from ._report import write_report
    from ._report._text import file_name, frequency_figures, frequency_sentence

    asked = options_of(**{name: options[name] for name in _ASKED})
    if len(paths) > 1 or asked.keys() & {"mask", "own"}:
        raise click.UsageError(
            "--frequency-response takes one table, and neither --mask nor --own",
            click.get_current_context(),
        )
    table = read_frequency_table(
        paths[0], drive_unit=options["input_unit"], response_unit=options["output_unit"]
    )
    models = [parse_model(name, table.setting) for name in dict.fromkeys(names)]
    everything = {name for model in models for name in model.parameters}
    _prepare_jax()
    with _folder(out), _stages(quiet) as progress:
        fits = []
        for model in models:
            told = options_for(asked, model.parameters.keys(), everything)
            fits.append(fit_frequency_response(model, table, seed=seed, progress=progress, **told))
        fits.sort(key=lambda found: found.bic)
        progress("writing the report")
        if len(fits) > 1:
            for found in fits:
                _save(found.save, out / f"fit_{file_name(found.model.name)}.json", saved)
        _save(fits[0].save, out / "fit.json", saved)
        _save(lambda path: write_report(fits, path), out / "report.html", saved)
    if as_json:
        told = [found.to_dict() for found in fits]
        print(json.dumps(told[0] if len(told) == 1 else told, indent=1))
    elif not quiet:
        notes = [note for found in fits for note in _doubts(found)]
        figures = frequency_figures(fits)
        _summary(frequency_sentence(fits), figures, notes, saved, _parameter_figures(fits[0]))
    return _status(fits, out)


def _parameter_figures(found: Fit | FrequencyFit) -> tuple[list[str], list[list[str]]]:
    """The parameters of a fit, and what is known of them together."""
    from ._report._text import parameter_rows

    heads = [found.model.name, "value", "95 % interval", "unit", "remark"]
    return heads, [list(row.values()) for row in parameter_rows(found)]


def _leftovers(found: Fit) -> str:
    """What the tests on the residual of the first recording say."""
    from ._fit import analyse_residuals

    return "; ".join(analyse_residuals(found)[0].findings) + "."


def _profile_notes(found: Fit) -> list[str]:
    """The intervals of the profiles that were asked for."""
    from ._report._text import figure, pretty_unit

    notes = []
    for profile in found.profiles:
        low, high = ("open" if end is None else figure(end, 5) for end in profile.interval_95)
        unit = pretty_unit(profile.unit)
        notes.append(f"Profile of {profile.name}: 95 % from {low} to {high} {unit}".strip() + ".")
    return notes


# crosscheck ---------------------------------------------------------------------------------------


@cli.command("crosscheck")
@_recordings
@click.option("--model", "name", required=True, help="See `models`.")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="For the results.")
@_options(_reading, _history, _settle, _seed, _quiet, _json)
@click.pass_obj
def crosscheck_command(
    saved: list[Path],
    recordings: tuple[str, ...],
    name: str,
    out: Path | None,
    history: str,
    settle: str | None,
    seed: int,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Fit a model by gradients, bounded L-BFGS, particle swarm and evolution, side by side.

    PSO and DE search with gains eliminated, as the gradient fit does, and over all parameters, as
    the papers do: there each gain stays within 3 times what spans the response alone.  With --out
    it writes crosscheck.json, report.html and fit.json, the gradient fit.
    """
    taken, (model,) = _understood(recordings, [name], columns)
    settling = _samples(settle, taken)
    from ._fit import crosscheck
    from ._report import write_report
    from ._report._text import crosscheck_figures, crosscheck_sentence

    _prepare_jax()
    with nullcontext() if out is None else _folder(out), _stages(quiet) as progress:
        found = crosscheck(
            model,
            taken,
            history=_known(history),
            settling=settling,
            seed=seed,
            progress=progress,
        )
        if out is not None:
            progress("writing the report")
            _save(found.save, out / "crosscheck.json", saved)
            _save(found.fit.save, out / "fit.json", saved)
            _save(lambda path: write_report(found, path), out / "report.html", saved)
    if as_json:
        print(json.dumps(found.to_dict(), indent=1))
    elif not quiet:
        _summary(crosscheck_sentence(found), crosscheck_figures(found), _doubts(found.fit), saved)
    return _status([found.fit], out)


# batch --------------------------------------------------------------------------------------------


@cli.command("batch")
@click.argument("paths", nargs=-1, required=True, metavar="PATH...")
@click.option("--model", "name", required=True, help="See `models`.")
@_folder_option
@click.option(
    "--cluster", metavar="ADDRESS", help="Of a dask scheduler, whose workers do the fits."
)
@_options(_reading, _history, _settle, _seed, _quiet, _json)
@click.pass_obj
def batch_command(
    saved: list[Path],
    paths: tuple[str, ...],
    name: str,
    out: Path,
    cluster: str | None,
    history: str,
    settle: str | None,
    seed: int,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Fit a model to each of many recordings: files, folders, or patterns.

    Writes fits.parquet, one row per recording.  The same call again does what is missing.
    """
    from ._batch import FITS, fit_batch

    _prepare_jax()
    # Of a lost scheduler it would print a traceback; that it is lost is said below.
    logging.getLogger("distributed.client").disabled = True
    with _folder(out):
        try:
            with _bar(quiet) as progress:
                rows = fit_batch(
                    name,
                    paths,
                    out=out,
                    cluster=cluster,
                    read_options=columns,
                    history=_known(history),
                    settling=settle,
                    seed=seed,
                    progress=progress,
                )
        finally:
            if (out / FITS).exists():
                saved.append(out / FITS)
    told = _batch_as_data(rows, name, out / FITS)
    if as_json:
        print(json.dumps(told, indent=1))
    elif not quiet:
        counts = [f"{n} {status}" for status, n in told["counts"].items() if n]
        sentence = f"{name}: of {told['recordings']} recordings {', '.join(counts)}."
        _summary(sentence, _batch_figures(rows), _batch_notes(told["unfitted"]), saved)
    return _batch_status(told)


def _batch_as_data(rows: pd.DataFrame, name: str, table: Path) -> dict[str, Any]:
    from ._batch import SCHEMA, STATUSES

    told = rows.loc[:, ["source", "status", "reason"]].to_dict("records")
    statuses = [row["status"] for row in told]
    return {
        "schema": SCHEMA,
        "model": name,
        "table": str(table),
        "recordings": len(told),
        "counts": {status: statuses.count(status) for status in STATUSES},
        "unfitted": [row for row in told if row["status"] != "fitted"],
    }


def _batch_figures(rows: pd.DataFrame) -> tuple[list[str], list[list[str]]]:
    """Each parameter's spread over the fitted recordings; where units differ, none is said."""
    from ._report._text import figure, pretty_unit

    fitted = rows.loc[rows["status"] == "fitted"]
    labels = [c.removesuffix(".value") for c in rows.columns if c.endswith(".value")]
    columns = [("RMSE", "rmse", "response_unit")]
    columns += [(label, f"{label}.value", f"{label}.unit") for label in labels]
    table = []
    for label, value, unit in columns if len(fitted) else []:
        units = set(fitted[unit])
        spread = [figure(float(fitted[value].quantile(share))) for share in (0.1, 0.5, 0.9)]
        table.append([label, *spread, pretty_unit(units.pop()) if len(units) == 1 else ""])
    return ["", "10 % below", "median", "10 % above", "unit"], table


def _batch_notes(unfitted: list[dict[str, str]]) -> list[str]:
    """Why recordings were not fitted, of the first few."""
    notes = [f"{row['status'].capitalize()}: {row['reason']}" for row in unfitted[:_NOTES]]
    if len(unfitted) > _NOTES:
        notes.append(f"And {len(unfitted) - _NOTES} more: see the column reason.")
    return notes


def _batch_status(told: dict[str, Any]) -> int:
    """0; 2 where no recording could be read; 3 where one was read, and has no converged fit."""
    counts, total = told["counts"], told["recordings"]
    if counts["unreadable"] == total:
        first = told["unfitted"][0]["reason"].rstrip(".")
        return _fail(f"Of {total} recordings none could be read; the first: {first}.", UNUSABLE)
    if stopped := counts["not converged"] + counts["failed"]:
        return _fail(
            f"{stopped} of {total} fits did not converge; what they reached, and why, was saved in "
            f"{told['table']}.",
            NOT_CONVERGED,
        )
    return 0


# posterior ----------------------------------------------------------------------------------------


@cli.command("posterior")
@click.argument("recording")
@click.option("--model", "name", required=True, help="See `models`.")
@_folder_option
@click.option("--resume", is_flag=True, help="Go on from the chain in DIR.")
@click.option(
    "--noise-model",
    type=click.Choice(["white", "ar", "measured", "student"]),
    default="measured",
    show_default=True,
    help="Its parameters are sampled too; `student` lets outliers weigh little.",
)
@click.option("--repeat", metavar="FILE", help="The same drive again, for the measured noise.")
@click.option("--walkers", type=int, help="An even number; by default as many as suit the model.")
@click.option("--steps", type=int, default=10_000, show_default=True, help="At most.")
@_options(_reading, _history, _settle, _seed, _quiet, _json)
@click.pass_obj
def posterior_command(
    saved: list[Path],
    recording: str,
    name: str,
    out: Path,
    resume: bool,
    noise_model: str,
    repeat: str | None,
    walkers: int | None,
    steps: int,
    history: str,
    settle: str | None,
    seed: int,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Sample the posterior of a model's parameters and of the noise's.

    Writes posterior.nc (which ArviZ reads), posterior.json, report.html and fit.json; chain.h5
    grows meanwhile, and a run that was killed goes on from it by --resume.
    """
    from ._fit import fit, measured_noise
    from ._io import read

    taken, (model,) = _understood([recording], [name], columns)
    settling = _samples(settle, taken)
    again = repeat and read(repeat, **columns)
    noise = measured_noise(taken[0], again) if again else None
    from ._posterior import sample_posterior
    from ._report import write_report

    _prepare_jax()
    chain = out / "chain.h5"
    with _folder(out):
        try:
            with _chain_bar(quiet, steps) as progress:
                found = fit(
                    model, taken, noise=noise, history=_known(history), settling=settling, seed=seed
                )
                _save(found.save, out / "fit.json", saved)
                posterior = sample_posterior(
                    found,
                    noise_model=_noise_model(noise_model, found),
                    walkers=walkers,
                    steps=steps,
                    seed=seed,
                    chain=chain,
                    resume=resume,
                    progress=progress,
                )
        finally:
            if chain.exists():
                saved.append(chain)
        posterior.save(out)
        saved += [out / "posterior.nc", out / "posterior.json"]
        _save(lambda path: write_report(posterior, path), out / "report.html", saved)
    if as_json:
        print(json.dumps(posterior.to_dict(), indent=1))
    elif not quiet:
        together = posterior.known_only_together
        notes = [f"Known only together: {'; '.join(together)}."] if together else []
        _summary(posterior.sentence, _posterior_figures(posterior), notes, saved)
    if posterior.converged:
        return 0
    return _fail(
        f"The chain of {name} did not converge in {posterior.steps} steps; what it reached was "
        f"saved in {out}; go on with --resume and more --steps.",
        NOT_CONVERGED,
    )


def _noise_model(name: str, found: Fit) -> AbstractNoiseModel:
    from ._posterior import MeasuredNoise, StudentNoise, WhiteNoise, ar_noise_of

    if name == "ar":
        return ar_noise_of(found)
    return {"white": WhiteNoise, "measured": MeasuredNoise, "student": StudentNoise}[name]()


def _posterior_figures(posterior: Posterior) -> tuple[list[str], list[list[str]]]:
    from ._report._posterior_page import cells

    heads = ["", "mean", "sd", "95 % interval", "unit", "draws", "R-hat", "Laplace"]
    fields = ("name", "mean", "sd", "interval", "unit", "ess", "r_hat", "laplace")
    rows = [cells(row) for row in posterior.summary]
    return heads, [[row[field] for field in fields] for row in rows]


# diagnose -----------------------------------------------------------------------------------------


@cli.command("diagnose")
@_recordings
@click.option("--model", "name", required=True, help="The model to be questioned; see `models`.")
@_folder_option
@click.option("--holdout", metavar="FILE", help="A recording that no fit sees.")
@click.option("--repeat", metavar="FILE", help="The same drive again, for the noise floor.")
@click.option("--noise", metavar='"0.07 um"', help="The sensor's noise, rms, as specified.")
@click.option(
    "--limits",
    metavar='"0..100 V, 50 V/ms"',
    help="What the next experiment may ask for: the drive's range and its fastest change.",
)
@_options(_reading, _history, _settle, _seed, _quiet, _json)
@click.pass_obj
def diagnose_command(
    saved: list[Path],
    recordings: tuple[str, ...],
    name: str,
    out: Path,
    holdout: str | None,
    repeat: str | None,
    noise: str | None,
    limits: str | None,
    history: str,
    settle: str | None,
    seed: int,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Say whether, where and why a model and recordings differ.

    Writes diagnosis.json, report.html and fit.json, the model with what was found; and
    next_experiment.csv, the drive that would tell look-alikes apart, where there are any.
    """
    from ._diagnose import parse_limits
    from ._io import read

    taken, (model,) = _understood(recordings, [name], columns)
    options: dict[str, Any] = {
        "holdout": holdout and read(holdout, **columns),
        "repeat": repeat and read(repeat, **columns),
        "noise": noise and _specification(noise, taken[0].response_unit),
        "limits": limits and parse_limits(limits, taken),
        "history": _known(history),
        "settling": _samples(settle, taken),
        "seed": seed,
    }
    with _folder(out), _stages(quiet) as progress:
        diagnosis = _diagnosed(model, taken, out, saved, progress, options)
    return _concluded(diagnosis, out, saved, quiet, as_json)


@cli.command("demo")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("fracjax-demo"),
    show_default=True,
    metavar="DIR",
    help="For the results.",
)
@_options(_quiet, _json)
@click.pass_obj
def demo_command(saved: list[Path], out: Path, quiet: bool, as_json: bool) -> int:
    """Diagnose a shipped recording with a concealed effect."""
    from importlib.resources import as_file, files

    from ._io import read

    with as_file(files("fracjax") / "_demo") as folder:
        training, held_out = (read(folder / f"{name}.csv") for name in ("training", "heldout"))
    model = _models_for(["foh"], [training])[0]
    began = time.perf_counter()

    def told(sentence: str) -> None:
        if not (quiet or as_json):
            print(f"{time.perf_counter() - began:6.1f} s  {sentence}", flush=True)

    with _folder(out):
        diagnosis = _diagnosed(model, [training], out, saved, told, {"holdout": held_out})
    return _concluded(diagnosis, out, saved, quiet, as_json)


def _diagnosed(
    model: Model,
    recordings: list[Recording],
    out: Path,
    saved: list[Path],
    progress: Progress,
    options: dict[str, Any],
) -> Diagnosis:
    """The diagnosis, saved."""
    from ._diagnose import diagnose
    from ._io import column_name, write
    from ._report import write_report

    _prepare_jax()
    diagnosis = diagnose(model, recordings, progress=progress, **options)
    progress("writing the report")
    _save(diagnosis.save, out / "diagnosis.json", saved)
    _save((diagnosis.extended or diagnosis.base).save, out / "fit.json", saved)
    if diagnosis.next_experiment:
        drive = diagnosis.next_experiment.drive
        head = column_name("drive", diagnosis.base.preparation.takes[0].recording.drive_unit)
        write(out / "next_experiment.csv", {"time_s": drive.times, head: drive.values})
        saved.append(out / "next_experiment.csv")
    _save(lambda path: write_report(diagnosis, path), out / "report.html", saved)
    return diagnosis


def _concluded(
    diagnosis: Diagnosis, out: Path, saved: list[Path], quiet: bool, as_json: bool
) -> int:
    """Print a diagnosis and return the exit status."""
    from ._report._text import key_figures

    fits = [diagnosis.base] + ([diagnosis.extended] if diagnosis.extended else [])
    if as_json:
        print(json.dumps(diagnosis.to_dict(), indent=1))
    elif not quiet:
        notes = [diagnosis.where, *(note for found in fits for note in _doubts(found))]
        if diagnosis.next_experiment:
            notes.append(f"Next: {diagnosis.next_experiment.sentence}")
        _summary(diagnosis.sentence, key_figures(diagnosis), notes, saved)
    return _status(fits, out)


# simulate -----------------------------------------------------------------------------------------


@cli.command("simulate")
@click.argument("drive")
@click.option("--model", "name", help="A model at its nominal parameters; see `models`.")
@click.option("--fit", "fitted", metavar="FILE", help="A fit.json.")
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="The suffix tells the format: .csv .mat .h5 .npz .parquet .tdms .xlsx.",
)
@click.option(
    "--history",
    type=click.Choice(["rest", "constant", "periodic"]),
    default="constant",
    show_default=True,
    help="What the drive did before the first sample.",
)
@_options(_time, _input, _rate, _input_unit, _resample, _output_unit, _quiet, _json)
@click.pass_obj
def simulate_command(
    saved: list[Path],
    drive: str,
    name: str | None,
    fitted: str | None,
    out: Path,
    output_unit: str | None,
    history: History,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Simulate a model's response to a recorded drive.

    The file need not hold a response.
    """
    import numpy as np

    from ._io import column_name, read_drive, write
    from ._models import parse_model
    from ._simulate import simulate

    if (name is None) == (fitted is None):
        raise click.UsageError("Give either --model or --fit")
    samples, step, drive_unit = read_drive(drive, **columns)
    if fitted is None:
        model, response_unit = parse_model(name or ""), output_unit or "um"
    else:
        model, samples, drive_unit, response_unit = _fitted(fitted, samples, drive_unit)
    _prepare_jax()
    with _stages(quiet) as progress:
        progress(f"simulating {model.name}")
        response, error = simulate(model, samples, step, history)
    signals = {"time_s": step * np.arange(len(samples))}
    signals |= {
        column_name("drive", drive_unit): samples,
        column_name("response", response_unit): response,
    }
    write(out, signals)
    saved.append(out)
    sentence = (
        f"{model.name} was simulated over {len(samples)} samples; discretisation changes the "
        f"response by {100 * error:.2g} % of its span."
    )
    if as_json:
        span = [float(response.min()), float(response.max())]
        told = {"schema": "fracjax.simulation/1", "model": model.name, "file": str(out)}
        told |= {"samples": len(samples), "range": span, "unit": response_unit, "error": error}
        print(json.dumps(told, indent=1))
    elif not quiet:
        _summary(sentence, ([], []), [], saved)
    if not error <= 1e-2:
        return _fail(
            f"The simulation of {model.name} did not converge as its grid was refined; its finest "
            f"result was saved in {out}.",
            NOT_CONVERGED,
        )
    return 0


def _fitted(path: str, drive: np.ndarray, drive_unit: str) -> tuple[Model, np.ndarray, str, str]:
    """A fitted model, the drive in the unit it was fitted in, and both units."""
    from ._fit import load_model
    from ._recording import parse_quantity

    model = load_model(path)
    units = json.loads(Path(path).read_text(encoding="utf-8"))["units"]
    scale = parse_quantity(f"1 {drive_unit}", units["drive"], "drive")
    return model, drive * scale, units["drive"], units["response"]


# compensate ---------------------------------------------------------------------------------------


@cli.command("compensate")
@click.argument("trajectory")
@click.option("--fit", "fitted", required=True, metavar="FILE", help="A fit.json.")
@_folder_option
@click.option("--limits", metavar='"0..100 V"', help="Lowest and highest drive.")
@click.option("--slew", metavar='"50 V/ms"', help="Fastest change of the drive.")
@click.option(
    "--regularisation", metavar='"2 ms"', help="Damp detail of the drive faster than this time."
)
@click.option(
    "--offset",
    metavar='"-3 um"',
    help="What the sensor reads where the model says zero; by default as in the fitted recording.",
)
@click.option(
    "--history",
    type=click.Choice(["rest", "constant", "periodic"]),
    default="constant",
    show_default=True,
    help="What the drive did before the first sample.",
)
@click.option(
    "--posterior", "posterior", metavar="DIR", help="Its draws give the prediction's band."
)
@click.option(
    "--streaming", is_flag=True, help="Write the linear inverse for a real-time loop, too."
)
@_options(_time, _output, _rate, _output_unit, _resample, _quiet, _json)
@click.pass_obj
def compensate_command(
    saved: list[Path],
    trajectory: str,
    fitted: str,
    out: Path,
    limits: str | None,
    slew: str | None,
    regularisation: str | None,
    offset: str | None,
    history: History,
    posterior: str | None,
    streaming: bool,
    quiet: bool,
    as_json: bool,
    **columns: str | None,
) -> int:
    """Find the drive that makes a fitted model's response follow a trajectory.

    Writes the drive (in the trajectory's format), compensation.json and report.html; with
    --streaming also inverse.json and inverse.h.  The file's drive, if it has one, is not used.
    """
    from ._compensate import compensate
    from ._io import SUFFIXES
    from ._recording import parse_quantity
    from ._report import write_report
    from ._report._compensation_page import compensation_figures, sentence_of, warnings_of

    desired, model, drive_unit, zero = _wanted(trajectory, fitted, columns)
    unit = desired.response_unit
    options: dict[str, Any] = {
        "limits": limits and _range(limits, drive_unit, "--limits"),
        "slew": slew and parse_quantity(slew, f"{drive_unit}/s", "--slew"),
        "regularisation": parse_quantity(regularisation or 0.0, "s", "--regularisation"),
        "offset": zero if offset is None else parse_quantity(offset, unit, "--offset"),
        "history": history,
        "drive_unit": drive_unit,
        "draws": posterior and _draws(posterior),
    }
    suffix = Path(trajectory).suffix.lower()
    _prepare_jax()
    with _folder(out), _stages(quiet) as progress:
        found = compensate(model, desired, progress=progress, **options)
        drive_file = out / f"drive{suffix if suffix in SUFFIXES else '.csv'}"
        found.write_drive(drive_file)
        saved.append(drive_file)
        _save(found.save, out / "compensation.json", saved)
        notes = warnings_of(found)
        if streaming:
            progress("writing the streaming inverse")
            notes.append(_streamed(model, found, out, saved))
        progress("writing the report")
        _save(lambda path: write_report(found, path), out / "report.html", saved)
    if as_json:
        print(json.dumps(found.to_dict(), indent=1))
    elif not quiet:
        _summary(sentence_of(found), compensation_figures(found), notes, saved)
    if found.converged:
        return 0
    return _fail(
        f"The inversion of {model.name} did not converge; the best drive it reached was saved in "
        f"{out}.",
        NOT_CONVERGED,
    )


def _streamed(model: Model, found: Compensation, out: Path, saved: list[Path]) -> str:
    """Write the streaming inverse, and say how near it comes."""
    import numpy as np

    from ._compensate import streaming_inverse
    from ._report._text import figure
    from ._simulate import simulate

    band = 0.1 / (found.dt * len(found.drive)), 0.02 / found.dt
    inverse = streaming_inverse(model, found.dt, band, offset=found.offset, units=found.units)
    _save(inverse.save, out / "inverse.json", saved)
    _save(inverse.save_header, out / "inverse.h", saved)
    drive = inverse.run(found.desired, settled=found.history != "rest")
    response = simulate(model, drive, found.dt, found.history).response + found.offset
    missed = float(np.abs(response - found.desired).max() / found.stroke)
    which = "inverse" if inverse.complete else "inverse of the linear part"
    return (
        f"Streaming: {len(inverse.decay)} sections, within {figure(100 * inverse.error)} % of the "
        f"{which} from {figure(band[0])} to {figure(band[1])} Hz; along this trajectory it misses "
        f"by {figure(100 * missed)} % of the stroke at most."
    )


def _wanted(
    path: str, fitted: str, columns: dict[str, str | None]
) -> tuple[Trajectory, Model, str, float]:
    """The trajectory in the unit of a fit, its model, the drive's unit, and the fit's offset."""
    from ._compensate import Trajectory
    from ._fit import load_model
    from ._io import read_response
    from ._recording import parse_quantity

    model = load_model(fitted)
    told = json.loads(Path(fitted).read_text(encoding="utf-8"))
    samples, step, written = read_response(path, **columns)
    unit = told["units"]["response"]
    scale = parse_quantity(f"1 {written}", unit, f"{path}, response")
    trajectory = Trajectory(scale * samples, step, unit, path)
    return trajectory, model, told["units"]["drive"], told["offsets"][0]


def _range(text: str, unit: str, where: str) -> tuple[float, float]:
    """Two values such as "0..100 V", in a unit; what the first leaves unsaid the second tells."""
    from ._recording import InputError, parse_quantity

    low, dots, high = text.partition("..")
    if not dots:
        raise InputError.at(where, f'a range such as "0..100 {unit}"', f'"{text}"', "correct it")
    written = re.sub(r"^\s*[-+0-9.eE]*", "", high)
    bare = re.fullmatch(r"\s*[-+0-9.eE]+\s*", low)
    return (
        parse_quantity(f"{low} {written}" if bare else low, unit, where),
        parse_quantity(high, unit, where),
    )


def _draws(folder: str) -> dict[str, np.ndarray]:
    from ._posterior import load_posterior

    return load_posterior(folder).samples


# info, models, effects ----------------------------------------------------------------------------


@cli.command("info")
@click.argument("recording")
@_options(_reading, _json)
def info_command(recording: str, as_json: bool, **columns: str | None) -> None:
    """Say what was understood of a recording."""
    from ._io import read
    from ._report._description import describe

    told = describe(read(recording, **columns))
    if as_json:
        print(json.dumps(told, indent=1))
    else:
        _table([], _info_rows(told))
        for warning in told["warnings"]:
            print(f"Warning: {warning}")


def _info_rows(told: dict[str, Any]) -> list[list[str]]:
    from ._report._text import figure, pretty_unit, quantity

    def extent(signal: dict) -> str:
        return f"{figure(signal['low'], 4)} to {quantity(signal['high'], signal['unit'])}"

    drive, period, rests, noise = told["drive"], told["period"], told["rests_s"], told["noise"]
    rows = [
        ["source", told["source"]],
        ["samples", f"{told['samples']} at {told['rate_Hz']:.6g} Hz, {told['duration_s']:.6g} s"],
        [
            "drive",
            f"{extent(drive)}, {drive['kind']}, up to {figure(drive['top_frequency_Hz'])} Hz",
        ],
        ["response", extent(told["response"])],
    ]
    if period is None:
        rows.append(["period", "none found that repeats three times"])
    else:
        rows.append(
            [
                "period",
                f"{period['seconds']:.4g} s, {period['repeats']:.4g} repeats from "
                f"{period['from_s']:.4g} to {period['to_s']:.4g} s",
            ]
        )
        opening = figure(told["loop_opening_percent"])
        rows.append(["loop opening", f"{opening} % of the response's span"])
    held = sum(stop - start for start, stop in rests)
    rows.append(["rests", f"{len(rests)}, {held:.3g} s in all" if rests else "none"])
    if noise is None:
        unit = pretty_unit(told["response"]["unit"])
        rows.append(["noise floor", f"not to be seen here; give diagnose --noise in {unit}"])
    else:
        source = {"repeats": "from repeats", "static": "at rest"}[noise["method"]]
        rows.append(["noise floor", f"{quantity(noise['sigma'], noise['unit'])}, {source}"])
    return rows


@cli.command("models")
@_json
def models_command(as_json: bool) -> None:
    """List the models with their equations and parameters."""
    from ._models import MODELS

    listed = [_law(name, make()) for name, make in MODELS.items()]
    if as_json:
        print(json.dumps(listed, indent=1))
        return
    _table(
        ["model", "what it is", "equation", "parameters"],
        [
            [
                law["name"],
                law["sentence"],
                law["equation"],
                "\n".join(
                    f"{p['name']} [{p['unit']}]" if p["unit"] != "1" else p["name"]
                    for p in law["parameters"]
                ),
            ]
            for law in listed
        ],
    )
    print('Models and effects are joined in series by >> and in parallel by +: "foh >> creep".')


def _law(name: str, block: AbstractBlock) -> dict[str, Any]:
    """A model as plain data, its words those of its blocks' docstrings."""
    import inspect

    parts = _parts(block)
    lines = [inspect.cleandoc(type(part).__doc__ or "").splitlines() for part in parts]
    equations = [line.strip() for part in lines for line in part if line.startswith("    ")]
    openings = [re.sub(r" \[[FL][^]]*\]", "", part[0]).rstrip(":.") for part in lines]
    return {
        "name": name,
        "sentence": "; then ".join(openings),
        "equation": "\n".join(equations),
        "parameters": _parameters(block),
    }


def _parts(block: AbstractBlock) -> list[AbstractBlock]:
    """The laws that a composition holds, in order."""
    from ._blocks._block import LinearParallel, LinearSeries, Parallel, Series

    if isinstance(block, Series | LinearSeries | Parallel | LinearParallel):
        return _parts(block.first) + _parts(block.second)
    return [block]


def _parameters(block: AbstractBlock) -> list[dict[str, Any]]:
    """A block's free parameters as plain data; of a vector the widest range, None for any."""
    import numpy as np

    from ._parameters import named_parameters

    rows = []
    for name, parameter in named_parameters(block).items():
        if not parameter.fixed:
            low, high = (f(p) for f, p in zip((np.min, np.max), parameter.plausible, strict=True))
            plausible = [float(low), float(high)] if np.isfinite(high - low) else None
            rows.append({"name": name, "unit": parameter.unit, "plausible": plausible})
    return rows


@cli.command("effects")
@click.argument("name", required=False)
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw the effect's signature, as .svg, .png or .pdf.",
)
@_json
@click.pass_obj
def effects_command(
    saved: list[Path], name: str | None, picture: Path | None, as_json: bool
) -> None:
    """List the effects that diagnose knows, or tell all about one."""
    from ._blocks import EFFECTS
    from ._recording import InputError

    if name is not None and name not in EFFECTS:
        raise InputError(
            f'effect "{name}": expected one of {", ".join(EFFECTS)}, found none of that name; '
            "correct it"
        )
    if picture is not None:
        _drawn(name, picture, saved)
    listed = [_effect(key) for key in ([name] if name else EFFECTS)]
    if as_json:
        print(json.dumps(listed[0] if name else listed, indent=1))
    elif name is None:
        _table(
            ["effect", "inserted at", "equation", "what it is"],
            [[e["name"], e["site"], e["equation"], e["sentence"]] for e in listed],
        )
    else:
        _table([], _effect_rows(listed[0]))


def _drawn(name: str | None, picture: Path, saved: list[Path]) -> None:
    from ._recording import InputError
    from ._report._effect_picture import draw_effect

    if name is None or picture.suffix not in (".svg", ".png", ".pdf"):
        raise InputError.at(
            "--picture",
            "the name of an effect and a file ending in .svg, .png or .pdf",
            f'"{picture}" for {name or "all effects"}',
            "name one effect and such a file",
        )
    draw_effect(name, picture)
    saved.append(picture)


def _effect(name: str) -> dict[str, Any]:
    """A catalogue entry as plain data; ranges are those for a stack of common size."""
    from ._blocks import EFFECTS
    from ._models import _ORDINARY

    effect = EFFECTS[name]
    fields = ("name", "site", "sentence", "equation", "separated_by", "concealed_by", "source")
    return {field: getattr(effect, field) for field in fields} | {
        "parameters": _parameters(effect.trials(_ORDINARY)[0])
    }


def _effect_rows(effect: dict[str, Any]) -> list[list[str]]:
    from ._report._text import figure, pretty_unit, quantity

    parameters = [
        f"{p['name']}: {figure(p['plausible'][0])} to {quantity(p['plausible'][1], p['unit'])}"
        if p["plausible"]
        else f"{p['name']}: any {pretty_unit(p['unit'])}"
        for p in effect["parameters"]
    ]
    look_alikes = [f"{other}: told apart by {how}" for other, how in effect["separated_by"].items()]
    return [
        ["effect", effect["name"]],
        ["what it is", effect["sentence"]],
        ["equation", effect["equation"]],
        ["inserted at", effect["site"]],
        ["plausible", "\n".join(parameters)],
        ["look-alikes", "\n".join(look_alikes) or "none"],
        ["concealed by", effect["concealed_by"]],
        ["source", effect["source"]],
    ]


# Input --------------------------------------------------------------------------------------------


def _understood(
    paths: Sequence[str], names: Sequence[str], columns: dict[str, str | None]
) -> tuple[list[Recording], list[Model]]:
    """The recordings and models that a call names."""
    from ._io import read

    recordings = [read(path, **columns) for path in paths]
    return recordings, _models_for(list(dict.fromkeys(names)), recordings)


def _models_for(names: Sequence[str], recordings: list[Recording]) -> list[Model]:
    from ._fit._problem import setting_of
    from ._models import parse_model

    setting = setting_of(recordings)
    return [parse_model(name, setting) for name in names]


def _known(history: str) -> Past | None:
    """The history that the call states, None where the data shall decide."""
    return None if history == "auto" else history  # type: ignore[return-value]


def _samples(settle: str | None, recordings: list[Recording]) -> int | None:
    """A settling time in samples."""
    from ._fit import settling_samples

    if settle is None:
        return None
    samples = [settling_samples(settle, recording) for recording in recordings]
    return samples[0]


def _specification(noise: str, unit: str) -> float:
    """The sensor's noise in the response's unit."""
    from ._recording import InputError, parse_quantity

    sigma = parse_quantity(noise, unit, "--noise")
    if sigma <= 0:
        raise InputError.at("--noise", "a level above 0", f'"{noise}"', "give the rms noise")
    return sigma


def _prepare_jax() -> None:
    """Keep compiled programs from one run to the next, silently; JAX's own variables go first."""
    import jax
    import platformdirs

    if "JAX_LOGGING_LEVEL" not in os.environ:
        # XLA calls a cached program's tuning flags an error, at any lower level.
        jax.config.update("jax_logging_level", "CRITICAL")
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        folder = platformdirs.user_cache_path("fracjax") / "xla"
        jax.config.update("jax_compilation_cache_dir", str(folder))
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.1)


# Output -------------------------------------------------------------------------------------------


@contextmanager
def _folder(path: Path) -> Iterator[None]:
    """A folder for results, taken away again if the work fails before anything is in it."""
    created = [place for place in (path, *path.parents) if not place.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        probe = path / ".part"
        probe.touch()
        probe.unlink()
        yield
    except BaseException:
        with suppress(OSError):
            for place in created:
                place.rmdir()
        raise


def _save(write: Callable[[Path], None], path: Path, saved: list[Path]) -> None:
    """Write a file whole or not at all, and note it."""
    part = path.with_name(f".{path.name}.part")
    try:
        write(part)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    saved.append(path)


@contextmanager
def _stages(quiet: bool) -> Iterator[Progress]:
    """Stages with a spinner and the time each took, where someone watches stderr."""
    if quiet or not sys.stderr.isatty():
        yield lambda sentence: None
        return
    from rich.console import Console
    from rich.progress import Progress as Bars
    from rich.progress import SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(finished_text=" "), TextColumn("{task.description}", markup=False)
    with Bars(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as bars:

        def finish() -> None:
            for task in bars.task_ids:
                bars.update(task, completed=1)

        def begin(sentence: str) -> None:
            finish()
            bars.add_task(sentence, total=1)

        yield begin
        finish()


@contextmanager
def _bar(quiet: bool) -> Iterator[Count]:
    """A bar with the time left, where someone watches stderr."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as Bars

    columns = BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn()
    with Bars(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("fitting", total=None)

        def count(done: int, total: int) -> None:
            bars.update(task, completed=done, total=total)

        yield count


@contextmanager
def _chain_bar(quiet: bool, steps: int) -> Iterator[Callable[[int, int, str], None]]:
    """A bar of steps with the running estimate, where someone watches stderr."""
    if quiet or not sys.stderr.isatty():
        yield lambda done, most, estimate: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    text = TextColumn("{task.description}", markup=False)
    columns = BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn(), text
    with Bars(*columns, console=Console(stderr=True)) as bars:
        task = bars.add_task("fitting", total=steps)

        def told(done: int, most: int, estimate: str) -> None:
            bars.update(task, completed=done, total=most, description=estimate)

        yield told


def _doubts(fit: Fit | FrequencyFit) -> list[str]:
    """What the data do not determine, by name, and what was held against the fit."""
    unknown = [e.name for e in fit.estimates if not e.identified]
    bound = [e.name for e in fit.estimates if e.at_bound]
    return [f"Warning: {warning}" for warning in fit.warnings] + [
        f"{fit.model.name}: {text}."
        for text, found in (
            (f"this recording does not identify {', '.join(unknown)}", unknown),
            (f"ended on its bound: {', '.join(bound)}", bound),
            (f"known only together: {'; '.join(fit.correlated)}", fit.correlated),
        )
        if found
    ]


def _summary(
    sentence: str,
    table: tuple[list[str], list[list[str]]],
    notes: Sequence[str],
    saved: Sequence[Path],
    parameters: tuple[list[str], list[list[str]]] | None = None,
) -> None:
    """The plain sentence, the key figures, parameters, what to mind, and where everything is."""
    from rich.console import Console

    Console(markup=False, highlight=False).print(sentence, style="bold", soft_wrap=True)
    if table[1]:
        _table(*table)
    if parameters is not None and parameters[1]:
        _table(*parameters)
    for note in notes:
        print(note)
    if saved:
        print("Written: " + ", ".join(map(str, saved)))


def _table(heads: list[str], rows: list[list[str]]) -> None:
    """A table on stdout, without heads a list of facts; as wide as the terminal, else 120."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, show_header=bool(heads), show_edge=False, pad_edge=False)
    for head in heads or rows[0]:
        table.add_column(head)
    for row in rows:
        table.add_row(*row)
    width = None if sys.stdout.isatty() else 120
    Console(markup=False, emoji=False, highlight=False, width=width).print(table)


def _status(fits: Sequence[Fit | FrequencyFit], out: Path | None) -> int:
    """0, or 3 and a sentence where a fit did not converge."""
    failed = [fit.model.name for fit in fits if not fit.converged]
    if not failed:
        return 0
    kept = "is in the table, and nothing was saved" if out is None else f"was saved in {out}"
    return _fail(
        f"The fit of {' and '.join(failed)} did not converge; its best point {kept}.",
        NOT_CONVERGED,
    )
