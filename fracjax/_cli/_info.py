"""`fracjax info`: what was understood of a recording."""

from __future__ import annotations

from typing import Any

import click

from ._options import json_option, reading_options
from ._tables import print_json, print_table


@click.command("info")
@click.argument("recording")
@reading_options
@json_option
def info_command(recording: str, as_json: bool, **columns: str | None) -> None:
    """Say what was understood of a recording."""
    from .._io import read
    from .._report._description import describe

    told = describe(read(recording, **columns))
    if as_json:
        print_json(told)
    else:
        print_table([], _rows(told))
        for warning in told["warnings"]:
            print(f"Warning: {warning}")


def _rows(told: dict[str, Any]) -> list[list[str]]:
    from .._report._text import figure, pretty_unit, quantity

    def extent(signal: dict) -> str:
        return f"{figure(signal['low'], 4)} to {quantity(signal['high'], signal['unit'])}"

    drive, period, rests, noise = told["drive"], told["period"], told["rests_s"], told["noise"]
    rows = [
        ["source", told["source"]],
        ["samples", f"{told['samples']} at {told['rate_Hz']:.6g} Hz, {told['duration_s']:.6g} s"],
        [
            "drive",
            f"{extent(drive)}, {drive['kind']}, up to {figure(drive['top_frequency_Hz'])} Hz",
        ],
        ["response", extent(told["response"])],
    ]
    if period is None:
        rows.append(["period", "none found that repeats three times"])
    else:
        rows.append(
            [
                "period",
                f"{period['seconds']:.4g} s, {period['repeats']:.4g} repeats from "
                f"{period['from_s']:.4g} to {period['to_s']:.4g} s",
            ]
        )
        opening = figure(told["loop_opening_percent"])
        rows.append(["loop opening", f"{opening} % of the response's span"])
    held = sum(stop - start for start, stop in rests)
    rows.append(["rests", f"{len(rests)}, {held:.3g} s in all" if rests else "none"])
    if noise is None:
        unit = pretty_unit(told["response"]["unit"])
        rows.append(["noise floor", f"not to be seen here; give diagnose --noise in {unit}"])
    else:
        source = {"repeats": "from repeats", "static": "at rest"}[noise["method"]]
        rows.append(["noise floor", f"{quantity(noise['sigma'], noise['unit'])}, {source}"])
    return rows
