r"""What a recording can show: the smallest effect that would be named, from its drive and noise.

With a response in proportion to the drive, an effect of the size a has along its column d the
detectability a ‖P d‖, P the projection off path curves and fading memory, tempered by what they do
not know.  No response is needed.

Source: the local approach, Benveniste, Basseville & Moustakides, IEEE TAC 32 (1987) 583.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ._curves import Curves
from ._dynamics import dynamics_of, modes_of
from ._law import FADINGS, ROUGHNESSES, Curve, Settled
from ._view import UNKNOWN, Signal, kinds_of, motions_of, prior_of

LEVEL = 6.0
"""The detectability from which an effect is named: with its prior odds of .02 and Occam's factor of
a few tens of shapes a probability of .95."""
LARGEST = 0.2
"""The largest credible size, over the response's span: what would only be seen beyond is said not
to be seen at any."""

_MODES = 8
"""Frequencies of modes that are tried, of each damping."""
_AGAIN = 0.1
"""The share of samples on branches that are met again below which a drive repeats nothing."""


@dataclass(frozen=True)
class Visible:
    """The smallest size of an effect that a recording would show.

    Attributes:
        effect: its name.
        size: peak to peak of its change of the response, of its median shape [response unit]; None
            where no credible size would be seen.
        unit: the response's unit.
        reason: why none is seen, in words; "" where one is.
    """

    effect: str
    size: float | None
    unit: str
    reason: str


def can_show(signals: Sequence[Signal], unit: str) -> tuple[Visible, ...]:
    """What recordings can show of each effect of dynamics, whatever their law of hysteresis.

    Args:
        signals: of one actuator; of their responses only the span is used.
        unit: the responses' unit.

    Returns:
        One entry per effect, in alphabetical order.
    """
    span = max(float(np.ptp(s.response)) for s in signals)
    low, high = min(s.drive.min() for s in signals), max(s.drive.max() for s in signals)
    slope = span / (high - low)
    ideal = [replace(s, response=slope * (s.drive - low)) for s in signals]
    prior = prior_of(signals)
    whitening = prior.whitening
    settled = Settled(prior, float(ROUGHNESSES[0]) * prior.noise, float(FADINGS[-2]))
    response = np.concatenate([s.response for s in ideal])
    curve = Curve(response, np.full(response.size, slope), lambda drive: slope * (drive - low))
    motions = motions_of(signals, curve)
    modes = [m for each in modes_of(motions) for m in each[:: max(1, len(each) // _MODES)]]
    columns = [*dynamics_of(motions), *modes]
    matrix = np.concatenate([c.values for c in columns], axis=1)
    gram = settled.prior.inner(whitening(matrix), whitening(response)).columns
    scale = np.sqrt(1 + UNKNOWN * whitening.count)
    sizes: dict[str, list[float]] = {}
    for column, kind in zip(columns, kinds_of(columns), strict=True):
        own = gram[kind.start : kind.stop, kind.start : kind.stop]
        seen = np.sqrt(max(float(np.linalg.eigvalsh(own)[-1]), 0.0))
        whole = float(np.ptp(column.values, axis=0).max())
        sizes.setdefault(column.effect, []).append(LEVEL * scale * whole / max(seen, 1e-12))

    shown = []
    for effect in sorted(sizes):
        size = float(np.median(sizes[effect]))
        visible = size <= LARGEST * span
        reason = "" if visible else _reason(prior.curves)
        shown.append(Visible(effect, size if visible else None, unit, reason))
    return tuple(shown)


def _reason(curves: Curves) -> str:
    """Why no credible size of an effect would be seen."""
    if curves.met_again < _AGAIN:
        return "the drive meets every branch of its path once, so that any law could make the same"
    return "the drive meets its path again in the same way, so that a law could make the same"
