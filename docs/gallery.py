"""The gallery of effects, from the catalogue: a new effect appears in it by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fracjax as fj
from fracjax._cli._parameters import free_parameters
from fracjax._models import ORDINARY
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

SITES = {
    "drive": "on the drive, before the model",
    "response": "on the response, after the model",
    "additive": "beside the model, added to its response",
    "modulation": "on the response, as a change of its gain or timing",
    "force": "on the response, where forces act",
    "series": "in series, after the model",
}

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


def link(name: str) -> str:
    """A look-alike as a link, where it is an effect of the catalogue."""
    return f"[{words(name)}](#{anchor(name)})" if name in fj.EFFECTS else words(name)


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
        site=SITES[effect.site],
        concealed_by=effect.concealed_by,
        equation=effect.equation,
        parameters="; ".join(map(range_of, free_parameters(effect.trials(ORDINARY)[0]))),
        look_alikes="\n".join(alike),
        source=effect.source,
    )


def write(page: Path, pictures: Path) -> None:
    """Write the page and its pictures."""
    pictures.mkdir(exist_ok=True)
    for name in fj.EFFECTS:
        draw_effect(name, pictures / f"{name}.svg", stacked=True)
    sections = [section(effect) for effect in fj.EFFECTS.values()]
    page.write_text("\n".join([OPENING, *sections]), encoding="utf-8")
