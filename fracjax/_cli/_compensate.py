"""`fracjax compensate`: the drive that makes a response follow a trajectory."""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import Content, folder
from ._given import model_of_fit
from ._jax import prepare_jax
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

if TYPE_CHECKING:
    from .._compensate import Compensation, Trajectory
    from .._models import Model
    from .._operators import History


@click.command("compensate")
@click.argument("trajectory")
@click.option("--fit", "fitted", required=True, metavar="FILE", help="A fit.json.")
@folder_option
@click.option("--limits", metavar='"0..100 V"', help="Lowest and highest drive.")
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
    help="Results of `posterior`, whose draws give the band of the prediction.",
)
@click.option(
    "--streaming", is_flag=True, help="Also write the linear inverse for a real-time loop."
)
@options(time_option, output_option, rate_option, unit_options)
@options(resample_option, table_options)
@takes_results
def compensate_command(
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
    results: Results,
    **columns: Any,
) -> int:
    """Find the drive that makes a fitted model's response follow a trajectory.

    Writes the drive (in the trajectory's format), compensation.json and report.html; with
    --streaming also inverse.json and inverse.h.  A drive in the trajectory's file is not used.
    """
    from .._compensate import compensate
    from .._io import SUFFIXES
    from .._recording import parse_quantity
    from .._report import (
        compensation_figures,
        compensation_sentence,
        compensation_warnings,
    )

    desired, model, drive_unit, fitted_offset, model_error = _inputs(trajectory, fitted, columns)
    unit = desired.response_unit
    requested: dict[str, Any] = {
        "limits": limits and _range(limits, drive_unit, "--limits"),
        "slew": slew and parse_quantity(slew, f"{drive_unit}/s", "--slew"),
        "regularisation": parse_quantity(regularisation or 0.0, "s", "--regularisation"),
        "offset": fitted_offset if offset is None else parse_quantity(offset, unit, "--offset"),
        "history": history,
        "drive_unit": drive_unit,
        "model_error": model_error,
        **(_draws(posterior) if posterior else {}),
    }
    suffix = Path(trajectory).suffix.lower()
    prepare_jax()
    content = Content("compensation", [trajectory], [model.name])
    with folder(out, content), stages(results.quiet) as progress:
        compensation = compensate(model, desired, progress=progress, **requested)
        drive_file = out / f"drive{suffix if suffix in SUFFIXES else '.csv'}"
        compensation.write_drive(drive_file)
        results.saved.append(drive_file)
        results.save(compensation.save, out / "compensation.json")
        notes = compensation_warnings(compensation)
        if streaming:
            progress("writing the streaming inverse")
            notes.append(_write_streaming_inverse(model, compensation, out, results))
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


def _write_streaming_inverse(
    model: Model, compensation: Compensation, out: Path, results: Results
) -> str:
    """Write the streaming inverse, and state its error in a sentence."""
    import numpy as np

    from .._compensate import streaming_inverse
    from .._show import figure
    from .._simulate import simulate

    # From a tenth of the trajectory's lowest frequency to 2 % of the sampling rate; by judgement.
    step = compensation.dt
    band = 0.1 / (step * len(compensation.drive)), 0.02 / step
    inverse = streaming_inverse(
        model, step, band, offset=compensation.offset, units=compensation.units
    )
    results.save(inverse.save, out / "inverse.json")
    results.save(inverse.save_header, out / "inverse.h")
    drive = inverse.run(compensation.desired, settled=compensation.history != "rest")
    simulation = simulate(model, drive, step, compensation.history)
    error = simulation.response + compensation.offset - compensation.desired
    largest = float(np.abs(error).max() / compensation.stroke)
    which = "inverse" if inverse.complete else "inverse of the linear part"
    return (
        f"Streaming: {len(inverse.decay)} sections, within {figure(100 * inverse.error)} % of the "
        f"{which} from {figure(band[0])} to {figure(band[1])} Hz; along this trajectory its "
        f"error is at most {figure(100 * largest)} % of the stroke."
    )


def _inputs(
    path: str, fitted: str, columns: dict[str, Any]
) -> tuple[Trajectory, Model, str, float, tuple[float, str]]:
    """The trajectory in a fit's response unit, and its model, drive unit, offset and error."""
    from .._compensate import Trajectory
    from .._io import read_response

    model, content = model_of_fit(fitted)
    samples, step, file_unit = read_response(path, **columns)
    unit = content["units"]["response"]
    trajectory = Trajectory(samples, step, file_unit, path).in_unit(unit)
    error = _error_on_held_out_data(Path(fitted).parent, model.name)
    if error is None:
        error = content["scores"]["rmse"], "the data it was fitted to"
    return trajectory, model, content["units"]["drive"], content["offsets"][0], error


def _error_on_held_out_data(folder: Path, model: str) -> tuple[float, str] | None:
    """The model's rms error on held-out data, where the fit's folder holds its scores."""
    on = "held-out data"
    with suppress(OSError, ValueError, KeyError, TypeError):
        rows = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))["rows"]
        return next((row["unseen"]["rmse"], on) for row in rows if row["model"] == model)
    with suppress(OSError, ValueError, KeyError, TypeError):
        diagnosis = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        which = "base_folds" if diagnosis["model"] == model else "extended_folds"
        squares = [error**2 for error in diagnosis["held_out"][which]]
        return math.sqrt(sum(squares) / len(squares)), on
    return None


def _range(text: str, unit: str, where: str) -> tuple[float, float]:
    """The two values of a range such as "0..100 V", in a unit; the first may lack its unit."""
    from .._recording import InputError, parse_quantity

    low, dots, high = text.partition("..")
    if not dots:
        raise InputError.at(where, f'a range such as "0..100 {unit}"', f'"{text}"', "correct it")
    written_unit = re.sub(r"^\s*[-+0-9.eE]*", "", high)
    without_unit = re.fullmatch(r"\s*[-+0-9.eE]+\s*", low)
    return (
        parse_quantity(f"{low} {written_unit}" if without_unit else low, unit, where),
        parse_quantity(high, unit, where),
    )


def _draws(folder: str) -> dict[str, Any]:
    """The keywords of `compensate` for a posterior: its draws, and the recording they are for."""
    from .._posterior import load_posterior
    from .._recording import Recording

    posterior = load_posterior(folder)
    band = posterior.bands[0]
    step = float(band.times[1] - band.times[0])
    recording = Recording(band.drive, band.response, step, *posterior.units, band.source)
    return {"draws": posterior.samples, "identified_by": recording}
