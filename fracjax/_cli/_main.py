"""The program: its commands, and the message and exit status when a call fails."""

from __future__ import annotations

import _thread
import gc
import os
import shlex
import sys
import threading
import warnings
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import click

from .. import __version__
from ._app import app_command
from ._batch import batch_command
from ._compensate import compensate_command
from ._crosscheck import crosscheck_command
from ._demo import demo_command
from ._diagnose import diagnose_command
from ._effects import effects_command
from ._fit import fit_command
from ._info import info_command
from ._models import models_command
from ._posterior import posterior_command
from ._progress import announced
from ._protocol import protocol_command
from ._results import Call
from ._simulate import simulate_command
from ._statuses import INTERRUPTED, UNUSABLE, fail

_COMMANDS = (
    fit_command,
    crosscheck_command,
    batch_command,
    posterior_command,
    diagnose_command,
    protocol_command,
    demo_command,
    simulate_command,
    compensate_command,
    info_command,
    models_command,
    effects_command,
    app_command,
)


@click.group(
    commands=_COMMANDS,
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
    epilog='Shell completion: eval "$(_FRACJAX_COMPLETE=bash_source fracjax)", or zsh_source, '
    "fish_source.",
)
@click.version_option(__version__, prog_name="fracjax")
@click.pass_context
def cli(context: click.Context) -> None:
    """Find the physical effects that a simulation of a piezo actuator left out, and their size.

    \b
    To begin with:
      fracjax info FILE                                what is understood of your file
      fracjax diagnose FILE --model foh --out results  what the model leaves out of it
      fracjax demo                                     the same on a recording in the package
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


_UNCOLLECTED = 200_000
"""Objects that may be made before the garbage collector looks at them: with Python's own 700 it
takes a twentieth of a short command's time, which is spent on imports."""


def main() -> None:
    """The program `fracjax`."""
    prepare()
    leave(run())


def prepare() -> None:
    """What a process that is the program alone may set."""
    gc.set_threshold(_UNCOLLECTED)
    if not sys.warnoptions:
        warnings.simplefilter("ignore")
    sys.unraisablehook = heed_interrupt


def leave(status: int) -> None:
    """End the process at once, all that was to be written being written.

    A thread of PyArrow's that lets go of the bytes it has read while the interpreter is taken down
    asks for the interpreter's lock, is ended instead amid a destructor, and so aborts the process.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(BrokenPipeError):
            stream.flush()
    os._exit(status)


def heed_interrupt(unraisable: sys.UnraisableHookArgs) -> None:
    """Repeat a Ctrl-C that arrived in a callback of the garbage collector, which ignores it.

    JAX has such a callback, and after a long computation it is the first Python code to run.
    """
    if isinstance(unraisable.exc_value, KeyboardInterrupt):
        threading.Timer(0.05, _thread.interrupt_main).start()
    else:
        sys.__unraisablehook__(unraisable)


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; an error is one sentence on stderr."""
    arguments = sys.argv[1:] if arguments is None else arguments
    saved: list[Path] = []
    call = Call(shlex.join(["fracjax", *arguments]), saved)
    try:
        with announced(arguments):
            return cli.main(arguments, prog_name="fracjax", standalone_mode=False, obj=call) or 0
    except click.Abort:
        files = f"kept {', '.join(map(str, saved))}" if saved else "nothing had been written yet"
        return fail(f"Interrupted; {files}.", INTERRUPTED)
    except click.ClickException as error:
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "fracjax"
        message = " ".join(error.format_message().split()).rstrip(".?").replace(". ", "; ")
        return fail(f"{command}: {message}; see {command} --help.", UNUSABLE)
    except OSError as error:
        place, reason = error.filename or "output", (error.strerror or str(error)).lower()
        return fail(
            f"{place}: expected a place that can be written, found {reason}; choose another.",
            UNUSABLE,
        )
    except ValueError as error:
        from .._recording import InputError

        if not isinstance(error, InputError):
            raise
        return fail(f"{str(error).rstrip('.')}.", UNUSABLE)
