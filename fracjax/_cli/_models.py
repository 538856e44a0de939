"""`fracjax models`: the models, their equations and parameters."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click

from ._options import takes_results
from ._parameters import free_parameters
from ._results import Results
from ._tables import print_json, print_table

if TYPE_CHECKING:
    from .._blocks import AbstractBlock


@click.command("models")
@takes_results
def models_command(results: Results) -> None:
    """List the models with their equations and parameters."""
    from .._blocks import INSIDE
    from .._models import GROUPS

    listed = [
        {"group": group} | _model(name, make())
        for group, models in GROUPS.items()
        for name, make in models.items()
    ]
    if results.as_json:
        print_json(listed)
    elif not results.quiet:
        headers = ["model", "what it is", "equation", "parameters"]
        for group in GROUPS:
            print(f"\n{group}")
            print_table(headers, [_row(model) for model in listed if model["group"] == group])
        print('Models and effects are joined in series by >> and in parallel by +: "foh >> creep".')
        print('Inside a machine acts, by @: "oscillator @ cubic_stiffness"; there are')
        print(f"{', '.join(INSIDE)}.")
        print("An effect alone is fitted on a gain: --model resonance is gain >> resonance.")
        print("Creep alone is the power law above; in a composition, the effect of that name.")


def _row(model: dict[str, Any]) -> list[str]:
    """A model as a row of the table."""
    parameters = [
        f"{p['name']} [{p['unit']}]" if p["unit"] != "1" else p["name"] for p in model["parameters"]
    ]
    return [model["name"], model["sentence"], model["equation"], "\n".join(parameters)]


def _model(name: str, block: AbstractBlock) -> dict[str, Any]:
    """A model as plain data, described by the docstrings of its blocks."""
    import inspect

    parts = _parts(block)
    texts = [inspect.cleandoc(type(part).__doc__ or "") for part in parts]
    lines = [re.split(r"(?m)^(?:Args|Attributes):$", text)[0].splitlines() for text in texts]
    equations = [line.strip() for part in lines for line in part if line.startswith("    ")]
    openings = [re.sub(r" \[[FL][^]]*\]", "", part[0]).rstrip(":.") for part in lines]
    return {
        "name": name,
        "sentence": "; then ".join(openings),
        "equation": "\n".join(equations),
        "parameters": free_parameters(block),
    }


def _parts(block: AbstractBlock) -> list[AbstractBlock]:
    """The blocks of a composition, in order."""
    from .._blocks import LinearParallel, LinearSeries, Parallel, Series

    if isinstance(block, Series | LinearSeries | Parallel | LinearParallel):
        return _parts(block.first) + _parts(block.second)
    return [block]
