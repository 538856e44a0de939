"""What a section is: one law, sample by sample; and which section belongs to which block.

A section is written once, in JAX.  Python runs it as it stands, and C is written from the program
that JAX traces of it (`_c`), so that the two cannot differ.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from functools import singledispatch
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import AbstractBlock, Parallel, Series
from ..._recording import InputError
from ..._systems import Band

State = Any
"""What a section remembers: a tree of numbers and arrays, of fixed size."""
Response = Callable[[Array], tuple[Array, State]]
"""From this sample's drive to the features (g,) and the state after it."""


class Sampling(NamedTuple):
    """How a loop samples.

    Attributes:
        step: Its step [s].
        band: The wider band, on which powers of s are approximated.
        bottom: The band's own lowest angular frequency [rad/s].
        top: Its highest angular frequency [rad/s].
        low: The lowest drive [drive].
        high: The highest drive [drive].
    """

    step: float
    band: Band
    bottom: float
    top: float
    low: float
    high: float


class Section(abc.ABC):
    """One law, sample by sample: its response is `gains` · features.

    Attributes:
        gains: (g,) what enters the response linearly; its labels are `labels`.
    """

    gains: np.ndarray
    labels: tuple[str, ...]

    @abc.abstractmethod
    def start(self, drive: Array) -> State:
        """The state of a stage that has rested at a drive for long."""

    @abc.abstractmethod
    def begin(self, state: State) -> Response:
        """What this sample's response is for any drive; what does not depend on it is computed
        once.  The features are those of the drive's end of the step."""

    @property
    def parts(self) -> tuple[Section, ...]:
        """The sections that it consists of."""
        return ()

    def response(self, state: State) -> Callable[[Array], tuple[Array, State]]:
        """The response [response] for any drive, and the state after it, with these gains."""
        respond = self.begin(state)

        def of(drive: Array) -> tuple[Array, State]:
            features, after = respond(drive)
            return weighed(features, self.gains), after

        return of


def weighed(features: Array, gains: Any) -> Array:
    """gains · features, one number."""
    return jnp.sum(jnp.asarray(gains) * features)


@singledispatch
def section_of(block: AbstractBlock, sampling: Sampling) -> Section:
    """The section of a block.  Each law registers its own, in its file.

    Raises InputError for a block that has none.
    """
    raise InputError.at(
        "streaming",
        "a model of laws that run sample by sample",
        type(block).__name__,
        "fit a model without it, or use compensate for a motion that is known ahead",
    )


class Sum(Section):
    """Sections in parallel."""

    def __init__(self, first: Section, second: Section):
        self.first, self.second = first, second
        self.gains = np.concatenate([first.gains, second.gains])
        self.labels = first.labels + second.labels

    @property
    def parts(self) -> tuple[Section, ...]:
        return self.first, self.second

    def start(self, drive: Array) -> State:
        return tuple(part.start(drive) for part in self.parts)

    def begin(self, state: State) -> Response:
        responses = [part.begin(each) for part, each in zip(self.parts, state, strict=True)]

        def respond(drive: Array) -> tuple[Array, State]:
            (one, after), (other, later) = (each(drive) for each in responses)
            return jnp.concatenate([one, other]), (after, later)

        return respond


class Chain(Section):
    """Sections in series, whose gains are those of the second."""

    def __init__(self, first: Section, second: Section):
        self.first, self.second = first, second
        self.gains, self.labels = second.gains, second.labels

    @property
    def parts(self) -> tuple[Section, ...]:
        return self.first, self.second

    def start(self, drive: Array) -> State:
        before = self.first.start(drive)
        between = self.first.response(before)(drive)[0]
        return before, self.second.start(between)

    def begin(self, state: State) -> Response:
        first, second = self.first.response(state[0]), self.second.begin(state[1])

        def respond(drive: Array) -> tuple[Array, State]:
            between, before = first(drive)
            features, after = second(between)
            return features, (before, after)

        return respond


@section_of.register
def _(block: Parallel, sampling: Sampling) -> Section:
    return Sum(section_of(block.first, sampling), section_of(block.second, sampling))


@section_of.register
def _(block: Series, sampling: Sampling) -> Section:
    return Chain(section_of(block.first, sampling), section_of(block.second, sampling))
