"""`fracjax app`: the page on this machine."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("app")
@click.argument(
    "folder",
    type=click.Path(path_type=Path, exists=True, file_okay=False),
    default=Path("."),
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="By default a free one.")
@click.option("--no-browser", is_flag=True, help="Print the address alone.")
def app_command(folder: Path, port: int, no_browser: bool) -> None:
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
    serve(folder.resolve(), port=port, show=not no_browser)
