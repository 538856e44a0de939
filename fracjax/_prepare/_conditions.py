r"""What a call asks of parameters: ties, values of their own per recording, priors.

A fit moves numbers φ; the parameters of recording r's block are linear in them,

    θ_r = M_r φ,      M_r = 1 where nothing is asked

so that a tie is a second row of M in a number's column, a parameter that every recording has for
itself a column per recording, and a prior (Mφ - mean)/sd one more row of the whitened residual.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from .._blocks import AbstractBlock, linear_gains
from .._parameters import Parameter, named_parameters, replace_parameters, set_values
from .._recording import InputError, require_kind
from ._layout import Layout, layout_of, split
from ._normal import Normal

Tied = Mapping[str, str | tuple[str, float]]


@dataclass(frozen=True)
class Conditions:
    """`ties`: by name the parameter that it equals, and the factor; `own`: names of which every
    recording has its own value; `priors`: by name."""

    ties: dict[str, tuple[str, float]] = field(default_factory=dict)
    own: tuple[str, ...] = ()
    priors: dict[str, Normal] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.ties or self.own or self.priors)

    def to_dict(self) -> dict:
        """Plain data."""
        return {
            "tied": {name: {"to": s, "factor": f} for name, (s, f) in self.ties.items()},
            "own": list(self.own),
            "priors": {
                name: {"mean": prior.mean.tolist(), "sd": prior.sd.tolist()}
                for name, prior in self.priors.items()
            },
        }


PLAIN = Conditions()


class Number(NamedTuple):
    """One number that a fit moves: a component of a parameter, of one recording or of all."""

    label: str
    name: str
    component: int
    recording: int | None


class PriorRows(NamedTuple):
    """Priors (P,) as rows over the numbers: shapes (P, S), gains (P, G), means and sds."""

    shapes: np.ndarray
    gains: np.ndarray
    means: np.ndarray
    sds: np.ndarray


class Scale(NamedTuple):
    """Where shapes (S,) may lie: which are bounded, which of them by their logarithms, and the
    bounds `low` and `high` on that scale."""

    bounded: np.ndarray
    logarithmic: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Numbers:
    """The numbers a fit moves, shapes iterated and gains eliminated, the shapes' scale, and per
    recording the maps (parameters' components, numbers) to the block's shapes and gains, in the
    layout's order."""

    layout: Layout
    shapes: tuple[Number, ...]
    gains: tuple[Number, ...]
    scale: Scale
    shape_maps: tuple[np.ndarray, ...]
    gain_maps: tuple[np.ndarray, ...]
    shared: bool

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(number.label for number in self.shapes + self.gains)

    @property
    def own(self) -> tuple[str, ...]:
        """The parameters that every recording has for itself."""
        each = (n.name for n in self.shapes + self.gains if n.recording is not None)
        return tuple(dict.fromkeys(each))

    def blocks(
        self, block: AbstractBlock, shapes: np.ndarray, gains: np.ndarray
    ) -> tuple[AbstractBlock, ...]:
        """The block of every recording at values of the numbers."""
        maps = list(zip(self.shape_maps, self.gain_maps, strict=True))
        found = [
            set_values(
                block,
                split(block, self.layout.shapes, of_shapes @ shapes)
                | split(block, self.layout.gains, of_gains @ gains),
            )
            for of_shapes, of_gains in (maps[:1] if self.shared else maps)
        ]
        return tuple(found * len(maps) if self.shared else found)

    def gains_of(self, block: AbstractBlock) -> np.ndarray:
        """The gains' present values (G,)."""
        return np.array([_component(p.value, p, k) for p, k in _members(block, self.gains)])

    def position_of(self, block: AbstractBlock) -> np.ndarray:
        """Where the shapes (S,) stand, as `_layout.position_of` has it."""
        members = _members(block, self.shapes)
        return np.array([_component(p.to_share(p.value), p, k) for p, k in members])

    def values_at(self, position: np.ndarray) -> np.ndarray:
        """The shapes' values (S,) at a position, as `Parameter.from_share` has them."""
        bounded, logarithmic, low, high = self.scale
        values = np.where(bounded, low + (high - low) * position, position)
        return np.where(logarithmic, np.exp(np.where(logarithmic, values, 0.0)), values)

    def slopes(self, values: np.ndarray) -> np.ndarray:
        """How fast each shape's value (S,) changes with its position."""
        bounded, logarithmic, low, high = self.scale
        return np.where(bounded, (high - low) * np.where(logarithmic, values, 1.0), 1.0)

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """The positions' bounds (S,)."""
        bounded = self.scale.bounded
        return np.where(bounded, 0.0, -np.inf), np.where(bounded, 1.0, np.inf)


def _scale_of(block: AbstractBlock, shapes: Sequence[Number]) -> Scale:
    members = list(_members(block, shapes))
    bounded = np.array([p.bounded for p, _ in members], dtype=bool)
    logarithmic = np.array([p.logarithmic for p, _ in members], dtype=bool)
    low, high = (
        np.array([_component(end(p), p, k) if p.bounded else 0.0 for p, k in members])
        for end in (lambda p: p.lower, lambda p: p.upper)
    )
    low[logarithmic], high[logarithmic] = np.log(low[logarithmic]), np.log(high[logarithmic])
    return Scale(bounded, logarithmic, low, high)


def _members(block: AbstractBlock, numbers: Sequence[Number]) -> Iterator[tuple[Parameter, int]]:
    parameters = named_parameters(block)
    return ((parameters[number.name], number.component) for number in numbers)


def _component(values: object, parameter: Parameter, k: int) -> float:
    shape = np.shape(parameter.value)
    return float(np.ravel(np.broadcast_to(np.asarray(values), shape))[k])


def numbers_of(block: AbstractBlock, recordings: int, conditions: Conditions) -> Numbers:
    """The numbers that a fit of the block to so many recordings moves.

    Of several recordings each has for itself what was asked for, and what begins anew with it.
    """
    layout, own = layout_of(block), {*conditions.own}
    if recordings > 1:
        parameters = named_parameters(block).items()
        own |= {name for name, p in parameters if p.per_recording and not p.fixed}
    shapes, shape_maps = _mapped(layout.shapes, recordings, conditions.ties, own)
    gains, gain_maps = _mapped(layout.gains, recordings, conditions.ties, own)
    scale = _scale_of(block, shapes)
    return Numbers(layout, shapes, gains, scale, shape_maps, gain_maps, not own)


def _mapped(
    sizes: tuple[tuple[str, int], ...],
    recordings: int,
    ties: Mapping[str, tuple[str, float]],
    own: Collection[str],
) -> tuple[tuple[Number, ...], tuple[np.ndarray, ...]]:
    places = {(name, k): at for at, (name, k) in enumerate(_components(sizes))}
    numbers = []
    for name, size in sizes:
        if name in ties:
            continue
        whose = range(recordings) if name in own else (None,)
        for k in range(size):
            label = name if size == 1 else f"{name}[{k}]"
            numbers += [
                Number(label if r is None else f"{label}@{r + 1}", name, k, r) for r in whose
            ]
    maps = tuple(np.zeros((len(places), len(numbers))) for _ in range(recordings))
    for column, number in enumerate(numbers):
        rows = [(places[number.name, number.component], 1.0)]
        rows += [
            (places[target, number.component], factor)
            for target, (source, factor) in ties.items()
            if source == number.name
        ]
        for r in range(recordings) if number.recording is None else (number.recording,):
            for row, factor in rows:
                maps[r][row, column] = factor
    return tuple(numbers), maps


def _components(sizes: tuple[tuple[str, int], ...]) -> Iterator[tuple[str, int]]:
    return ((name, k) for name, size in sizes for k in range(size))


def prior_rows(numbers: Numbers, conditions: Conditions) -> PriorRows:
    """The priors as rows over the numbers; of an own parameter a row for every recording."""
    layout = numbers.layout
    sizes = dict(layout.shapes + layout.gains)
    places = list(_components(layout.shapes)), list(_components(layout.gains))
    rows: list[tuple[np.ndarray, np.ndarray]] = []
    means, sds = [], []
    for name, prior in conditions.priors.items():
        source = conditions.ties.get(name, (name, 1.0))[0]
        recordings = len(numbers.shape_maps) if source in numbers.own else 1
        for r in range(recordings):
            for k in range(sizes[name]):
                of_shapes, of_gains = numbers.shape_maps[r], numbers.gain_maps[r]
                member = (name, k)
                rows.append(
                    (
                        np.sum(of_shapes[[p == member for p in places[0]]], axis=0),
                        np.sum(of_gains[[p == member for p in places[1]]], axis=0),
                    )
                )
                means.append(float(np.ravel(prior.mean)[k % prior.mean.size]))
                sds.append(float(np.ravel(prior.sd)[k % prior.sd.size]))
    shapes = np.array([row[0] for row in rows]).reshape(len(rows), len(numbers.shapes))
    gains = np.array([row[1] for row in rows]).reshape(len(rows), len(numbers.gains))
    return PriorRows(shapes, gains, np.array(means), np.array(sds))


# What a call asks ---------------------------------------------------------------------------------


def conditions_of(
    block: AbstractBlock,
    *,
    tied: Tied | None = None,
    own: Sequence[str] = (),
    priors: Mapping[str, Normal] | None = None,
) -> tuple[AbstractBlock, Conditions]:
    """The block made ready for its ties, and what was asked.

    A parameter follows the one it is tied to, within the bounds of both.  Two that are not both
    eliminated are both iterated.  Raises InputError for names that are unknown, fixed, or tied to
    another that is tied.
    """
    ties = {
        name: (to, 1.0) if isinstance(to, str) else (to[0], float(to[1]))
        for name, to in (tied or {}).items()
    }
    priors = dict(priors or {})
    parameters = named_parameters(block)
    for name in (*ties, *(source for source, _ in ties.values()), *own, *priors):
        _require_free(name, parameters)
    for name, (source, factor) in ties.items():
        if source in ties or source == name or name in own:
            raise InputError.at(
                f'parameter "{name}", tied to "{source}"',
                "one that is neither tied itself nor given to every recording",
                "such a one",
                "tie all to one parameter",
            )
        if not (np.isfinite(factor) and factor != 0):
            raise InputError.at(
                f'parameter "{name}", tied', "a factor other than 0", f"{factor:g}", "correct it"
            )
        if parameters[name].value.shape != parameters[source].value.shape:
            raise InputError.at(
                f'parameter "{name}", tied to "{source}"',
                "two of like size", "others", "tie others",
            )  # fmt: skip
    for name, prior in priors.items():
        require_kind(prior, Normal, f'prior of "{name}"', "write Normal(mean, sd)")
        size = max(prior.mean.size, prior.sd.size)
        fits = size in (1, parameters[name].value.size)
        if not (fits and np.all(np.isfinite(prior.mean)) and np.all(prior.sd > 0)):
            raise InputError.at(
                f'prior of "{name}"',
                "a finite mean and a standard deviation above 0",
                "another",
                "correct it",
            )
    block = replace_parameters(block, _joined(block, ties))
    return block, Conditions(ties, tuple(own), priors)


def _require_free(name: str, parameters: Mapping[str, Parameter]) -> None:
    free = [n for n, p in parameters.items() if not p.fixed]
    if name not in free:
        raise InputError.at(
            f'parameter "{name}"',
            f"one of {', '.join(free)}",
            "a fixed one" if name in parameters else "none of that name",
            "correct it",
        )


def _joined(block: AbstractBlock, ties: Mapping[str, tuple[str, float]]) -> dict[str, Parameter]:
    """Tied parameters and those they follow: within both bounds, eliminated only if both are."""
    parameters, eliminated = named_parameters(block), linear_gains(block)
    changed: dict[str, Parameter] = {}
    for name, (source, factor) in ties.items():
        target, leader = parameters[name], changed.get(source, parameters[source])
        ends = np.sort([target.lower / factor, target.upper / factor], axis=0)
        low, high = np.maximum(leader.lower, ends[0]), np.minimum(leader.upper, ends[1])
        gain = name in eliminated and source in eliminated and leader.gain
        try:
            changed[source] = _within(leader, low, high, gain)
        except ValueError as error:
            raise InputError(f'parameter "{name}", tied to "{source}": {error}.') from None
        follower = factor * changed[source].value
        changed[name] = _within(target, target.lower, target.upper, gain).with_value(follower)
    return changed


def _within(p: Parameter, low: ArrayLike, high: ArrayLike, gain: bool) -> Parameter:
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
