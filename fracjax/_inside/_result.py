"""What an inquiry into a machine ends in."""

from __future__ import annotations

from dataclasses import dataclass

from .._blocks import Within
from .._solve import Solved


@dataclass(frozen=True)
class Candidate:
    """A set of effects that was fitted with all parameters free.

    Attributes:
        names: the effects' names, in alphabetical order.
        block: the machine with them; of the first recording.
        ratio: the residual's sum of squares, over that without effects.
        probability: among all sets that were fitted, none among them.
    """

    names: tuple[str, ...]
    block: Within
    ratio: float
    probability: float


@dataclass(frozen=True)
class Inside:
    """Which physics a machine's model leaves out inside its dynamics.

    Attributes:
        base: the fit without it.
        extended: the fit with all effects that are named; the base where none is.
        candidates: all sets of effects that were fitted, the most probable first.
        outside: what explains most of what the fit leaves where that is no effect inside:
            "linear_dynamics", "drive_curve" or "response_curve"; "" where it needs none of them.
        base_error: the rms error of the base on the held-out recording [response], None without.
        extended_error: that of the extended model.
    """

    base: Solved
    extended: Solved
    candidates: tuple[Candidate, ...]
    outside: str
    base_error: float | None
    extended_error: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that are named, the most probable first."""
        names = dict.fromkeys(self.candidates[0].names)  # one may act at several ports
        return tuple(sorted(names, key=lambda name: -self.probability_of(name)))

    def probability_of(self, name: str) -> float:
        """The probability that an effect is present."""
        return min(1.0, sum(c.probability for c in self.candidates if name in c.names))

    def share_of(self, name: str) -> float:
        """The share of the residual without effects that a named one takes beside the others."""
        best = self.candidates[0]
        fewer = (c for c in self.candidates if name not in c.names and {*c.names} <= {*best.names})
        return min((c.ratio for c in fewer), default=1.0) - best.ratio

    @property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """Of each effect that is named, those that it may be instead, itself first."""
        return tuple((name, *self._instead_of(name)) for name in self.names)

    def _instead_of(self, name: str) -> tuple[str, ...]:
        """The effects in whose place a named one may stand, the rest of the set being equal."""
        others = {*self.candidates[0].names} - {name}
        alike: dict[str, float] = {}
        for candidate in self.candidates[1:]:
            rest = {*candidate.names} - others
            if others <= {*candidate.names} and len(rest) == 1 and name not in rest:
                alike.setdefault(rest.pop(), candidate.probability)
        own = self.candidates[0].probability
        return tuple(n for n, p in alike.items() if p >= ALTERNATIVE * own)

    @property
    def block(self) -> Within:
        """The machine with the effects that are named."""
        return self.extended.block  # type: ignore[return-value]


ALTERNATIVE = 0.05
"""The probability, over that of the most probable, from which an effect belongs to the set that the
recording cannot tell apart."""
