"""Conditions on parameters: ties, values of each recording's own, priors.

A fit adjusts free parameters φ; the parameters of recording r's block are linear in them,

    θ_r = M_r φ,      M_r = 1 without conditions

A tie is a second row of M in a free parameter's column.  A parameter that each recording has of its
own has one column per recording.  A prior (Mφ - mean)/sd is one more row of the whitened residual.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from .._blocks import AbstractBlock, linear_gains
from .._naming import path_of_name, shown_names, unknown_parameter
from .._parameters import Parameter, named_parameters, replace_parameters, set_values
from .._recording import InputError, require_kind
from ._layout import Layout, layout_of, values_by_name
from ._normal import Normal

Tied = Mapping[str, str | tuple[str, float]]


@dataclass(frozen=True)
class Conditions:
    """Conditions on a block's parameters, which are named by their places in the block.

    Attributes:
        ties: for each tied parameter's name, the name of the parameter that it follows, and the
            factor (dimensionless).
        own: names of the parameters of which each recording has its own value.
        priors: for each name, the prior in the parameter's unit.
    """

    ties: dict[str, tuple[str, float]] = field(default_factory=dict)
    own: tuple[str, ...] = ()
    priors: dict[str, Normal] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.ties or self.own or self.priors)

    def as_shown(self, block: AbstractBlock) -> Conditions:
        """The same conditions by the names that are shown of the block's parameters."""
        shown = shown_names(block)
        return Conditions(
            {shown[name]: (shown[source], f) for name, (source, f) in self.ties.items()},
            tuple(shown[name] for name in self.own),
            {shown[name]: prior for name, prior in self.priors.items()},
        )

    def to_dict(self, block: AbstractBlock) -> dict:
        """The conditions on a block as plain data, as in fit.json."""
        named = self.as_shown(block)
        return {
            "tied": {name: {"to": s, "factor": f} for name, (s, f) in named.ties.items()},
            "own": list(named.own),
            "priors": {
                name: {"mean": prior.mean.tolist(), "sd": prior.sd.tolist()}
                for name, prior in named.priors.items()
            },
        }


PLAIN = Conditions()
"""No conditions."""


class FreeParameter(NamedTuple):
    """One free parameter of a fit: a component of a parameter, of one recording or of all.

    Attributes:
        label: the name that results show, of the parameter in its own block.
        name: the parameter's place in the whole block.
        component: the index of the component, 0 for a parameter that is one number.
        recording: the index of the recording that it belongs to, None where all share it.
    """

    label: str
    name: str
    component: int
    recording: int | None


class PriorRows(NamedTuple):
    """Priors (P,) as rows over the free parameters.

    Attributes:
        shapes: (P, S), the rows over the shapes.
        gains: (P, G), the rows over the gains.
        means: (P,), in the parameters' units.
        sds: (P,), standard deviations in the parameters' units.
    """

    shapes: np.ndarray
    gains: np.ndarray
    means: np.ndarray
    sds: np.ndarray


class Scale(NamedTuple):
    """The scale on which shapes (S,) are searched for.

    Attributes:
        bounded: (S,), whether the shape has bounds.
        logarithmic: (S,), whether its scale is logarithmic.
        low: (S,), the lower bound on that scale, 0 where there is none.
        high: (S,), the upper bound on that scale, 0 where there is none.
    """

    bounded: np.ndarray
    logarithmic: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class FreeParameters:
    """The free parameters of a fit: shapes, which are iterated, and gains, which are eliminated.

    Attributes:
        layout: the block's parameters in order.
        shapes: (S,) the free shapes.
        gains: (G,) the free gains.
        scale: the shapes' scale.
        shape_maps: per recording (components, S), from the free shapes to the block's shapes.
        gain_maps: per recording (components, G), from the free gains to the block's gains.
        shared: whether all recordings have the same block.
    """

    layout: Layout
    shapes: tuple[FreeParameter, ...]
    gains: tuple[FreeParameter, ...]
    scale: Scale
    shape_maps: tuple[np.ndarray, ...]
    gain_maps: tuple[np.ndarray, ...]
    shared: bool

    @property
    def labels(self) -> tuple[str, ...]:
        """The labels of the shapes, then those of the gains."""
        return tuple(parameter.label for parameter in self.shapes + self.gains)

    @property
    def own(self) -> tuple[str, ...]:
        """The names of the parameters of which each recording has its own value."""
        each = (n.name for n in self.shapes + self.gains if n.recording is not None)
        return tuple(dict.fromkeys(each))

    def blocks(
        self, block: AbstractBlock, shapes: np.ndarray, gains: np.ndarray
    ) -> tuple[AbstractBlock, ...]:
        """The block of each recording at values of the shapes (S,) and gains (G,)."""
        maps = list(zip(self.shape_maps, self.gain_maps, strict=True))
        blocks = [
            set_values(
                block,
                values_by_name(block, self.layout.shapes, of_shapes @ shapes)
                | values_by_name(block, self.layout.gains, of_gains @ gains),
            )
            for of_shapes, of_gains in (maps[:1] if self.shared else maps)
        ]
        return tuple(blocks * len(maps) if self.shared else blocks)

    def gains_of(self, block: AbstractBlock) -> np.ndarray:
        """The present values (G,) of a block's gains."""
        return np.array([p.component(p.value, k) for p, k in _with_components(block, self.gains)])

    def position_of(self, block: AbstractBlock) -> np.ndarray:
        """The positions (S,) of a block's shapes, as `_layout.position_of` defines them."""
        members = _with_components(block, self.shapes)
        return np.array([p.component(p.to_share(p.value), k) for p, k in members])

    def values_at(self, position: np.ndarray) -> np.ndarray:
        """The shapes' values (S,) at a position (S,), as `Parameter.from_share` computes them."""
        bounded, logarithmic, low, high = self.scale
        values = np.where(bounded, low + (high - low) * position, position)
        return np.where(logarithmic, np.exp(np.where(logarithmic, values, 0.0)), values)

    def slopes(self, values: np.ndarray) -> np.ndarray:
        """The derivative (S,) of each shape's value with respect to its position."""
        bounded, logarithmic, low, high = self.scale
        return np.where(bounded, (high - low) * np.where(logarithmic, values, 1.0), 1.0)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The lower and upper bounds (S,) of the positions."""
        bounded = self.scale.bounded
        return np.where(bounded, 0.0, -np.inf), np.where(bounded, 1.0, np.inf)


def _scale_of(block: AbstractBlock, shapes: Sequence[FreeParameter]) -> Scale:
    """The scale of the shapes (S,) of a block."""
    members = list(_with_components(block, shapes))
    bounded = np.array([p.bounded for p, _ in members], dtype=bool)
    logarithmic = np.array([p.logarithmic for p, _ in members], dtype=bool)
    low, high = (
        np.array([p.component(end(p), k) if p.bounded else 0.0 for p, k in members])
        for end in (lambda p: p.lower, lambda p: p.upper)
    )
    low[logarithmic], high[logarithmic] = np.log(low[logarithmic]), np.log(high[logarithmic])
    return Scale(bounded, logarithmic, low, high)


def _with_components(
    block: AbstractBlock, free: Sequence[FreeParameter]
) -> Iterator[tuple[Parameter, int]]:
    """Each free parameter's `Parameter` in the block, and its component."""
    parameters = named_parameters(block)
    return ((parameters[one.name], one.component) for one in free)


def free_parameters_of(
    block: AbstractBlock, recordings: int, conditions: Conditions
) -> FreeParameters:
    """The free parameters of a fit of the block to this many recordings.

    With several recordings, each has its own value of the parameters in `conditions.own` and of
    those that start anew with each recording.
    """
    layout, own = layout_of(block), {*conditions.own}
    if recordings > 1:
        parameters = named_parameters(block).items()
        own |= {name for name, p in parameters if p.per_recording and not p.fixed}
    shown, ties = shown_names(block), conditions.ties
    shapes, shape_maps = _parameters_and_maps(layout.shapes, shown, recordings, ties, own)
    gains, gain_maps = _parameters_and_maps(layout.gains, shown, recordings, ties, own)
    scale = _scale_of(block, shapes)
    return FreeParameters(layout, shapes, gains, scale, shape_maps, gain_maps, not own)


def _parameters_and_maps(
    sizes: tuple[tuple[str, int], ...],
    shown: Mapping[str, str],
    recordings: int,
    ties: Mapping[str, tuple[str, float]],
    own: Collection[str],
) -> tuple[tuple[FreeParameter, ...], tuple[np.ndarray, ...]]:
    """The free shapes or gains, and per recording the map (components, parameters)."""
    places = {(name, k): at for at, (name, k) in enumerate(_components(sizes))}
    free = []
    for name, size in sizes:
        if name in ties:
            continue
        owners = range(recordings) if name in own else (None,)
        for k in range(size):
            label = shown[name] if size == 1 else f"{shown[name]}[{k}]"
            free += [
                FreeParameter(label if r is None else f"{label}@{r + 1}", name, k, r)
                for r in owners
            ]
    maps = tuple(np.zeros((len(places), len(free))) for _ in range(recordings))
    for column, one in enumerate(free):
        rows = [(places[one.name, one.component], 1.0)]
        rows += [
            (places[target, one.component], factor)
            for target, (source, factor) in ties.items()
            if source == one.name
        ]
        for r in range(recordings) if one.recording is None else (one.recording,):
            for row, factor in rows:
                maps[r][row, column] = factor
    return tuple(free), maps


def _components(sizes: tuple[tuple[str, int], ...]) -> Iterator[tuple[str, int]]:
    """Names and components of parameters with these sizes, in order."""
    return ((name, k) for name, size in sizes for k in range(size))


def prior_rows(free: FreeParameters, conditions: Conditions) -> PriorRows:
    """The priors as rows over the free parameters, one row per recording for an own parameter."""
    layout = free.layout
    sizes = dict(layout.shapes + layout.gains)
    places = list(_components(layout.shapes)), list(_components(layout.gains))
    rows: list[tuple[np.ndarray, np.ndarray]] = []
    means, sds = [], []
    for name, prior in conditions.priors.items():
        source = conditions.ties.get(name, (name, 1.0))[0]
        recordings = len(free.shape_maps) if source in free.own else 1
        for r in range(recordings):
            for k in range(sizes[name]):
                of_shapes, of_gains = free.shape_maps[r], free.gain_maps[r]
                member = (name, k)
                rows.append(
                    (
                        np.sum(of_shapes[[p == member for p in places[0]]], axis=0),
                        np.sum(of_gains[[p == member for p in places[1]]], axis=0),
                    )
                )
                means.append(float(np.ravel(prior.mean)[k % prior.mean.size]))
                sds.append(float(np.ravel(prior.sd)[k % prior.sd.size]))
    shapes = np.array([row[0] for row in rows]).reshape(len(rows), len(free.shapes))
    gains = np.array([row[1] for row in rows]).reshape(len(rows), len(free.gains))
    return PriorRows(shapes, gains, np.array(means), np.array(sds))


# Conditions from the options of a call ------------------------------------------------------------


def conditions_of(
    block: AbstractBlock,
    *,
    tied: Tied | None = None,
    own: Sequence[str] = (),
    priors: Mapping[str, Normal] | None = None,
) -> tuple[AbstractBlock, Conditions]:
    """The block adapted to its ties, and the conditions.

    A tied parameter follows its source within the bounds of both.  Two of which only one could be
    eliminated are both iterated.  Raises InputError for names that are unknown, fixed, or tied to a
    parameter that is itself tied.
    """

    def place(name: str) -> str:
        """The place of a free parameter."""
        return _free_path(name, block)

    ties = {
        place(name): (place(to), 1.0) if isinstance(to, str) else (place(to[0]), float(to[1]))
        for name, to in (tied or {}).items()
    }
    own = [place(name) for name in own]
    priors = {place(name): prior for name, prior in (priors or {}).items()}
    parameters, shown = named_parameters(block), shown_names(block)
    for name, (source, factor) in ties.items():
        if source in ties or source == name or name in own:
            raise InputError.at(
                f'parameter "{shown[name]}", tied to "{shown[source]}"',
                "a parameter that is neither tied itself nor own to each recording",
                "one that is",
                "tie all to one parameter",
            )
        if not (np.isfinite(factor) and factor != 0):
            raise InputError.at(
                f'parameter "{shown[name]}", tied',
                "a factor other than 0",
                f"{factor:g}",
                "correct it",
            )
        if parameters[name].value.shape != parameters[source].value.shape:
            raise InputError.at(
                f'parameter "{shown[name]}", tied to "{shown[source]}"',
                "two parameters of the same size", "different sizes", "tie parameters of one size",
            )  # fmt: skip
    for name, prior in priors.items():
        require_kind(prior, Normal, f'prior of "{shown[name]}"', "write Normal(mean, sd)")
        size = max(prior.mean.size, prior.sd.size)
        fits = size in (1, parameters[name].value.size)
        if not (fits and np.all(np.isfinite(prior.mean)) and np.all(prior.sd > 0)):
            raise InputError.at(
                f'prior of "{shown[name]}"',
                "finite means and standard deviations above 0, one or one per component",
                f"mean {prior.mean.tolist()} and standard deviation {prior.sd.tolist()}",
                "correct it",
            )
    block = replace_parameters(block, _tie_parameters(block, ties))
    return block, Conditions(ties, tuple(own), priors)


def _free_path(name: str, block: AbstractBlock) -> str:
    """The place of a free parameter.  Raises InputError where none has this name."""
    parameters, shown = named_parameters(block), shown_names(block)
    path = path_of_name(name, block)
    free = [shown[each] for each, p in parameters.items() if not p.fixed]
    if path not in parameters:
        raise unknown_parameter(name, free)
    if parameters[path].fixed:
        raise InputError.at(
            f'parameter "{name}"', f"one of {', '.join(free)}", "a fixed one", "correct it"
        )
    return path


def _tie_parameters(
    block: AbstractBlock, ties: Mapping[str, tuple[str, float]]
) -> dict[str, Parameter]:
    """Tied parameters and their sources: within both bounds, eliminated only if both can be."""
    parameters, eliminated = named_parameters(block), linear_gains(block)
    shown = shown_names(block)
    changed: dict[str, Parameter] = {}
    for name, (source, factor) in ties.items():
        target, leader = parameters[name], changed.get(source, parameters[source])
        ends = np.sort([target.lower / factor, target.upper / factor], axis=0)
        low, high = np.maximum(leader.lower, ends[0]), np.minimum(leader.upper, ends[1])
        gain = name in eliminated and source in eliminated and leader.gain
        try:
            changed[source] = _narrowed(leader, low, high, gain)
        except ValueError as error:
            where = f'parameter "{shown[name]}", tied to "{shown[source]}"'
            raise InputError(f"{where}: {error}.") from None
        follower = factor * changed[source].value
        changed[name] = _narrowed(target, target.lower, target.upper, gain).with_value(follower)
    return changed


def _narrowed(p: Parameter, low: ArrayLike, high: ArrayLike, gain: bool) -> Parameter:
    """The parameter with bounds `low` and `high`, its value and plausible range clipped to them."""
    plausible = [np.clip(end, low, high) for end in p.plausible]
    return Parameter(
        np.clip(p.value, low, high),
        p.unit,
        lower=low,
        upper=high,
        plausible=(plausible[0], plausible[1]),
        logarithmic=p.logarithmic,
        gain=gain,
        per_recording=p.per_recording,
    )
