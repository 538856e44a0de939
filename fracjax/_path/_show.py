r"""What a recording can show: the smallest effect that would be named, from its drive and noise.

With a response of a typical loop an effect of the size a has along its column d the
detectability a ‖P d‖, P the projection off path curves and fading memory of the largest size, since
the law is not known, tempered by what they do not know.  It is named where the posterior over no
effect and one would name it on the expected recording.  No response is needed.

Source: the local approach, Benveniste, Basseville & Moustakides, IEEE TAC 32 (1987) 583.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ._curves import Curves
from ._dynamics import (
    _LEAST_PERIODS,
    FAMILIES,
    MODE,
    MODE_DAMPINGS,
    Columns,
    Family,
    Scale,
)
from ._expansion import PATH, UNKNOWN, apart, kinds_of, motions_of, prior_of
from ._fading import loop_of
from ._filters import Shape, highest_of
from ._law import FADINGS, ROUGHNESSES, Curve, PathLaw, Settled
from ._motion import Motion
from ._named import levels
from ._posterior import Law
from ._signal import Signal, ends_of

LEVEL = 6.0
"""The detectability by which drives are compared: with its prior odds of .02 and Occam's factor of
a few tens of shapes an effect that nothing looks like has a probability of .95."""
LARGEST = 0.2
"""The largest credible size, over the response's span: what would only be seen beyond is said not
to be seen at any."""
SHOWN = tuple(sorted({MODE.effect, *FAMILIES}))
"""The effects whose smallest visible size a drive determines."""
_OF_SHAPE = {"delay", "drive_lag", "sensor_lag", "slew_rate_limit"}
"""Effects whose size is that of their shape: a lag of a time constant cannot be larger.  A mode may
take any part in the motion."""
_NEAREST = 3
"""Shapes of such an effect that are only just seen, whose median counts."""
_SHAPES = 8
"""Shapes that are tried of each effect, and of modes of each damping: their median is asked for."""
_OPENING = 0.15
"""How far the typical loop opens, over its span: a response in proportion to the drive promises a
fifth less of a lag than a loop needs."""
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
    seen = _seen(signals, prior, SHOWN)
    kinds, starts = seen.law.kinds, [kind.start for kind in seen.law.kinds]
    named = levels(seen.law, seen.directions)
    with np.errstate(invalid="ignore"):
        sizes = np.where(seen.whole > 0, seen.whole / seen.least * named, np.inf)
    # Of several columns the combination that is named first.
    size, least = np.minimum.reduceat(sizes, starts), np.maximum.reduceat(seen.least, starts)
    names = np.array([kind.name for kind in kinds])
    shown = []
    for effect in SHOWN:
        own = (names == effect) & (np.maximum.reduceat(seen.whole, starts) > 0)
        smallest = _smallest(effect, size[own], least[own])
        visible = smallest <= LARGEST * prior.span
        reason = "" if visible else _reason(prior.curves)
        shown.append(Visible(effect, smallest if visible else None, unit, reason))
    return tuple(shown)


def detectabilities(signals: Sequence[Signal], effects: Collection[str]) -> dict[str, float]:
    """How well recordings show each of some `SHOWN` effects of its typical size and median shape,
    over what is needed to name it; without those that their sampling cannot hold."""
    seen = _seen(signals, prior_of(signals), effects)
    shapes: dict[str, list[float]] = {}
    for kind in seen.law.kinds:
        own = slice(kind.start, kind.stop)
        if seen.whole[own].any():
            shapes.setdefault(kind.name, []).append(float(seen.least[own].max()) / LEVEL)
    return {name: float(np.median(shapes[name])) for name in sorted(shapes)}


class _Seen(NamedTuple):
    """Effects' columns under path curves.

    `directions` (K, K) are combinations of the columns of each kind that are seen independently of
    each other; `whole` (K,) is the size of each [response unit] and `least` (K,) its detectability,
    as the law tempers it.
    """

    law: Law
    directions: np.ndarray
    whole: np.ndarray
    least: np.ndarray


def _seen(signals: Sequence[Signal], prior: PathLaw, effects: Collection[str]) -> _Seen:
    """The columns of effects under path curves."""
    low, high = min(s.drive.min() for s in signals), max(s.drive.max() for s in signals)
    slope = prior.span / (high - low)

    def typical(drive: np.ndarray) -> np.ndarray:
        opened = [loop_of(part, high - low) for part in np.split(drive, ends_of(signals))]
        return slope * (drive - low - _OPENING * (high - low) * np.concatenate(opened))

    settled = Settled(prior, float(ROUGHNESSES[0]) * prior.noise, float(FADINGS.max()))
    response = typical(np.concatenate([s.drive for s in signals]))
    curve = Curve(response, response, np.full(response.size, slope), typical)
    columns = list(_columns(motions_of(signals, curve), effects))
    whitening, kinds = prior.whitening, kinds_of(columns)
    matrix = np.concatenate([c.values for c in columns], axis=1)
    inner = settled.prior.inner(whitening(matrix), np.zeros(len(matrix)))
    directions, square = np.zeros((matrix.shape[1],) * 2), np.zeros(matrix.shape[1])
    for kind in kinds:
        own = slice(kind.start, kind.stop)
        square[own], directions[own, own] = np.linalg.eigh(inner.columns[own, own])
    least = np.sqrt(np.maximum(square, 0.0) / (1 + UNKNOWN * whitening.count))
    return _Seen(
        Law(PATH, kinds, inner, float(whitening.count), UNKNOWN, apart()),
        directions,
        np.ptp((matrix @ directions)[whitening.counted], axis=0),
        np.maximum(least, 1e-12),
    )


def _smallest(effect: str, size: np.ndarray, least: np.ndarray) -> float:
    """The size [response unit] from which an effect is named, of its median shape: by the size (S,)
    of each shape from which it is, and by how well its own is seen (S,)."""
    if effect in _OF_SHAPE:
        size = size[np.argsort(np.abs(np.log(least / LEVEL)))[:_NEAREST]]
    return float(np.median(size)) if size.size else np.inf


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
    ends = _LEAST_PERIODS / scale.duration, highest_of(scale.step)
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
