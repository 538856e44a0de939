"""What an inquiry into a machine ends in."""

from __future__ import annotations

from dataclasses import dataclass

from .._blocks import Within
from .._solve import Solved
from ._evidence import Weighed


@dataclass(frozen=True)
class Candidate:
    """An effect that was fitted with all parameters free.

    Attributes:
        name: the effect's name.
        block: the machine with it; of the first recording.
        ratio: the residual's sum of squares, over that before.
        probability: among the candidates of its round, after their fits.
    """

    name: str
    block: Within
    ratio: float
    probability: float


@dataclass(frozen=True)
class Round:
    """One effect sought beside those that were named before.

    Attributes:
        weighed: every hypothesis about the residual to first order, the most probable first.
        candidates: those that were fitted, the most probable first; empty where what is not inside
            was more probable than all effects, or none was probable.
    """

    weighed: tuple[Weighed, ...]
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True)
class Inside:
    """Which physics a machine's model leaves out inside its dynamics.

    Attributes:
        base: the fit without it.
        extended: the fit with all effects that are named; the base where none is.
        rounds: how they were sought, in order.
        named: how many of the first rounds name their effect.
        base_error: the rms error of the base on the held-out recording [response], None without.
        extended_error: that of the extended model.
    """

    base: Solved
    extended: Solved
    rounds: tuple[Round, ...]
    named: int
    base_error: float | None
    extended_error: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """The effects that are named, in the order of their finding."""
        return tuple(dict.fromkeys(r.candidates[0].name for r in self.rounds[: self.named]))

    @property
    def sets(self) -> tuple[tuple[str, ...], ...]:
        """Of each round that names an effect, those that it may be instead, itself first."""
        return tuple(
            tuple(c.name for c in r.candidates if c.probability >= ALTERNATIVE)
            for r in self.rounds[: self.named]
        )

    @property
    def outside(self) -> str:
        """What explains most of what is left where that is no effect inside; "" otherwise."""
        if self.named == len(self.rounds):
            return ""
        best = max(self.rounds[self.named].weighed, key=lambda w: w.share)
        return best.name if not best.best.inside and best.share >= DOMINANT else ""

    @property
    def block(self) -> Within:
        """The machine with the effects that are named."""
        return self.extended.block  # type: ignore[return-value]


ALTERNATIVE = 0.05
"""The probability from which an effect belongs to the set that the recording cannot tell apart."""
DOMINANT = 0.5
"""The share of the residual that an effect must explain to be named: more than all that is left
unexplained.  A smaller share may be that of a look-alike of what is not in the catalogue."""
