"""The options that several commands take, each declared once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from ._given import Given
from ._results import Results

_COLUMNS = ("time", "input", "output", "rate", "input_unit", "output_unit", "resample")


def options(*listed: Callable) -> Callable:
    """Several options as one decorator."""

    def decorate(command: Callable) -> Callable:
        for option in reversed(listed):
            command = option(command)
        return command

    return decorate


# What is asked of, and where it goes --------------------------------------------------------------

recordings_argument = click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...")
model_option = click.option("--model", "name", required=True, help="See `models`.")
folder_option = click.option(
    "--out", required=True, type=click.Path(path_type=Path), metavar="DIR", help="For the results."
)
_json = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
_quiet = click.option("--quiet", is_flag=True, help="Show no progress and no summary.")


# How a file is read -------------------------------------------------------------------------------

time_option = click.option("--time", metavar="COLUMN", help="The time: a name, or an index from 0.")
input_option = click.option("--input", metavar="COLUMN", help="The drive, likewise.")
output_option = click.option("--output", metavar="COLUMN", help="The response, likewise.")
rate_option = click.option("--rate", metavar="200Hz", help="Needed where there is no time column.")
input_unit_option = click.option("--input-unit", metavar="V", help="Unit of the drive.")
output_unit_option = click.option("--output-unit", metavar="um", help="Unit of the response.")
resample_option = click.option(
    "--resample", metavar="200Hz", help="Interpolate to this rate where the times are not uniform."
)
reading_options = options(
    time_option,
    input_option,
    output_option,
    rate_option,
    input_unit_option,
    output_unit_option,
    resample_option,
)


# How a fit or a simulation is done ----------------------------------------------------------------

_PAST = "What the drive did before the first sample."
_history = click.option(
    "--history",
    type=click.Choice(["auto", "rest", "constant", "periodic", "estimated"]),
    default="auto",
    show_default=True,
    help=_PAST,
)
simulated_history_option = click.option(
    "--history",
    type=click.Choice(["rest", "constant", "periodic"]),
    default="constant",
    show_default=True,
    help=_PAST,
)
_settle = click.option(
    "--settle", metavar='"1 s"', help="Leave out the first samples, whose memory is unknown."
)
_seed = click.option("--seed", type=int, default=0, show_default=True, help="Of random starts.")


# What is asked of parameters and samples ----------------------------------------------------------

fix_option = click.option("--fix", multiple=True, metavar='"alpha=0.1"', help="Hold a parameter.")
bound_option = click.option(
    "--bound", multiple=True, metavar='"alpha=0.05..0.2"', help="Narrow its range."
)
prior_option = click.option(
    "--prior", multiple=True, metavar='"alpha=0.1±0.02"', help="What was known of it (or +-)."
)
tie_option = click.option(
    "--tie", multiple=True, metavar='"second.mu=2*first.alpha"', help="Let one equal another."
)
own_option = click.option(
    "--own", multiple=True, metavar="NAME", help="A value of its own for every recording."
)
mask_option = click.option(
    "--mask", multiple=True, metavar='"3 s..4 s"', help="Leave out these times."
)
loss_option = click.option(
    "--loss",
    type=click.Choice(["least_squares", "huber", "soft_l1", "student_t"]),
    default="least_squares",
    show_default=True,
    help="All but the first let outliers weigh less.",
)
_ASKED = ("fix", "bound", "prior", "tie", "own", "mask", "loss")


# What reaches a command as one argument -----------------------------------------------------------


def takes_given(command: Callable) -> Callable:
    """How recordings are read and fitted, which reaches the command as `given`."""

    @options(reading_options, _history, _settle, _seed)
    @wraps(command)
    def called(*, history: str, settle: str | None, seed: int, **others: Any) -> int:
        columns = {name: others.pop(name) for name in _COLUMNS}
        return command(given=Given(columns, history, settle, seed), **others)

    return called


def takes_asked(*listed: Callable) -> Callable:
    """What is asked of parameters and samples, which reaches the command as `asked`: the keywords
    of `fit` that say the same."""

    def decorate(command: Callable) -> Callable:
        @options(*listed)
        @wraps(command)
        def called(**others: Any) -> int:
            from .._prepare import options_of

            written = {name: others.pop(name) for name in _ASKED if name in others}
            return command(asked=options_of(**written), **others)

        return called

    return decorate


def takes_results(command: Callable) -> Callable:
    """How results are told, which with the files saved reaches the command as `results`."""

    @options(_quiet, _json)
    @click.pass_obj
    @wraps(command)
    def called(saved: list[Path], *, quiet: bool, as_json: bool, **others: Any) -> int:
        return command(results=Results(saved, quiet, as_json), **others)

    return called
