"""`fracjax compensate`: the drive that makes a response follow a trajectory."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import folder
from ._given import model_of_fit
from ._jax import prepare_jax
from ._options import (
    folder_option,
    options,
    output_option,
    output_unit_option,
    rate_option,
    resample_option,
    simulated_history_option,
    table_options,
    takes_results,
    time_option,
    time_unit_option,
)
from ._progress import stages
from ._results import Results, Summary
from ._statuses import NOT_CONVERGED, fail

if TYPE_CHECKING:
    from .._compensate import Compensation, Trajectory
    from .._models import Model
    from .._operators._grid import History


@click.command("compensate")
@click.argument("trajectory")
@click.option("--fit", "fitted", required=True, metavar="FILE", help="A fit.json.")
@folder_option
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
@simulated_history_option
@click.option(
    "--posterior", "posterior", metavar="DIR", help="Its draws give the prediction's band."
)
@click.option(
    "--streaming", is_flag=True, help="Write the linear inverse for a real-time loop, too."
)
@options(time_option, output_option, rate_option, output_unit_option, time_unit_option)
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
    --streaming also inverse.json and inverse.h.  The file's drive, if it has one, is not used.
    """
    from .._compensate import compensate
    from .._io import SUFFIXES
    from .._recording import parse_quantity
    from .._report import write_report
    from .._report._compensation_page import compensation_figures, sentence_of, warnings_of

    desired, model, drive_unit, zero = _wanted(trajectory, fitted, columns)
    unit = desired.response_unit
    wishes: dict[str, Any] = {
        "limits": limits and _range(limits, drive_unit, "--limits"),
        "slew": slew and parse_quantity(slew, f"{drive_unit}/s", "--slew"),
        "regularisation": parse_quantity(regularisation or 0.0, "s", "--regularisation"),
        "offset": zero if offset is None else parse_quantity(offset, unit, "--offset"),
        "history": history,
        "drive_unit": drive_unit,
        **(_drawn(posterior) if posterior else {}),
    }
    suffix = Path(trajectory).suffix.lower()
    prepare_jax()
    with folder(out), stages(results.quiet) as progress:
        found = compensate(model, desired, progress=progress, **wishes)
        drive_file = out / f"drive{suffix if suffix in SUFFIXES else '.csv'}"
        found.write_drive(drive_file)
        results.saved.append(drive_file)
        results.save(found.save, out / "compensation.json")
        notes = warnings_of(found)
        if streaming:
            progress("writing the streaming inverse")
            notes.append(_streamed(model, found, out, results))
        progress("writing the report")
        results.save(lambda path: write_report(found, path), out / "report.html")
    results.tell(
        found.to_dict,
        lambda: Summary(sentence_of(found), compensation_figures(found), notes),
    )
    if found.converged:
        return 0
    return fail(
        f"The inversion of {model.name} did not converge; the best drive it reached was saved in "
        f"{out}.",
        NOT_CONVERGED,
    )


def _streamed(model: Model, found: Compensation, out: Path, results: Results) -> str:
    """Write the streaming inverse, and say how near it comes."""
    import numpy as np

    from .._compensate import streaming_inverse
    from .._report._text import figure
    from .._simulate import simulate

    band = 0.1 / (found.dt * len(found.drive)), 0.02 / found.dt
    inverse = streaming_inverse(model, found.dt, band, offset=found.offset, units=found.units)
    results.save(inverse.save, out / "inverse.json")
    results.save(inverse.save_header, out / "inverse.h")
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
    path: str, fitted: str, columns: dict[str, Any]
) -> tuple[Trajectory, Model, str, float]:
    """The trajectory in the unit of a fit, its model, the drive's unit, and the fit's offset."""
    from .._compensate import Trajectory
    from .._io import read_response

    model, told = model_of_fit(fitted)
    samples, step, written = read_response(path, **columns)
    unit = told["units"]["response"]
    trajectory = Trajectory(samples, step, written, path).in_unit(unit)
    return trajectory, model, told["units"]["drive"], told["offsets"][0]


def _range(text: str, unit: str, where: str) -> tuple[float, float]:
    """Two values such as "0..100 V", in a unit; what the first leaves unsaid the second tells."""
    from .._recording import InputError, parse_quantity

    low, dots, high = text.partition("..")
    if not dots:
        raise InputError.at(where, f'a range such as "0..100 {unit}"', f'"{text}"', "correct it")
    written = re.sub(r"^\s*[-+0-9.eE]*", "", high)
    bare = re.fullmatch(r"\s*[-+0-9.eE]+\s*", low)
    return (
        parse_quantity(f"{low} {written}" if bare else low, unit, where),
        parse_quantity(high, unit, where),
    )


def _drawn(folder: str) -> dict[str, Any]:
    """A posterior's draws, and the recording they were drawn for."""
    from .._posterior import load_posterior
    from .._recording import Recording

    posterior = load_posterior(folder)
    band = posterior.bands[0]
    step = float(band.times[1] - band.times[0])
    recording = Recording(band.drive, band.response, step, *posterior.units, band.source)
    return {"draws": posterior.samples, "identified_by": recording}
