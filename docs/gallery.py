"""The gallery of effects, from the catalogue: a new effect appears in it by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import fracjax as fj
from fracjax._cli._parameters import free_parameters
from fracjax._models import ORDINARY
from fracjax._parameters import named_parameters
from fracjax._report import draw_effect
from fracjax._show import figure, quantity

OPENING = """\
# Gallery of effects

What `fj.diagnose` can name, one section for each effect of `fj.EFFECTS`; `fracjax effects NAME`
shows the same in the shell.  Each picture has the loop of the model `foh` without and with the
effect, and below it the change of the response over time, for a drive of three amplitudes and
two speeds (grey).  The change is the largest that the catalogue tries; small ones are magnified
in the loop.  Plausible ranges are for a drive from 0 to 100 and a response of 10, in their units.

A *look-alike* is an effect whose change is so like this one's on many drives that a fit cannot
distinguish them.  Beside it stands the experiment that can.
"""

SECTION = """\
({anchor})=
## {title}

:::{{container}} effect
![Loop and response over time without and with {title}](effects/{name}.svg)

{sentence}. It acts {site}.

```text
{equation}
```

**Plausible**: {parameters}.

**Can be absorbed by**: {concealed_by}.

**Look-alikes**, and what distinguishes them:

{look_alikes}

**Source**: {source}.
:::
"""

INSIDE_OPENING = """\
# Physics inside machines

What acts at a port of a machine, `machine @ effect`, and changes the motion that it depends on
([how it is found](how-to/machines.md)).  Forces, flows and signals are in units of the drive.
"""

INSIDE_SECTION = """\
({anchor})=
## {title}

{sentence}. It acts where there is a {kind}.

```text
{equation}
```

**Parameters**: {parameters}.

**Look-alikes**, and what distinguishes them:

{look_alikes}

**Source**: {source}.
"""


def link(name: str) -> str:
    """A look-alike as a link, where it is an effect of the catalogue."""
    known = name in fj.EFFECTS or name in fj.blocks.INSIDE
    return f"[{words(name)}](#{anchor(name)})" if known else words(name)


def words(name: str) -> str:
    """An effect's name in words."""
    return name.replace("_", " ")


def anchor(name: str) -> str:
    """The place of an effect's section."""
    return f"effect-{name.replace('_', '-')}"


def range_of(parameter: dict[str, Any]) -> str:
    """A parameter's plausible range in words."""
    if parameter["plausible"] is None:
        return f"`{parameter['name']}` of any size"
    low, high = parameter["plausible"]
    return f"`{parameter['name']}` {figure(low)} to {quantity(high, parameter['unit'])}"


def section(effect: fj.Effect) -> str:
    """An effect's section, in Markdown."""
    alike = [f"- {link(other)}: {how}" for other, how in effect.separated_by.items()]
    return SECTION.format(
        anchor=anchor(effect.name),
        title=words(effect.name),
        name=effect.name,
        sentence=effect.sentence[0].upper() + effect.sentence[1:],
        site=effect.place(),
        concealed_by=effect.concealed_by,
        equation=effect.equation,
        parameters="; ".join(map(range_of, free_parameters(effect.trials(ORDINARY)[0]))),
        look_alikes="\n".join(alike),
        source=effect.source,
    )


def inside_section(effect: fj.blocks.InsideEffect) -> str:
    """The section of an effect inside a machine, in Markdown."""
    alike = [f"- {link(other)}: {how}" for other, how in effect.separated_by.items()]
    swing = np.sin(np.linspace(0, 2 * np.pi, 50))
    parameters = named_parameters(effect.trials(fj.blocks.Motion(swing, swing, swing))[0])
    return INSIDE_SECTION.format(
        anchor=anchor(effect.name),
        title=words(effect.name),
        sentence=effect.sentence[0].upper() + effect.sentence[1:],
        kind=effect.kind,
        equation=effect.equation,
        parameters="; ".join(f"`{name}` [{p.unit}]" for name, p in parameters.items()),
        look_alikes="\n".join(alike),
        source=effect.source,
    )


def write_inside(page: Path) -> None:
    """Write the page of effects inside machines."""
    sections = [inside_section(effect) for effect in fj.blocks.INSIDE.values()]
    page.write_text("\n".join([INSIDE_OPENING, *sections]), encoding="utf-8")


def write(page: Path, pictures: Path) -> None:
    """Write the page and its pictures."""
    pictures.mkdir(exist_ok=True)
    for name in fj.EFFECTS:
        draw_effect(name, pictures / f"{name}.svg", stacked=True)
    sections = [section(effect) for effect in fj.EFFECTS.values()]
    page.write_text("\n".join([OPENING, *sections]), encoding="utf-8")
