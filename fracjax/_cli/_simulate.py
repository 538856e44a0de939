"""`fracjax simulate`: a model's response to a recorded drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._given import model_of_fit
from ._options import (
    input_option,
    options,
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
    import numpy as np

    from .._models import Model
    from .._operators import History


_LARGEST_ERROR = 1e-2
"""A larger discretisation error, as a share of the response's span, is reported as a failure;
chosen by judgement."""


@click.command("simulate")
@click.argument("drive")
@click.option("--model", "name", help="A model at its nominal parameters; see `models`.")
@click.option("--fit", "fitted", metavar="FILE", help="A fit.json.")
@click.option(
    "--out",
    required=True,
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Its suffix sets the format: .csv .mat .h5 .npz .parquet .tdms .xlsx.",
)
@simulated_history_option
@options(time_option, input_option, rate_option, unit_options, resample_option, table_options)
@takes_results
def simulate_command(
    drive: str,
    name: str | None,
    fitted: str | None,
    out: Path,
    output_unit: str | None,
    history: History,
    results: Results,
    **columns: Any,
) -> int:
    """Simulate a model's response to a recorded drive.

    The recording may lack a response.  A fitted model is simulated as the sensor read it, with the
    offset of the fit's first recording.
    """
    import numpy as np

    from .._io import column_name, read_drive, write
    from .._models import parse_model
    from .._recording import UNSTATED, parse_quantity, unit
    from .._simulate import simulate

    if (name is None) == (fitted is None):
        raise click.UsageError("Give either --model or --fit")
    samples, step, drive_unit = read_drive(drive, **columns)
    offset = 0.0
    if fitted is None:
        model, response_unit = parse_model(name or ""), output_unit or UNSTATED["response"]
        unit(response_unit, "--unit response")
        own_unit = response_unit
    else:
        model, samples, drive_unit, own_unit, offset = _fitted(fitted, samples, drive_unit)
        response_unit = output_unit or own_unit
    scale = parse_quantity(f"1 {own_unit}", response_unit, "--unit response")
    with stages(results.quiet) as progress:
        progress(f"simulating {model.name}")
        response, error = simulate(model, samples, step, history)
        response = scale * (response + offset)
    signals = {"time_s": step * np.arange(len(samples))}
    signals |= {
        column_name("drive", drive_unit): samples,
        column_name("response", response_unit): response,
    }
    write(out, signals)
    results.saved.append(out)
    overview = {
        "schema": "fracjax.simulation/1",
        "model": model.name,
        "file": str(out),
        "samples": len(samples),
        "range": [float(response.min()), float(response.max())],
        "unit": response_unit,
        "error": error,
    }
    sentence = (
        f"{model.name} was simulated over {len(samples)} samples; the discretisation error is "
        f"{100 * error:.2g} % of the response's span."
    )
    results.show(lambda: overview, lambda: Summary(sentence))
    if not error <= _LARGEST_ERROR:
        return fail(
            f"The simulation of {model.name} did not converge when its grid was refined; the "
            f"result on the finest grid was saved in {out}.",
            NOT_CONVERGED,
        )
    return 0


def _fitted(
    path: str, drive: np.ndarray, drive_unit: str
) -> tuple[Model, np.ndarray, str, str, float]:
    """A fitted model, the drive (N,) in the unit of the fit, both units, and the offset."""
    from .._recording import parse_quantity

    model, content = model_of_fit(path)
    units = content["units"]
    scale = parse_quantity(f"1 {drive_unit}", units["drive"], "drive")
    return model, drive * scale, units["drive"], units["response"], content["offsets"][0]
