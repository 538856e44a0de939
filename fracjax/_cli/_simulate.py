"""`fracjax simulate`: a model's response to a recorded drive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._given import model_of_fit
from ._jax import prepare_jax
from ._options import (
    input_option,
    input_unit_option,
    options,
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
    import numpy as np

    from .._models import Model
    from .._operators._grid import History


@click.command("simulate")
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
@simulated_history_option
@options(time_option, input_option, rate_option, input_unit_option, time_unit_option)
@options(resample_option, table_options, output_unit_option)
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

    The file need not hold a response.  What was fitted is simulated as the sensor read it, with
    the offset of the fit's first recording.
    """
    import numpy as np

    from .._io import column_name, read_drive, write
    from .._models import parse_model
    from .._recording import parse_quantity, unit
    from .._simulate import simulate

    if (name is None) == (fitted is None):
        raise click.UsageError("Give either --model or --fit")
    samples, step, drive_unit = read_drive(drive, **columns)
    offset = 0.0
    if fitted is None:
        model, response_unit = parse_model(name or ""), output_unit or "um"
        unit(response_unit, "--output-unit")
        own_unit = response_unit
    else:
        model, samples, drive_unit, own_unit, offset = _fitted(fitted, samples, drive_unit)
        response_unit = output_unit or own_unit
    scale = parse_quantity(f"1 {own_unit}", response_unit, "--output-unit")
    prepare_jax()
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
    told = {
        "schema": "fracjax.simulation/1",
        "model": model.name,
        "file": str(out),
        "samples": len(samples),
        "range": [float(response.min()), float(response.max())],
        "unit": response_unit,
        "error": error,
    }
    sentence = (
        f"{model.name} was simulated over {len(samples)} samples; discretisation changes the "
        f"response by {100 * error:.2g} % of its span."
    )
    results.tell(lambda: told, lambda: Summary(sentence))
    if not error <= 1e-2:
        return fail(
            f"The simulation of {model.name} did not converge as its grid was refined; its finest "
            f"result was saved in {out}.",
            NOT_CONVERGED,
        )
    return 0


def _fitted(
    path: str, drive: np.ndarray, drive_unit: str
) -> tuple[Model, np.ndarray, str, str, float]:
    """A fitted model, the drive in the unit it was fitted in, both units, and the offset."""
    from .._recording import parse_quantity

    model, told = model_of_fit(path)
    units = told["units"]
    scale = parse_quantity(f"1 {drive_unit}", units["drive"], "drive")
    return model, drive * scale, units["drive"], units["response"], told["offsets"][0]
