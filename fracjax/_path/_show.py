r"""What a recording can show: the smallest effect that would be named, from its drive and noise.

With a response in proportion to the drive, an effect of the size a has along its column d the
detectability a ‖P d‖, P the projection off path curves and fading memory of the largest size, since
the law is not known, tempered by what they do not know.  No response is needed.

Source: the local approach, Benveniste, Basseville & Moustakides, IEEE TAC 32 (1987) 583.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ._curves import Curves
from ._dynamics import (
    _HIGHEST,
    _LEAST_PERIODS,
    FAMILIES,
    MODE,
    MODE_DAMPINGS,
    Columns,
    Family,
    Motion,
    Scale,
)
from ._expansion import UNKNOWN, kinds_of, motions_of, prior_of
from ._filters import Shape
from ._law import FADINGS, ROUGHNESSES, Curve, PathLaw, Settled
from ._signal import Signal

LEVEL = 6.0
"""The detectability from which an effect is named: with its prior odds of .02 and Occam's factor of
a few tens of shapes a probability of .95."""
LARGEST = 0.2
"""The largest credible size, over the response's span: what would only be seen beyond is said not
to be seen at any."""
SHOWN = tuple(sorted({MODE.effect, *FAMILIES}))
"""The effects whose smallest visible size a drive determines."""
_OF_SHAPE = {"delay", "drive_lag", "resonance", "sensor_lag", "slew_rate_limit"}
"""Effects whose size is that of their shape: a lag of a time constant cannot be larger."""
_NEAREST = 3
"""Shapes of such an effect that are only just seen, whose median counts."""
_SHAPES = 8
"""Shapes that are tried of each effect, and of modes of each damping: their median is asked for."""
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
    prior = prior_of(signals)
    shown = []
    for effect, shapes in _seen(signals, prior, SHOWN).items():
        size = _smallest(effect, shapes)
        visible = size <= LARGEST * prior.span
        reason = "" if visible else _reason(prior.curves)
        shown.append(Visible(effect, size if visible else None, unit, reason))
    return tuple(shown)


def detectabilities(signals: Sequence[Signal], effects: Collection[str]) -> dict[str, float]:
    """How well recordings show each of some `SHOWN` effects of its typical size and median shape,
    over what is needed to name it; without those that their sampling cannot hold."""
    prior = prior_of(signals)
    seen = _seen(signals, prior, effects)
    return {effect: float(np.median(shapes[:, 1])) for effect, shapes in seen.items()}


def _seen(
    signals: Sequence[Signal], prior: PathLaw, effects: Collection[str]
) -> dict[str, np.ndarray]:
    """For the shapes of each effect (S, 2) the size [response unit] at which its columns have it,
    and how well that is seen, over what is needed."""
    low, high = min(s.drive.min() for s in signals), max(s.drive.max() for s in signals)
    slope = prior.span / (high - low)
    ideal = [replace(s, response=slope * (s.drive - low)) for s in signals]
    settled = Settled(prior, float(ROUGHNESSES[0]) * prior.noise, float(FADINGS.max()))
    response = np.concatenate([s.response for s in ideal])
    curve = Curve(
        response, response, np.full(response.size, slope), lambda drive: slope * (drive - low)
    )
    columns = list(_columns(motions_of(signals, curve), effects))
    whitening = prior.whitening
    whitened = whitening(np.concatenate([c.values for c in columns], axis=1))
    gram = whitened.T @ settled.prior.weighted(whitened)
    needed = LEVEL * np.sqrt(1 + UNKNOWN * whitening.count)
    seen: dict[str, list[tuple[float, float]]] = {}
    for column, kind in zip(columns, kinds_of(columns), strict=True):
        own = gram[kind.start : kind.stop, kind.start : kind.stop]
        # Of several columns the combination that is seen best.
        square, mix = (part[..., -1] for part in np.linalg.eigh(own))
        whole = float(np.ptp((column.values @ mix)[whitening.counted]))
        if whole:
            least = np.sqrt(max(float(square), 0.0)) / needed
            seen.setdefault(column.effect, []).append((whole, max(least, 1e-12)))
    return {effect: np.array(seen[effect]) for effect in sorted(seen)}


def _smallest(effect: str, shapes: np.ndarray) -> float:
    """The size [response unit] from which an effect is named, by its shapes (S, 2)."""
    if effect in _OF_SHAPE:
        nearest = np.argsort(np.abs(np.log(shapes[:, 1])))
        shapes = shapes[nearest[:_NEAREST]]
    return float(np.median(shapes[:, 0] / shapes[:, 1]))


def _columns(motions: Sequence[Motion], effects: Collection[str]) -> Iterator[Columns]:
    """A few shapes of each effect, evenly among all that a posterior tries."""
    scale = Scale.of(motions)
    for effect in effects:
        family = MODE if effect == MODE.effect else FAMILIES[effect]
        for shape in _shapes(family, scale):
            yield family.columns(motions, shape, scale)


def _shapes(family: Family, scale: Scale) -> list[Shape]:
    if family is not MODE:
        every = family.shapes(scale)
        chosen = np.linspace(0, len(every) - 1, min(_SHAPES, len(every)))
        return [every[k] for k in np.unique(chosen.astype(int))]
    ends = _LEAST_PERIODS / scale.duration, 0.5 * _HIGHEST / scale.step
    return [
        {"frequency": float(frequency), "damping": damping}
        for damping in MODE_DAMPINGS
        for frequency in np.geomspace(*ends, _SHAPES)
    ]


def _reason(curves: Curves) -> str:
    """Why no credible size of an effect would be seen."""
    if curves.met_again < _AGAIN:
        return "the drive meets every branch of its path once, so that any law could make the same"
    return "the drive meets its path again in the same way, so that a law could make the same"
