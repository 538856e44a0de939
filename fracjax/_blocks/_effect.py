"""A catalogue entry: a block, where it is inserted, and what tells it from its look-alikes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from jax.typing import ArrayLike

from .._operators import Grid
from .._parameters import set_values
from ._block import AbstractBlock

Site = Literal["drive", "response", "additive", "modulation", "force", "series"]


@dataclass(frozen=True)
class Setting:
    """What a recording says about the size of things: from it an effect takes its typical shapes.

    drive_low, drive_high [drive unit]: the drive's extremes; response_span [response unit]: peak
    to peak of the response; step, duration [s]; top_frequency [Hz]: the highest with appreciable
    drive; top_rate, rms_rate [drive unit/s]; response_low [response unit]: the lowest response,
    counted from the first sample; resolution [response unit]: the step between the codes that the
    response is written in, 0 where it lies on no grid.
    """

    drive_low: float
    drive_high: float
    response_span: float
    step: float
    duration: float
    top_frequency: float
    top_rate: float
    rms_rate: float
    response_low: float
    resolution: float

    @property
    def drive_span(self) -> float:
        return self.drive_high - self.drive_low

    @property
    def drive_centre(self) -> float:
        return 0.5 * (self.drive_low + self.drive_high)


def _nothing_beyond(block: Any) -> Sequence[AbstractBlock]:
    """Further blocks to begin a refit from, where the numbers of the special case are known."""
    return ()


@dataclass(frozen=True)
class Effect:
    """One row of the catalogue.

    `trials(setting)` lists blocks at typical amplitudes and shapes: each is a direction of the
    score test and a start of the refit.  They may be of several structures, which are fitted apart;
    `elsewhere` says which of these are inserted at another site.
    `separated_by` says, for each look-alike, which experiment tells the two apart.  `axes` are the
    places where its signature stands out.
    `one_sided`: its trials show the only sign that physics allows, as a delay is never an advance.
    `foreign`: it follows neither the drive nor a slow course, so that what another effect's law
    leaves over does not look like it, nor what it leaves over like another effect.
    `special_case`: the effect whose law this one's is where some of its numbers vanish; `beyond`
    makes of a block with the numbers that were found of that further ones to begin a refit from.
    Each block's parameters say their unit and the range that is plausible in it.
    """

    name: str
    site: Site
    sentence: str
    equation: str
    source: str
    trials: Callable[[Setting], Sequence[AbstractBlock]]
    separated_by: dict[str, str]
    concealed_by: str
    axes: tuple[str, ...] = field(default=("time",))
    elsewhere: Mapping[type[AbstractBlock], Site] = field(default_factory=dict)
    one_sided: bool = False
    foreign: bool = False
    special_case: str = ""
    beyond: Callable[[Any], Sequence[AbstractBlock]] = _nothing_beyond

    def site_of(self, block: AbstractBlock) -> Site:
        """Where one of its blocks is inserted."""
        return self.elsewhere.get(type(block), self.site)

    def insert(self, base: AbstractBlock, block: AbstractBlock) -> AbstractBlock:
        """The base with this effect's block at its site."""
        site = self.site_of(block)
        if site == "drive":
            return block >> base
        if site == "additive":
            return base + block
        return base >> block

    def respond(
        self,
        base: AbstractBlock,
        block: AbstractBlock,
        drive: np.ndarray,
        response: np.ndarray,
        grid: Grid,
    ) -> np.ndarray:
        """The response (N,) with this effect, where the base's own response is known."""
        site = self.site_of(block)
        if site == "drive":
            return base.respond(block.respond(drive, grid), grid)
        if site == "additive":
            return response + block.respond(drive, grid)
        return block.respond(response, grid)


def at_values(
    block: AbstractBlock, shapes: Sequence[Mapping[str, ArrayLike]]
) -> list[AbstractBlock]:
    """The same block at several parameter values, one per trial."""
    return [set_values(block, shape) for shape in shapes]
