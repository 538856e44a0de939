"""A catalogue entry: a block, where it is inserted, and how it differs from its look-alikes."""

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
_PLACES: dict[str, str] = {
    "drive": "on the drive, before the model",
    "response": "on the response, after the model",
    "additive": "beside the model, added to its response",
    "modulation": "on the response, as a change of its gain or timing",
    "force": "on the response, where forces act",
    "series": "in series, after the model",
}
"""Where an effect acts, in words."""


@dataclass(frozen=True)
class Setting:
    """The scales of a recording, from which an effect takes the values of its trials.

    Attributes:
        drive_low: the lowest drive [drive unit].
        drive_high: the highest drive [drive unit].
        response_span: peak to peak of the response [response unit].
        step: time between samples [s].
        duration: of the recording [s].
        top_frequency: the highest frequency with appreciable drive [Hz].
        top_rate: the highest rate of the drive [drive unit/s].
        rms_rate: the rms rate of the drive [drive unit/s].
        response_low: the lowest response, counted from the first sample [response unit].
        resolution: the step between the codes of the response [response unit], 0 if it lies on no
            grid.
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
        """Peak to peak of the drive [drive unit]."""
        return self.drive_high - self.drive_low

    @property
    def drive_centre(self) -> float:
        """The middle of the drive's range [drive unit]."""
        return 0.5 * (self.drive_low + self.drive_high)


def _no_further_starts(block: Any) -> Sequence[AbstractBlock]:
    """No further starts of a refit: the default of `Effect.beyond`."""
    return ()


@dataclass(frozen=True)
class Effect:
    """One entry of the catalogue of effects.

    Each block's parameters state their unit and, in it, the plausible range.

    Attributes:
        name: the effect's name.
        site: where its blocks are inserted: before the model (`drive`), in parallel to it
            (`additive`), otherwise after it.
        sentence: the physics, in words.
        equation: the equation, in plain text.
        source: the literature.
        trials: from a recording's `Setting`, blocks at typical amplitudes and shapes: each is a
            direction of the score test and a start of the refit.  They may be of several classes,
            which are fitted separately.
        separated_by: for each look-alike, the experiment that distinguishes the two.
        concealed_by: the parameters of a base model that can absorb the effect.
        axes: the axes along which its signature stands out, the clearest first.
        elsewhere: the classes of blocks that are inserted at another site, with that site.
        one_sided: whether its trials have the only sign that physics allows, such as a delay, which
            is never an advance.
        rate_independent: whether it only changes the shape of a loop, at every rate alike, so that
            it is not distinguished from another law of hysteresis.
        special_case: the effect whose model is this one's with some parameters zero; "" if none.
        beyond: from this effect's block with the parameters that the special case was fitted with,
            further blocks to start a refit from.
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
    rate_independent: bool = False
    special_case: str = ""
    beyond: Callable[[Any], Sequence[AbstractBlock]] = _no_further_starts

    def place(self, site: str = "") -> str:
        """Where it acts, in words.

        Args:
            site: Of a block of it; empty for its own.

        Returns:
            Such as "on the drive, before the model".
        """
        return _PLACES[site or self.site]

    def site_of(self, block: AbstractBlock) -> Site:
        """The site at which one of its blocks is inserted.

        Args:
            block: one of the effect's blocks.

        Returns:
            The site.
        """
        return self.elsewhere.get(type(block), self.site)

    def insert(self, base: AbstractBlock, block: AbstractBlock) -> AbstractBlock:
        """The base model with this effect's block at its site.

        Args:
            base: the model without the effect.
            block: one of the effect's blocks.

        Returns:
            The composed block, in the units of the base.
        """
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
        """The response with this effect, computed from the base's own response where possible.

        Args:
            base: the model without the effect.
            block: one of the effect's blocks.
            drive: (N,), in drive units.
            response: of the base alone (N,), in response units.
            grid: step [s] and history.

        Returns:
            The response with the effect (N,), in response units.
        """
        site = self.site_of(block)
        if site == "drive":
            return base.respond(block.respond(drive, grid), grid)
        if site == "additive":
            return response + block.respond(drive, grid)
        return block.respond(response, grid)


def at_values(
    block: AbstractBlock, shapes: Sequence[Mapping[str, ArrayLike]]
) -> list[AbstractBlock]:
    """Copies of a block, one for each set of parameter values, each value in the parameter's
    unit."""
    return [set_values(block, shape) for shape in shapes]
