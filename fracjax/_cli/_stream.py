"""`fracjax compensate --target`: the inverse for a real-time loop."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from ._files import folder
from ._given import model_of_fit
from ._options import options
from ._progress import stages
from ._results import Results, Summary

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np

    from .._models import Model
    from .._streaming import StreamingInverse

stream_options = options(
    click.option(
        "--target",
        type=click.Choice(["c", "fmu"]),
        help="Write the inverse for a loop, in C or as an FMU 3.0.",
    ),
    click.option("--step", metavar='"50 us"', help="Time step of the loop, with --target."),
    click.option(
        "--real",
        type=click.Choice(["double", "float"]),
        default="double",
        help="Type of the numbers in C; an FMU's is double.",
    ),
    click.option(
        "--adaptive",
        metavar='"20 s"',
        help="Gains follow the measured motion, which is forgotten after this time.",
    ),
)


class Wanted(NamedTuple):
    """What the call asks of a stream."""

    target: str
    step: str | None
    real: str
    limits: str | None
    slew: str | None
    offset: str | None
    adaptive: str | None
    posterior: str | None


def write_stream(fitted: str, out: Path, wanted: Wanted, results: Results) -> int:
    """Write the inverse of a fit for a real-time loop."""
    from .._recording import InputError
    from .._show import figure, quantity
    from .._streaming import platforms

    if wanted.step is None:
        raise InputError.at(
            "--step",
            f"the loop's time step with --target {wanted.target}",
            "none",
            'give --step "50 us"',
        )
    if wanted.target == "fmu" and wanted.real == "float":
        raise InputError.at(
            "--real",
            "double with --target fmu, whose numbers the standard fixes",
            "float",
            "leave it out, or give --target c",
        )
    notes = ["The errors are the inverse's own, by the model. What the model lacks comes on top."]
    with folder(out), stages(results.quiet) as progress:
        progress("inverting the model sample by sample")
        inverse, draws = _inverse(fitted, wanted)
        progress("writing the code")
        if wanted.target == "c":
            results.saved.extend(inverse.write_c(out, real=wanted.real))
        else:
            path = inverse.write_fmu(out)
            results.saved.append(path)
            notes.append(
                f"The FMU holds its sources, and a library for {' and '.join(platforms(path))}."
                if platforms(path)
                else "The FMU holds its sources alone, as there is no C compiler here."
            )
        progress("simulating the promise")
        promise = inverse.promise(draws)
        progress("writing the report")
        results.save_report(promise, out / "report.html")
    results.show(
        lambda: {**inverse.to_dict(), "promise": promise.to_dict()},
        lambda: Summary(
            f"The inverse of {inverse.model} runs every {quantity(inverse.step, 's')}, and its "
            f"linear parts hold to {figure(100 * inverse.error)} % from "
            f"{figure(inverse.band[0])} to {quantity(inverse.band[1], 'Hz')}.",
            promise.table(),
            [*promise.failures, *notes],
        ),
    )
    return 0


def _inverse(
    fitted: str, wanted: Wanted
) -> tuple[StreamingInverse, Mapping[str, np.ndarray] | None]:
    """The inverse that a call asks for, and draws of its parameters, of a posterior or by the fit's
    covariance; None for a fit of before that was saved."""
    from .._posterior import load_posterior
    from .._recording import parse_quantity
    from .._streaming import Adaptation, draws_of, streaming_inverse, usual_band

    model, content = model_of_fit(fitted)
    setting, units = content["setting"], (content["units"]["drive"], content["units"]["response"])
    drive, response = units
    step = parse_quantity(wanted.step or "", "s", "--step")
    limits = allowed_range(wanted.limits, content)
    adaptive = None
    if wanted.adaptive is not None:
        memory = parse_quantity(wanted.adaptive, "s", "--adaptive")
        adaptive = Adaptation(memory=memory, error=content["scores"]["rmse"])
    draws = None
    if wanted.posterior is not None:
        draws = load_posterior(wanted.posterior).samples
    elif "correlation" in content:
        draws = draws_of(content["parameters"], content["correlation"])
    duration = setting["duration"]
    inverse = streaming_inverse(
        model,
        step,
        usual_band(step, duration),
        limits=limits,
        slew=parse_quantity(wanted.slew, f"{drive}/s", "--slew") if wanted.slew else None,
        offset=offset_of(model, content)
        if wanted.offset is None
        else parse_quantity(wanted.offset, response, "--offset"),
        units=units,
        adaptive=adaptive,
    )
    return inverse, draws


def offset_of(model: Model, content: dict[str, Any]) -> float:
    """The reading [response] at the model's zero of a stage at rest, by a fit.json's content."""
    from .._compensate import settled_offset

    history, duration = content["assumptions"][0]["history"], content["setting"]["duration"]
    return settled_offset(model, content["offsets"][0], history, duration)


def allowed_range(text: str | None, content: dict[str, Any]) -> tuple[float, float] | None:
    """The limits of the drive that a call states, by default the range of the fitted recording in a
    fit.json's content; None for the word "none"."""
    if text is None:
        return content["setting"]["drive_low"], content["setting"]["drive_high"]
    return None if text == "none" else _drive_range(text, content["units"]["drive"])


def _drive_range(text: str, unit: str, where: str = "--limits") -> tuple[float, float]:
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
