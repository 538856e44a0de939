"""`fracjax protocol`: the drive that can tell which dynamics an actuator has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._files import Content, folder
from ._options import folder_option, given_of, reading_options, takes_results
from ._progress import stages
from ._results import Results, Summary

_FORMATS = ("csv", "npz", "wav", "mat", "tdms")


def _names(context: click.Context, parameter: click.Parameter, text: str | None) -> list[str]:
    """Names between commas."""
    return [name.strip() for name in (text or "").split(",") if name.strip()]


@click.command("protocol")
@folder_option
@click.option(
    "--limits",
    metavar='"0..100 V, 50 V/ms"',
    help="Range and fastest change of the drive; a current too, with --capacitance.",
)
@click.option("--capacitance", metavar='"3 uF"', help="Of the actuator, for a current.")
@click.option("--resolution", metavar='"1.5 mV"', help="Step between a converter's values.")
@click.option("--duration", metavar='"2 min"', help="Of the drive; 2 min by default.")
@click.option(
    "--for",
    "effects",
    metavar="creep,resonance",
    callback=_names,
    help="Effects that it is to show; by default all that a law of hysteresis cannot be.",
)
@click.option("--modes", metavar='"1 kHz"', help="The highest frequency of a mode.")
@click.option("--noise", metavar='"2 nm"', help='Of the response, rms; "0.1 %" of the stroke.')
@click.option("--stroke", metavar='"20 um"', help="Of the actuator over the range.")
@click.option(
    "--after",
    multiple=True,
    metavar="RECORDING",
    help="A recording that the drive completes; range, rate and noise are its own.",
)
@click.option("--shorter", is_flag=True, help="Say what half and a quarter of the time show.")
@click.option(
    "--format",
    "formats",
    type=click.Choice(_FORMATS),
    multiple=True,
    default=("csv",),
    show_default=True,
    help="Files of the drive; may be repeated.",
)
@reading_options
@takes_results
def protocol_command(
    out: Path,
    limits: str | None,
    capacitance: str | None,
    resolution: str | None,
    duration: str | None,
    effects: list[str],
    modes: str | None,
    noise: str | None,
    stroke: str | None,
    after: tuple[str, ...],
    shorter: bool,
    formats: tuple[str, ...],
    results: Results,
    **columns: Any,
) -> None:
    """Design a drive that shows dynamics whatever the law of hysteresis.

    Writes the drive, its picture, a sheet that says what each part is for (report.html), and
    protocol.json.  Record it, then `diagnose` the recording.  --rate is the rate of the samples.
    """
    from .._protocol import ASKED, protocol

    rate = columns["rate"]
    recordings = []
    if after:
        given = given_of(columns | {"rate": None}, ())
        recordings = [segment.recording for segment in given.taken(after)]
    with folder(out, Content("protocol", after, ())), stages(results.quiet) as progress:
        designed = protocol(
            limits,
            rate,
            duration=duration,
            effects=effects or ASKED,
            noise=noise,
            stroke=stroke,
            capacitance=capacitance,
            resolution=resolution,
            modes=modes,
            after=recordings or None,
            shorter=shorter,
            progress=progress,
        )
        progress("writing the drive")
        for suffix in dict.fromkeys(formats):
            designed.write(out / f"drive.{suffix}")
            results.saved.append(out / f"drive.{suffix}")
        results.save(designed.save, out / "protocol.json")
        results.save(lambda file: designed.plot().savefig(file, format="png"), out / "drive.png")
        results.save_report(designed, out / "report.html")
    results.show(
        designed.to_dict, lambda: Summary(designed.sentence, designed.table(), designed.warnings)
    )
