"""Effects around a model, and the name of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .._blocks import AbstractBlock, Effect, Site
from .._parameters import Parameter, named_parameters, replace_parameters
from .._prepare import layout_of

_BEYOND = 0.1
"""How far the shape of an effect may be from its plausible range, over the width of that: on a
coarse grid a mode is less damped than it is.  Chosen by judgement."""


@dataclass(frozen=True)
class Layer:
    """An effect around a model, with the trial block that it starts from."""

    effect: Effect
    trial: AbstractBlock

    @property
    def site(self) -> Site:
        """Where it is inserted."""
        return self.effect.site_of(self.trial)

    @property
    def place(self) -> str:
        """The effect's own part of the block that `Effect.insert` makes."""
        return "first" if self.site == "drive" else "second"

    @property
    def inside(self) -> str:
        """The part of that block that holds the model."""
        return "second" if self.site == "drive" else "first"

    def own(self, block: AbstractBlock) -> dict[str, Parameter]:
        """The effect's own parameters in a block that it is the outermost layer of, by their paths,
        in the order of the block's layout."""
        parameters, layout = named_parameters(block), layout_of(block)
        names = [name for name, _ in layout.shapes + layout.gains]
        return {n: parameters[n] for n in names if n.startswith(f"{self.place}.")}


def wrapped(block: AbstractBlock, layers: Sequence[Layer]) -> AbstractBlock:
    """A block with effects around it, the first innermost, whose shapes stay plausible: beyond that
    an effect is another, as a mode of critical damping is a lag."""
    for layer in layers:
        block = layer.effect.insert(block, _plausible(layer.trial))
    return block


def _plausible(trial: AbstractBlock) -> AbstractBlock:
    """An effect whose shapes are bounded by their plausible ranges."""
    parameters = named_parameters(trial)
    shapes = {name: parameters[name].kept_plausible(_BEYOND) for name, _ in layout_of(trial).shapes}
    return replace_parameters(trial, shapes)


def parts_of(block: AbstractBlock, layers: Sequence[Layer]) -> tuple[AbstractBlock, list[Layer]]:
    """The model inside a block, and the effects around it as in it, the first innermost."""
    around = []
    for layer in reversed(layers):
        around.append(Layer(layer.effect, getattr(block, layer.place)))
        block = getattr(block, layer.inside)
    return block, around[::-1]


def path_of(layers: Sequence[Layer], k: int) -> str:
    """Dotted path of layer k's own block within the whole."""
    inward = "".join(f"{layer.inside}." for layer in reversed(layers[k + 1 :]))
    return f"{inward}{layers[k].place}."


def written(base: str, layers: Sequence[Layer]) -> str:
    """The model as one would write it."""
    name = base
    for layer in layers:
        grouped = f"({name})" if " " in name else name
        if layer.site == "drive":
            name = f"{layer.effect.name} >> {grouped}"
        else:
            sign = "+" if layer.site == "additive" else ">>"
            name = f"{grouped} {sign} {layer.effect.name}"
    return name
