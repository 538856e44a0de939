"""`fracjax info`: what was understood of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ._files import write_whole
from ._options import given_of, mask_option, reading_options, recording_argument, takes_results
from ._results import Results
from ._tables import print_json, print_table, print_text

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
@click.option(
    "--shows",
    is_flag=True,
    help="Say how small an effect of dynamics this recording would show, whatever the hysteresis.",
)
@click.option(
    "--write-description",
    "description_file",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write how this file was read, for --description with files like it.",
)
@mask_option
@reading_options
@takes_results
def info_command(
    recording: str | None,
    plot: Path | None,
    shows: bool,
    description_file: Path | None,
    mask: tuple[str, ...],
    results: Results,
    **columns: Any,
) -> None:
    """Say what was understood of a recording.

    With --quiet its exit status alone says whether the file can be used.
    """
    from .._report import describe

    given = given_of(columns, mask)
    segments = given.taken([recording] if recording else [])
    if plot is not None:
        _draw([each.recording for each in segments], plot)
    if description_file is not None:
        from .._io import write_description

        write_description(
            description_file, segments[0].recording, segments[0].columns, given.columns
        )
    descriptions = [describe(each.recording, each.columns) for each in segments]
    if shows:
        from .._report import shown_by

        for one, each in zip(descriptions, segments, strict=True):
            one["can_show"] = shown_by(each.recording)
    # What stands in a file counts for all its segments, and is told once.
    descriptions[0]["not_used"] = [*segments[0].unused]
    if results.as_json:
        print_json(descriptions[0] if len(descriptions) == 1 else descriptions)
    elif not results.quiet:
        for number, one in enumerate(descriptions):
            if number:
                print()
            print_table([], _rows(one))
            if shows:
                from .._report import shown_rows

                print_table(
                    ["effect", "", "smallest size that would be named"],
                    shown_rows(one["can_show"]),
                )
            for warning in one["warnings"]:
                print_text(f"Warning: {warning}")
            for line in one.get("not_used", ()):
                print_text(f"Not used: {line}")
        for path in (plot, description_file):
            if path is not None:
                print(f"Written: {path}")


def _draw(recordings: list[Recording], plot: Path) -> None:
    from .._recording import InputError
    from .._report import draw_recordings

    if plot.suffix not in (".svg", ".png", ".pdf"):
        raise InputError.at(
            "--plot", "a file ending in .svg, .png or .pdf", f'"{plot}"', "name such a file"
        )
    write_whole(lambda path: draw_recordings(recordings, path, plot.suffix[1:]), plot)


def _rows(description: dict[str, Any]) -> list[list[str]]:
    from .._show import figure, percentage, pretty_unit, quantity

    def extent(signal: dict) -> str:
        return f"{figure(signal['low'], 4)} to {quantity(signal['high'], signal['unit'])}"

    drive, response, noise = description["drive"], description["response"], description["noise"]
    fastest = drive["top_frequency_Hz"]
    top = "" if fastest is None else f", up to {figure(fastest)} Hz"
    kind = "" if drive["kind"] == "other" else f"{drive['kind']}, "
    clock = f"{description['rate_Hz']:.6g} Hz, {description['duration_s']:.6g} s"
    rows = [
        ["source", description["source"]],
        ["columns", _columns(description)],
        ["samples", f"{description['samples']} at {clock}"],
        ["drive", f"{kind}{extent(drive)}{top}"],
        ["response", extent(response)],
        ["period", _period(description["period"])],
    ]
    if description["loop_opening_percent"] is not None:
        rows.append(
            ["loop opening", f"{figure(description['loop_opening_percent'])} % of the stroke"]
        )
    rests = description["rests_s"]
    held = sum(stop - start for start, stop in rests)
    rows.append(["rests", f"{len(rests)}, {held:.3g} s in all" if rests else "none"])
    if noise is None:
        unit = pretty_unit(response["unit"])
        rows.append(["noise floor", f"not to be seen here; give diagnose --noise in {unit}"])
    else:
        source = {"repeats": "from repeats", "static": "at rest"}[noise["method"]]
        level = (
            f"{quantity(noise['sigma'], noise['unit'])} ± {percentage(noise['relative_error'])} %"
        )
        rows.append(["noise floor", f"{level}, {source}"])
    return rows


def _columns(description: dict[str, Any]) -> str:
    time, drive, response = (description[role] for role in ("time", "drive", "response"))
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
