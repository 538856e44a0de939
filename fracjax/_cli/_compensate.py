"""`fracjax compensate`: the drive that makes a response follow a trajectory."""

from __future__ import annotations

import json
import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import Content, folder
from ._given import model_of_fit
from ._options import (
    folder_option,
    options,
    output_option,
    rate_option,
    resample_option,
    simulated_history_option,
    table_options,
    takes_results,
    time_option,
    unit_options,
)
from ._progress import stages
from ._results import Results, Summary
from ._statuses import NOT_CONVERGED, fail
from ._stream import Wanted, allowed_range, offset_of, stream_options, write_stream

if TYPE_CHECKING:
    from .._compensate import ModelError, Trajectory
    from .._models import Model
    from .._operators import History


@click.command("compensate")
@click.argument("trajectory", required=False)
@click.option("--fit", "fitted", required=True, metavar="FILE", help="A fit.json.")
@folder_option
@click.option(
    "--limits",
    metavar='"0..100 V"',
    help='Lowest and highest drive, or "none"; by default the range of the fitted recording.',
)
@click.option("--slew", metavar='"50 V/ms"', help="Fastest change of the drive.")
@click.option(
    "--regularisation", metavar='"2 ms"', help="Damp detail of the drive shorter than this time."
)
@click.option(
    "--offset",
    metavar='"-3 um"',
    help="Reading of the sensor at the model's zero; by default that of the fitted recording.",
)
@simulated_history_option
@click.option(
    "--posterior",
    "posterior",
    metavar="DIR",
    help="Results of `posterior`, whose draws give the band of the prediction, or with --target "
    "the interval of the promise.",
)
@stream_options
@options(time_option, output_option, rate_option, unit_options)
@options(resample_option, table_options)
@takes_results
def compensate_command(
    trajectory: str | None,
    fitted: str,
    out: Path,
    limits: str | None,
    slew: str | None,
    regularisation: str | None,
    offset: str | None,
    history: History,
    posterior: str | None,
    target: str | None,
    step: str | None,
    real: str,
    adaptive: str | None,
    results: Results,
    **columns: Any,
) -> int:
    """Find the drive that makes a fitted model's response follow a trajectory.

    Writes the drive (in the trajectory's format), compensation.json and report.html.  A drive in
    the trajectory's file is not used.  Without a trajectory, `--target c --step "50 us"` writes the
    inverse for a real-time loop, whose motions are not known ahead, and `--target fmu` for a
    simulation of it.
    """
    if target is not None:
        if trajectory is not None:
            raise _other_call(
                "a trajectory or --target", f"both {trajectory} and --target {target}"
            )
        return write_stream(
            fitted,
            out,
            Wanted(target, step, real, limits, slew, offset, adaptive, posterior),
            results,
        )
    if trajectory is None:
        raise _other_call("a trajectory, or --target c or fmu for a real-time loop", "neither")
    from .._compensate import compensate
    from .._io import SUFFIXES
    from .._recording import parse_quantity
    from .._report import (
        compensation_figures,
        compensation_sentence,
        compensation_warnings,
    )

    desired, model, content = _inputs(trajectory, fitted, columns)
    drive_unit, unit = content["units"]["drive"], desired.response_unit
    requested: dict[str, Any] = {
        "limits": allowed_range(limits, content),
        "slew": slew and parse_quantity(slew, f"{drive_unit}/s", "--slew"),
        "regularisation": parse_quantity(regularisation or 0.0, "s", "--regularisation"),
        "offset": _zero(model, content, history)
        if offset is None
        else parse_quantity(offset, unit, "--offset"),
        "history": history,
        "drive_unit": drive_unit,
        "model_error": _model_error(Path(fitted).parent, model.name, content),
        **(_draws(posterior) if posterior else {}),
    }
    suffix = Path(trajectory).suffix.lower()
    content = Content("compensation", [trajectory], [model.name])
    with folder(out, content), stages(results.quiet) as progress:
        compensation = compensate(model, desired, progress=progress, **requested)
        drive_file = out / f"drive{suffix if suffix in SUFFIXES else '.csv'}"
        compensation.write_drive(drive_file)
        results.saved.append(drive_file)
        results.save(compensation.save, out / "compensation.json")
        notes = compensation_warnings(compensation)
        progress("writing the report")
        results.save_report(compensation, out / "report.html")
    results.show(
        compensation.to_dict,
        lambda: Summary(
            compensation_sentence(compensation), compensation_figures(compensation), notes
        ),
    )
    if compensation.converged:
        return 0
    return fail(
        f"The inversion of {model.name} did not converge; the best drive was saved in {out}.",
        NOT_CONVERGED,
    )


def _inputs(
    path: str, fitted: str, columns: dict[str, Any]
) -> tuple[Trajectory, Model, dict[str, Any]]:
    """The trajectory in a fit's response unit, the fit's model, and its file's content."""
    from .._compensate import Trajectory
    from .._io import read_response

    model, content = model_of_fit(fitted)
    samples, step, file_unit = read_response(path, **columns)
    unit = content["units"]["response"]
    return Trajectory(samples, step, file_unit, path).in_unit(unit), model, content


def _zero(model: Model, content: dict[str, Any], history: History) -> float:
    """The reading [response] at the model's zero with a history of the motion."""
    return content["offsets"][0] if history == "rest" else offset_of(model, content)


def _model_error(folder: Path, model: str, content: dict[str, Any]) -> ModelError:
    """What the model left of held-out data where the fit's folder holds its scores, else of the
    data that it was fitted to."""
    from .._compensate import ModelError

    on, noise = "held-out data", content["noise"]["sigma"]
    with suppress(OSError, ValueError, KeyError, TypeError):
        rows = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))["rows"]
        return next(
            ModelError(row["unseen"]["rmse"], on, noise) for row in rows if row["model"] == model
        )
    with suppress(OSError, ValueError, KeyError, TypeError):
        diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        which = "base_folds" if diagnosis["model"] == model else "extended_folds"
        squares = [error**2 for error in diagnosis["held_out"][which]]
        from statistics import fmean, stdev  # loads slowly, and other commands do without

        spread = stdev(squares) / math.sqrt(len(squares)) if len(squares) > 1 else None
        return ModelError(math.sqrt(fmean(squares)), on, noise, spread)
    return ModelError(content["scores"]["rmse"], "the data it was fitted to", noise)


def _other_call(expected: str, actual: str) -> Exception:
    """The error for a call that asks for both, or for nothing."""
    from .._recording import InputError

    return InputError.at("compensate", expected, actual, "give one of them")


def _draws(folder: str) -> dict[str, Any]:
    """The keywords of `compensate` for a posterior: its draws, and the recording they are for."""
    from .._posterior import load_posterior
    from .._recording import Recording

    posterior = load_posterior(folder)
    band = posterior.bands[0]
    step = float(band.times[1] - band.times[0])
    recording = Recording(band.drive, band.response, step, *posterior.units, band.source)
    return {"draws": posterior.samples, "identified_by": recording}
