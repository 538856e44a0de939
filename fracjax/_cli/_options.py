"""The options that several commands take, each declared once."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from ._given import Given
from ._results import Call, Results

_COLUMNS = (
    *("time", "input", "output", "rate", "input_unit", "output_unit", "time_unit", "resample"),
    *("segment", "skip_rows", "names_row", "units_row"),
    *("input_scale", "output_scale", "wrap", "description"),
)
_PAIR = ("drive", "response")


def options(*listed: Callable) -> Callable:
    """Several options as one decorator."""

    def decorate(command: Callable) -> Callable:
        for option in reversed(listed):
            command = option(command)
        return command

    return decorate


# What is asked of, and where it goes --------------------------------------------------------------


def _required(context: click.Context, parameter: click.Parameter, given: Any) -> Any:
    """What was given, unless nothing was, neither here nor by --drive."""
    if not given and not context.params.get("drive"):
        raise click.MissingParameter(ctx=context, param=parameter)
    return given


recordings_argument = click.argument(
    "recordings", nargs=-1, callback=_required, metavar="RECORDING..."
)
recording_argument = click.argument(
    "recording", required=False, callback=_required, metavar="RECORDING"
)
model_option = click.option("--model", "name", required=True, help="See `models`.")
pauses_option = click.option(
    "--pauses",
    metavar='"2 s"',
    help="The recordings were taken one after the other, with these pauses between them, or those "
    "of their stamps: --pauses stamps.  What creeps, warms or wears then goes on from one to the "
    "next.",
)
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
_unit = click.option(
    "--unit",
    multiple=True,
    metavar="drive=mV",
    help="Unit of the drive or the response: what a file leaves unsaid, or is converted to.",
)
_scale = click.option(
    "--scale",
    multiple=True,
    metavar='"drive=counts*0.0305 mV"',
    help="What counts of a signal stand for.",
)
_clock = click.option("--clock", metavar="us", help="What the time column counts in.")
_wrap = click.option(
    "--wrap",
    metavar="32",
    help='After how many bits, or which time, it begins anew: 16, "60 s" or none.',
)
_description = click.option(
    "--description",
    type=click.Path(),
    metavar="FILE",
    help="A file that says the same as these options; see info --write-description.",
)
_input_unit = click.option("--input-unit", hidden=True)
_output_unit = click.option("--output-unit", hidden=True)
_time_unit = click.option("--time-unit", hidden=True)
resample_option = click.option(
    "--resample", metavar="200Hz", help="Interpolate to this rate where the times are not uniform."
)
segment_option = click.option(
    "--segment",
    type=click.IntRange(min=1),
    metavar="NUMBER",
    help="The one to take, of a file with several.",
)
_skip_rows = click.option(
    "--skip-rows",
    type=click.IntRange(min=0),
    metavar="NUMBER",
    help="Lines of a text or sheet to pass over, where the table is not found.",
)
_names_row = click.option(
    "--names-row", type=click.IntRange(min=1), metavar="LINE", help="The line of the names."
)
_units_row = click.option(
    "--units-row", type=click.IntRange(min=1), metavar="LINE", help="The line of the units."
)
table_options = options(segment_option, _skip_rows, _names_row, _units_row)
_drive = click.option(
    "--drive",
    metavar="FILE",
    is_eager=True,
    help="A file of the drive alone, with --response, for a recording.",
)
_response = click.option("--response", metavar="FILE", help="A file of the response alone.")
_column_options = options(_drive, _response, time_option, input_option, output_option)
_SIGNALS = {"drive": "input", "response": "output", "time": "time"}


def unit_options(command: Callable) -> Callable:
    """Units, factors and clocks of files, which reach the command as the options of `read`."""

    @options(_unit, _scale, _clock, _wrap, _description, _input_unit, _output_unit, _time_unit)
    @wraps(command)
    def called(*, unit: tuple[str, ...], scale: tuple[str, ...], clock: str | None, **others: Any):
        others |= {"input_scale": None, "output_scale": None}
        for kind, texts in (("unit", unit), ("scale", scale)):
            for text in texts:
                signal, equals, value = text.partition("=")
                role = _SIGNALS.get(signal.strip())
                if not equals or role is None or (kind == "scale" and role == "time"):
                    example = "drive=mV" if kind == "unit" else '"drive=counts*0.0305 mV"'
                    raise click.UsageError(f'Give --{kind} as {example}, not "{text}"')
                others[f"{role}_{kind}"] = value.strip()
        if clock is not None:
            others["time_unit"] = clock
        return command(**others)

    return called


reading_options = options(
    _column_options, rate_option, unit_options, resample_option, table_options
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
    "--tie", multiple=True, metavar='"creep.mu=2*foh.alpha"', help="Let one equal another."
)
own_option = click.option(
    "--own", multiple=True, metavar="NAME", help="A value of its own for every recording."
)
mask_option = click.option(
    "--mask",
    multiple=True,
    metavar='"3 s..4 s"',
    help='Leave out these times, or "bad": missing and clipped samples, and spikes.',
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


def given_of(
    others: dict[str, Any],
    mask: tuple[str, ...],
    history: str = "auto",
    settle: str | None = None,
    seed: int = 0,
) -> Given:
    """How recordings are to be read and fitted, taken out of a command's arguments."""
    columns = {name: others.pop(name) for name in _COLUMNS}
    drive, response = (others.pop(name) for name in _PAIR)
    if (drive is None) != (response is None):
        raise click.UsageError("Give --drive and --response together, each with a file")
    pair = None if drive is None else (drive, response)
    return Given(columns | {"mask": mask or None}, history, settle, seed, pair)


def takes_given(command: Callable) -> Callable:
    """How recordings are read and fitted, which reaches the command as `given`."""

    @options(reading_options, _history, _settle, _seed)
    @wraps(command)
    def called(*, history: str, settle: str | None, seed: int, **others: Any) -> int:
        given = given_of(others, others.pop("to_mask", ()), history, settle, seed)
        return command(given=given, **others)

    return called


def takes_asked(*listed: Callable) -> Callable:
    """What is asked of parameters and samples, which reaches the command as `asked`: the keywords
    of `fit` that say the same.  The times to be masked also reach the reading of files, which then
    allows them to hold no numbers; what is "bad" they tell alone."""

    def decorate(command: Callable) -> Callable:
        @options(*listed)
        @wraps(command)
        def called(**others: Any) -> int:
            from .._prepare import options_of

            written = {name: others.pop(name) for name in _ASKED if name in others}
            mask = written.get("mask", ())
            if mask:
                written["mask"] = tuple(text for text in mask if text != "bad")
            return command(asked=options_of(**written), to_mask=mask, **others)

        return called

    return decorate


def takes_results(command: Callable) -> Callable:
    """How results are told, which with the files saved reaches the command as `results`."""

    @options(_quiet, _json)
    @click.pass_obj
    @wraps(command)
    def called(call: Call, *, quiet: bool, as_json: bool, **others: Any) -> int:
        return command(results=Results(call, quiet, as_json), **others)

    return called
