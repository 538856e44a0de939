"""`fracjax diagnose`: where a model and recordings differ, and what was left out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._diagnosis import concluded, diagnosed
from ._files import folder
from ._given import Given
from ._options import (
    folder_option,
    mask_option,
    recordings_argument,
    takes_asked,
    takes_given,
    takes_results,
)
from ._progress import stages
from ._results import Results


@click.command("diagnose")
@recordings_argument
@click.option("--model", "name", required=True, help="The model to be questioned; see `models`.")
@folder_option
@click.option("--holdout", metavar="FILE", help="A recording that no fit sees.")
@click.option(
    "--repeat", multiple=True, metavar="FILE", help="The same drive again, for the noise floor."
)
@click.option("--noise", metavar='"0.07 um"', help="The sensor's noise, rms, as specified.")
@click.option(
    "--limits",
    metavar='"0..100 V, 50 V/ms"',
    help="What the next experiment may ask for: the drive's range and its fastest change.",
)
@takes_asked(mask_option)
@takes_given
@takes_results
def diagnose_command(
    recordings: tuple[str, ...],
    name: str,
    out: Path,
    holdout: str | None,
    repeat: tuple[str, ...],
    noise: str | None,
    limits: str | None,
    asked: dict[str, Any],
    given: Given,
    results: Results,
) -> int:
    """Say whether, where and why a model and recordings differ.

    Writes diagnosis.json, report.html and fit.json, the model with what was found; and
    next_experiment.csv, the drive that would tell look-alikes apart, where there are any.
    --repeat, for several recordings, and --mask may be given more than once.
    """
    taken, (model,) = given.understood(recordings, [name])
    wishes: dict[str, Any] = {
        "holdout": holdout and given.read(holdout),
        "repeat": [given.read(each) for each in repeat] or None,
        "noise": noise,
        "limits": limits,
    }
    how = given.how(taken)
    with folder(out), stages(results.quiet) as progress:
        diagnosis = diagnosed(model, taken, out, results, progress, **wishes, **asked, **how)
    return concluded(diagnosis, out, results)
