"""`fracjax info`: what was understood of a recording."""

from __future__ import annotations

from typing import Any

import click

from ._options import reading_options, takes_results
from ._results import Results
from ._tables import print_json, print_table


@click.command("info")
@click.argument("recording")
@reading_options
@takes_results
def info_command(recording: str, results: Results, **columns: str | None) -> None:
    """Say what was understood of a recording.

    With --quiet its exit status alone says whether the file can be used.
    """
    from .._io import read_with_columns
    from .._report import describe

    told = describe(*read_with_columns(recording, **columns))
    if results.as_json:
        print_json(told)
    elif not results.quiet:
        print_table([], _rows(told))
        for warning in told["warnings"]:
            print(f"Warning: {warning}")


def _rows(told: dict[str, Any]) -> list[list[str]]:
    from .._report import figure, pretty_unit, quantity

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
