"""`fracjax diagnose`: where a model and recordings differ, and which effects the model lacks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._diagnosis import conclude, diagnose_and_save
from ._files import Content, folder
from ._given import Given
from ._options import (
    folder_option,
    mask_option,
    pauses_option,
    recordings_argument,
    takes_asked,
    takes_given,
    takes_results,
)
from ._progress import stages
from ._results import Results


@click.command("diagnose")
@recordings_argument
@click.option(
    "--model",
    "name",
    help="The model to diagnose; see `models`. Without one: which dynamics the recordings show, "
    "whatever their law of hysteresis.",
)
@folder_option
@click.option("--holdout", metavar="FILE", help="A recording for validation alone; no fit uses it.")
@click.option(
    "--repeat",
    multiple=True,
    metavar="FILE",
    help="A second recording with the same drive, for the noise floor.",
)
@click.option("--noise", metavar='"0.07 um"', help="The sensor's rms noise by its specification.")
@click.option(
    "--limits",
    metavar='"0..100 V, 50 V/ms"',
    help="Limits of the next experiment: the drive's range and its fastest change.",
)
@click.option(
    "--max-time",
    type=click.FloatRange(min=0, min_open=True),
    default=120.0,
    show_default=True,
    metavar="SECONDS",
    help="After this the verdict is what is known by then, and says so.",
)
@pauses_option
@takes_asked(mask_option)
@takes_given
@takes_results
def diagnose_command(
    recordings: tuple[str, ...],
    name: str | None,
    out: Path,
    holdout: str | None,
    repeat: tuple[str, ...],
    noise: str | None,
    limits: str | None,
    max_time: float,
    pauses: str | None,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Say whether, where and why a model and recordings differ, or which dynamics they show.

    Writes diagnosis.json, report.html and fit.json (the model with the effects that were
    identified).  If several effects explain the recordings equally well, it also writes
    next_experiment.csv, the drive that would distinguish them.  --mask and, for several recordings,
    --repeat may be given more than once.
    """
    from .._diagnose import ANY_LOOP

    data, models = given.understood(recordings, [name] if name else [], pauses)
    model = models[0] if models else None
    requested: dict[str, Any] = {
        "holdout": holdout and given.read(holdout),
        "repeat": [given.read(each) for each in repeat] or None,
        "noise": noise,
        "limits": limits,
        "max_time": max_time,
    }
    settings = given.how(data)
    # Without a model its place is taken by one of a loop of any shape.
    named = [m.name for m in models] or [ANY_LOOP]
    content = Content("diagnosis", [each.source for each in data], named)
    with folder(out, content), stages(results.quiet, max_time) as progress:
        diagnosis = diagnose_and_save(
            model, data, out, results, progress, **requested, **asked, **settings
        )
    return conclude(diagnosis, out, results)
