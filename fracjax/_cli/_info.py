"""`fracjax info`: what was understood of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import write_whole
from ._options import given_of, mask_option, reading_options, recording_argument, takes_results
from ._results import Results
from ._tables import print_json, print_table

if TYPE_CHECKING:
    from .._recording import Recording


@click.command("info")
@recording_argument
@click.option(
    "--plot",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw what was understood, as .svg, .png or .pdf.",
)
@mask_option
@reading_options
@takes_results
def info_command(
    recording: str | None,
    plot: Path | None,
    mask: tuple[str, ...],
    results: Results,
    **columns: Any,
) -> None:
    """Say what was understood of a recording.

    With --quiet its exit status alone says whether the file can be used.
    """
    from .._report._description import describe

    found = given_of(columns, mask).taken([recording] if recording else [])
    if plot is not None:
        _draw([each for each, _ in found], plot)
    told = [describe(*each) for each in found]
    if results.as_json:
        print_json(told[0] if len(told) == 1 else told)
    elif not results.quiet:
        for number, one in enumerate(told):
            if number:
                print()
            print_table([], _rows(one))
            for warning in one["warnings"]:
                print(f"Warning: {warning}")
        if plot is not None:
            print(f"Written: {plot}")


def _draw(recordings: list[Recording], plot: Path) -> None:
    from .._recording import InputError
    from .._report._recording_picture import draw_recordings

    if plot.suffix not in (".svg", ".png", ".pdf"):
        raise InputError.at(
            "--plot", "a file ending in .svg, .png or .pdf", f'"{plot}"', "name such a file"
        )
    write_whole(lambda path: draw_recordings(recordings, path, plot.suffix[1:]), plot)


def _rows(told: dict[str, Any]) -> list[list[str]]:
    from .._report._text import figure, pretty_unit, quantity

    def extent(signal: dict) -> str:
        return f"{figure(signal['low'], 4)} to {quantity(signal['high'], signal['unit'])}"

    drive, response, noise = told["drive"], told["response"], told["noise"]
    fastest = drive["top_frequency_Hz"]
    top = "" if fastest is None else f", up to {figure(fastest)} Hz"
    rows = [
        ["source", told["source"]],
        ["columns", _columns(told)],
        ["samples", f"{told['samples']} at {told['rate_Hz']:.6g} Hz, {told['duration_s']:.6g} s"],
        ["drive", f"{drive['kind']}, {extent(drive)}{top}"],
        ["response", extent(response)],
        ["period", _period(told["period"])],
    ]
    if told["loop_opening_percent"] is not None:
        rows.append(["loop opening", f"{figure(told['loop_opening_percent'])} % of the stroke"])
    rests = told["rests_s"]
    held = sum(stop - start for start, stop in rests)
    rows.append(["rests", f"{len(rests)}, {held:.3g} s in all" if rests else "none"])
    if noise is None:
        unit = pretty_unit(response["unit"])
        rows.append(["noise floor", f"not to be seen here; give diagnose --noise in {unit}"])
    else:
        source = {"repeats": "from repeats", "static": "at rest"}[noise["method"]]
        rows.append(["noise floor", f"{quantity(noise['sigma'], noise['unit'])}, {source}"])
    return rows


def _columns(told: dict[str, Any]) -> str:
    time, drive, response = (told[role] for role in ("time", "drive", "response"))
    clock = "no column" if time["column"] is None else time["column"]
    return (
        f"time: {clock}; drive: {drive['column']} [{drive['unit']}]; "
        f"response: {response['column']} [{response['unit']}]"
    )


def _period(period: dict[str, float] | None) -> str:
    if period is None:
        return "none found that repeats three times"
    return (
        f"{period['seconds']:.4g} s, {period['repeats']:.4g} repeats from "
        f"{period['from_s']:.4g} to {period['to_s']:.4g} s"
    )
