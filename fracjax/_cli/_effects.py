"""`fracjax effects`: the catalogue of effects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ._options import takes_results
from ._parameters import free_parameters
from ._results import Results
from ._tables import print_json, print_table


@click.command("effects")
@click.argument("name", required=False)
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Draw the effect's signature, as .svg, .png or .pdf.",
)
@takes_results
def effects_command(name: str | None, picture: Path | None, results: Results) -> None:
    """List the effects that `diagnose` can identify, or describe one in full."""
    from .._aliases import meant_by, spelt
    from .._blocks import EFFECTS, INSIDE
    from .._models import MODELS
    from .._recording import InputError, closest

    if name is not None:
        asked, name = name, meant_by(spelt(name)).name
        if name not in EFFECTS:
            raise InputError.at(
                f'effect "{asked}"',
                f"one of {', '.join(EFFECTS)}",
                f"none of that name{closest(asked, EFFECTS)}",
                "see `fracjax models` for models" if name in MODELS else "correct it",
            )
    if picture is not None:
        _draw(name, picture, results.saved)
    listed = [_effect(key) for key in ([name] if name else EFFECTS)]
    if results.as_json:
        print_json(listed[0] if name else listed)
    elif name is not None and not results.quiet:
        print_table([], _rows(listed[0]))
    elif not results.quiet:
        print_table(
            ["effect", "acts", "equation", "what it is"],
            [[e["name"], EFFECTS[e["name"]].place(), e["equation"], e["sentence"]] for e in listed],
        )
        print('\nInside a machine, at a port of it: --model "oscillator @ cubic_stiffness"')
        print_table(
            ["effect", "acts at a", "equation", "what it is"],
            [[e.name, e.kind, e.equation, e.sentence] for e in INSIDE.values()],
        )


def _draw(name: str | None, picture: Path, saved: list[Path]) -> None:
    """Draw an effect into a file, and note the file."""
    from .._recording import InputError
    from .._report import draw_effect

    if name is None or picture.suffix not in (".svg", ".png", ".pdf"):
        raise InputError.at(
            "--picture",
            "the name of an effect and a file ending in .svg, .png or .pdf",
            f'"{picture}" for {name or "all effects"}',
            "name one effect and such a file",
        )
    draw_effect(name, picture)
    saved.append(picture)


def _effect(name: str) -> dict[str, Any]:
    """A catalogue entry as plain data, with ranges for a stack of common size."""
    from .._blocks import EFFECTS
    from .._models import ORDINARY

    effect = EFFECTS[name]
    fields = ("name", "site", "sentence", "equation", "separated_by", "concealed_by", "source")
    return {field: getattr(effect, field) for field in fields} | {
        "parameters": free_parameters(effect.trials(ORDINARY)[0])
    }


def _rows(effect: dict[str, Any]) -> list[list[str]]:
    """A catalogue entry as rows of a table."""
    from .._show import figure, pretty_unit, quantity

    parameters = [
        f"{p['name']}: {figure(p['plausible'][0])} to {quantity(p['plausible'][1], p['unit'])}"
        if p["plausible"]
        else f"{p['name']}: any {pretty_unit(p['unit'])}"
        for p in effect["parameters"]
    ]
    look_alikes = [
        f"{other}: distinguished by {how}" for other, how in effect["separated_by"].items()
    ]
    from .._blocks import EFFECTS

    return [
        ["effect", effect["name"]],
        ["what it is", effect["sentence"]],
        ["equation", effect["equation"]],
        ["acts", EFFECTS[effect["name"]].place()],
        ["plausible", "\n".join(parameters)],
        ["look-alikes", "\n".join(look_alikes) or "none"],
        ["concealed by", effect["concealed_by"]],
        ["source", effect["source"]],
    ]
