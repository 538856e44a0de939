"""A model with the effects that have been added to it so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from .._blocks import AbstractBlock, Effect, Site
from .._parameters import Parameter, named_parameters, replace_parameters
from .._prepare import Preparation, layout_of
from .._solve import Solved, solve_from


@dataclass(frozen=True)
class Layer:
    """An effect inserted at a model, with the trial that the refit started from."""

    effect: Effect
    trial: AbstractBlock

    @property
    def site(self) -> Site:
        """Where it is inserted."""
        return self.effect.site_of(self.trial)

    @property
    def place(self) -> str:
        """The name of the effect's own part of the block that `Effect.insert` returns."""
        return "first" if self.site == "drive" else "second"

    def own(self, block: AbstractBlock) -> dict[str, Parameter]:
        """The effect's own parameters, by their dotted names in the block whose outermost layer it
        is, in the order of the block's layout."""
        parameters, layout = named_parameters(block), layout_of(block)
        names = [name for name, _ in layout.shapes + layout.gains]
        return {n: parameters[n] for n in names if n.startswith(f"{self.place}.")}

    def own_shapes(self, block: AbstractBlock) -> dict[str, Parameter]:
        """Those of the effect's own parameters that are not gains."""
        shapes = dict(layout_of(block).shapes)
        return {name: p for name, p in self.own(block).items() if name in shapes}

    @property
    def inside(self) -> str:
        """The name of the part of that block that contains the model."""
        return "second" if self.site == "drive" else "first"


@dataclass(frozen=True)
class Stage:
    """The base model with layers of effects, the last one outermost, fitted together."""

    base: str
    nominal: AbstractBlock
    layers: tuple[Layer, ...]
    solved: Solved

    @property
    def preparation(self) -> Preparation:
        return self.solved.preparation

    def on(self, preparation: Preparation) -> Stage:
        """The same fit with the recordings prepared for another grid."""
        return replace(self, solved=self.solved.on(preparation))

    @property
    def adopted(self) -> tuple[str, ...]:
        return tuple(layer.effect.name for layer in self.layers)

    @property
    def excess(self) -> float:
        """χ² minus its expectation under noise alone."""
        return self.solved.cost - self.solved.samples

    @property
    def name(self) -> str:
        """The model as a user would write it."""
        name = self.base
        for layer in self.layers:
            grouped = f"({name})" if " " in name else name
            if layer.site == "drive":
                name = f"{layer.effect.name} >> {grouped}"
            else:
                sign = "+" if layer.site == "additive" else ">>"
                name = f"{grouped} {sign} {layer.effect.name}"
        return name

    def extended(self, layer: Layer, solved: Solved) -> Stage:
        """The stage with one more effect."""
        return Stage(self.base, self.nominal, (*self.layers, layer), solved)

    def start(self) -> AbstractBlock:
        """Base and effects at their nominal parameters."""
        return wrapped(self.nominal, [(layer, layer.trial) for layer in self.layers])

    @property
    def displaced(self) -> dict[str, Parameter]:
        """The shapes that were fitted outside their usual ranges: they may compensate for missing
        physics, and hide it from a test at that fit."""
        return {
            n: self._parameters[n] for n in self._shapes if not self._parameters[n].is_plausible
        }

    @cached_property
    def undisplaced(self) -> Solved:
        """The best fit within the usual ranges of all shapes."""
        kept = {name: self._parameters[name].kept_plausible() for name in self._shapes}
        starts = [replace_parameters(b, kept) for b in (self.solved.block, self.start())]
        return solve_from(starts, self.preparation)

    @property
    def _parameters(self) -> dict[str, Parameter]:
        """All parameters of the fitted block, by their dotted names."""
        return named_parameters(self.solved.block)

    @property
    def _shapes(self) -> list[str]:
        """The dotted names of the parameters that are not gains."""
        return [name for name, _ in layout_of(self.solved.block).shapes]

    def without(self, dropped: int) -> Stage:
        """The stage with one effect less, fitted again."""
        layers = (*self.layers[:dropped], *self.layers[dropped + 1 :])
        solved = solve_from([self.fitted_without(dropped)], self.preparation)
        return replace(self, layers=layers, solved=solved)

    def fitted_without(self, dropped: int) -> AbstractBlock:
        """The fitted block without one of its layers."""
        block, parts = self.solved.block, []
        for layer in reversed(self.layers):
            parts.append((layer, getattr(block, layer.place)))
            block = getattr(block, layer.inside)
        kept = [part for k, part in enumerate(reversed(parts)) if k != dropped]
        return wrapped(block, kept)


def wrapped(block: AbstractBlock, parts: Sequence[tuple[Layer, AbstractBlock]]) -> AbstractBlock:
    """A block with effects inserted one after the other, the first innermost."""
    for layer, part in parts:
        block = layer.effect.insert(block, part)
    return block


def path_of(layers: Sequence[Layer], k: int) -> str:
    """Dotted name of layer k's own block within the whole."""
    inward = "".join(f"{layer.inside}." for layer in reversed(layers[k + 1 :]))
    return f"{inward}{layers[k].place}."
