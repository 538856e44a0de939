"""`fracjax app`: the page on this machine."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ._options import takes_results
from ._results import Results


@click.command("app")
@click.argument(
    "folder",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    default=Path("."),
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="By default a free one.")
@click.option("--no-browser", is_flag=True, help="Print the address alone.")
@takes_results
def app_command(folder: Path, port: int, no_browser: bool, results: Results) -> None:
    """Open a page that fits and diagnoses without a shell.

    It is served to this machine alone, at an address with a secret, and reads and writes files in
    FOLDER only, by default the present one.  Ctrl-C ends it.
    """
    try:
        from .._app import serve
    except ModuleNotFoundError as error:
        if error.name not in ("panel", "bokeh"):
            raise
        from .._recording import InputError

        raise InputError.at(
            "fracjax app", "Panel", "it is not installed", 'run pip install "fracjax[app]"'
        ) from None

    def announce(address: str) -> None:
        if results.as_json:
            print(json.dumps({"address": address}), flush=True)
        elif not results.quiet:
            print(f"{address}\nCtrl-C ends it.", flush=True)

    serve(folder.resolve(), announce, port=port, show=not no_browser)
