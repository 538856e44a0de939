"""`fracjax demo`: a diagnosis of the recording in the package."""

from __future__ import annotations

import time
from pathlib import Path
from shutil import copyfile

import click

from ._diagnosis import conclude, diagnose_and_save
from ._files import Content, folder
from ._given import models_for
from ._options import takes_results
from ._results import Results

_LEFT = {"training": Path("loop.csv"), "heldout": Path("other.csv")}
"""The recordings in the package, and what they are called where the demo was called."""


@click.command("demo")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    default=Path("fracjax-demo"),
    show_default=True,
    metavar="DIR",
    help="Folder for the results.",
)
@takes_results
def demo_command(out: Path, results: Results) -> int:
    """Diagnose a recording in the package, in which an effect is concealed.

    It leaves the recording and its held-out one as loop.csv and other.csv in this folder, unless
    there are such files, to try the other commands on.
    """
    from importlib.resources import as_file, files

    from .._io import read

    with as_file(files("fracjax") / "_demo") as shipped:
        recordings = []
        for name, path in _LEFT.items():
            original = shipped / f"{name}.csv"
            if not path.exists():
                copyfile(original, path)
                results.saved.append(path)
            # By the name that the next command takes.
            recordings.append(
                read(path if path.read_bytes() == original.read_bytes() else original)
            )
        training, held_out = recordings
    model = models_for(["foh"], [training])[0]
    start = time.perf_counter()

    def show(sentence: str) -> None:
        if not (results.quiet or results.as_json):
            print(f"{time.perf_counter() - start:6.1f} s  {sentence}", flush=True)

    with folder(out, Content("diagnosis", [training.source], [model.name])):
        diagnosis = diagnose_and_save(model, [training], out, results, show, holdout=held_out)
    return conclude(diagnosis, out, results)
