"""What each effect of dynamics would add to a response, whatever the law of its hysteresis.

The response without them is given, as the curve that was fitted to it; an effect on the drive's
side moves along that curve.  No model is fitted and nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from . import _kernels as kernels
from ._drive import limited
from ._filters import Shape, corner_of, highest_of, time_constant_of
from ._motion import Motion

MODE_DAMPINGS = (0.01, 0.03, 0.1)
"""Damping ratios of modes; frequencies are tried half the width of a peak apart."""
_LEAST_PERIODS = 10.0
"""The fewest periods of the slowest mode that the recordings hold: a slower one is a lag."""
_MAINS, _HARMONICS = (50.0, 60.0), 5
"""Frequencies of the mains [Hz], and how many of their harmonics."""
_OFF = 0.002
"""How far the mains' frequency may be from its nominal value, relative: the band of normal
operation of the grids of Europe and of America."""
_LIMITS = (0.97, 0.9, 0.8, 0.7, 0.6, 0.5, 0.42, 0.35, 0.28, 0.22)
"""Limits of a rate, over the drive's largest: a fit goes no farther than to the next kink."""
SENSOR_ORDERS = (1.0, 2.0, 4.0)
"""Orders of sensors that are tried; one of third order is within percents of its neighbours."""
_SLOWEST_SENSOR = 1.5
"""The largest time constant of a sensor [s], of a corner of .1 Hz: slower is the drive's side."""
_UNEVEN = 0.5
"""How uneven a spectrum of relaxations is, over its mean; chosen by judgement."""
_DRIFT, _CREEP, _LAYER, _HUM, _SKEW = 0.05, 0.02, 0.05, 0.002, 1e-4
"""Typical sizes: drifts over the span or the gain, creep per decade, a layer's share, interference
over the span, a clock's error; what a prior calls 1."""


class Columns(NamedTuple):
    """One shape of an effect.

    Attributes:
        effect: its name in the catalogue.
        shape: the parameters of the shape, by name, in s and Hz.
        values: (ΣN, k), in the response's unit, for the typical size.
        one_sided: whether its coefficient cannot be negative.
    """

    effect: str
    shape: dict[str, float]
    values: np.ndarray
    one_sided: bool


class Scale(NamedTuple):
    """The magnitudes of recordings that shapes depend on: the shortest step and the longest
    duration [s], the response's span, the longest path in strokes, and the drive's largest change
    in a step."""

    step: float
    duration: float
    span: float
    strokes: float
    jump: float

    @classmethod
    def of(cls, motions: Sequence[Motion]) -> Scale:
        """The magnitudes of recordings."""
        return cls(
            min(m.step for m in motions),
            max(float(m.times[-1]) for m in motions),
            max(float(np.ptp(m.response)) for m in motions),
            max(float(m.path[-1]) for m in motions),
            max(float(np.abs(np.diff(m.drive)).max()) for m in motions),
        )


class Family(NamedTuple):
    """All shapes of an effect.

    Attributes:
        effect: its name in the catalogue.
        shapes: the shapes that are tried.
        column: what a shape adds to a recording (N,) or (N, k).
        one_sided: whether its coefficient cannot be negative.
        spacing: the logarithm of the ratio of a parameter to that of the next shape.
        each: whether every recording has coefficients of its own, such as a phase.
    """

    effect: str
    shapes: Callable[[Scale], list[Shape]]
    column: Callable[[Motion, Shape, Scale], np.ndarray]
    one_sided: bool
    spacing: Callable[[Shape, Scale], Shape]
    each: bool = False

    def columns(self, motions: Sequence[Motion], shape: Shape, scale: Scale) -> Columns:
        """The columns of one shape."""
        parts = [self.column(m, shape, scale).reshape(m.times.size, -1) for m in motions]
        values = np.asarray(block_diag(*parts)) if self.each else np.concatenate(parts)
        return Columns(self.effect, shape, values, self.one_sided and values.shape[1] == 1)


def dynamics_of(motions: Sequence[Motion]) -> list[Columns]:
    """The shapes of all effects but modes and lines, whose frequencies are scanned."""
    return [c for name in FAMILIES if name != MAINS for c in columns_of(name, motions)]


def columns_of(name: str, motions: Sequence[Motion]) -> list[Columns]:
    """All shapes of an effect."""
    family, scale = FAMILIES[name], Scale.of(motions)
    return [family.columns(motions, shape, scale) for shape in family.shapes(scale)]


def modes_of(motions: Sequence[Motion], family: Family) -> Iterator[list[Columns]]:
    """Modes at frequencies that are half the width of a peak apart, the list of each damping."""
    scale = Scale.of(motions)
    lowest, highest = _LEAST_PERIODS / scale.duration, highest_of(scale.step)
    for damping in MODE_DAMPINGS:
        count = 1 + int(np.log(highest / lowest) / damping)
        yield [
            family.columns(motions, {"frequency": float(f), "damping": damping}, scale)
            for f in np.geomspace(lowest, highest, count)
        ]


def refined(motions: Sequence[Motion], chosen: Sequence[Columns], finer: float) -> list[Columns]:
    """Shapes about chosen ones, this many times as near to each other."""
    scale, columns = Scale.of(motions), []
    for one in chosen:
        family = MODE if one.effect == MODE.effect else FAMILIES[one.effect]
        shapes, tried = [one.shape], family.shapes(scale)
        for name, spacing in family.spacing(one.shape, scale).items():
            for step in (-1.0, -0.5, 0.5, 1.0):
                value = one.shape[name] * float(np.exp(step * spacing / finer))
                if tried:
                    # Beyond what is tried an effect is another: creep without onset is a gain.
                    value = np.clip(value, *_ends_of(tried, name))
                shapes.append(one.shape | {name: float(value)})
        columns += [family.columns(motions, shape, scale) for shape in shapes]
    return columns


def _ends_of(shapes: Sequence[Shape], name: str) -> tuple[float, float]:
    """The least and the largest value of a parameter."""
    values = [shape[name] for shape in shapes if name in shape]
    return min(values), max(values)


def again(motions: Sequence[Motion], one: Columns) -> Columns:
    """The columns of the same shape about other motions."""
    family = MODE if one.effect == MODE.effect else FAMILIES[one.effect]
    return family.columns(motions, one.shape, Scale.of(motions))


def _constants(scale: Scale) -> np.ndarray:
    """Time constants of lags [s], four a decade, from a tenth of a step to a third of the longest
    recording."""
    ends = 0.1 * scale.step, scale.duration / 3
    return np.geomspace(*ends, 1 + int(4 * np.log10(ends[1] / ends[0])))


def _each_of(name: str, values: Callable[[Scale], Iterable[float]]):
    """Shapes of one parameter."""
    return lambda scale: [{name: float(value)} for value in values(scale)]


def _apart(**ratios: float) -> Callable[[Shape, Scale], Shape]:
    """The distances of shapes, by the ratio of each parameter to the next."""
    return lambda shape, scale: {
        name: float(np.log(ratio)) for name, ratio in ratios.items() if name in shape
    }


def _onsets(scale: Scale) -> np.ndarray:
    first = max(scale.step, 1e-4 * scale.duration)
    return np.geomspace(first, 0.1 * scale.duration, 5)


def _corners(scale: Scale) -> list[Shape]:
    """Sensors of the first orders, whose columns are like those of higher ones."""
    constants = [c for c in _constants(scale) if c < _SLOWEST_SENSOR]
    return [{"corner": corner_of(c, n), "order": n} for n in SENSOR_ORDERS[:2] for c in constants]


def _frequencies(scale: Scale) -> list[float]:
    """The mains', a quarter of the width of a line apart."""
    return [
        f
        for low in _MAINS
        if 2 * low * scale.step < 1
        for f in low * np.linspace(1 - _OFF, 1 + _OFF, 1 + 2 * int(4 * _OFF * low * scale.duration))
    ]


def _lagging(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    constant = time_constant_of(shape["corner"], shape["order"])
    return m.of_response.with_departure(kernels.lag(constant, m.step, int(shape["order"])))


def _lagging_before(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    lag = kernels.lag(shape["time_constant"], m.step)
    return m.moved(m.drive + m.of_drive.with_departure(lag)) - m.moved(m.drive)


def _late(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    return m.of_response.with_departure(kernels.delay(shape["delay"]))


def _spectra(scale: Scale) -> list[Shape]:
    """Relaxations from a time constant on, each ten times as slow as the one before."""
    return [{"fastest": float(onset)} for onset in _onsets(scale)[::2]]


def _relaxing(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """Relaxations of a decade each, all alike, and how each differs: creep of Kelvin and Voigt's
    elements, or a layer of Maxwell's, which a few time constants do not tell apart."""
    constants = shape["fastest"] * 10 ** np.arange(np.log10(scale.duration / shape["fastest"]))
    lags = [m.of_response.with_departure(kernels.lag(float(c), m.step)) for c in constants]
    each = _CREEP * np.stack(lags, axis=1)
    return np.column_stack([each.sum(axis=1), _UNEVEN * each])


def _creeping(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    if "fastest" in shape:
        return _relaxing(m, shape, scale)
    return _CREEP * m.of_response.with_departure(kernels.creep(shape["onset"]))


def _yielding(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    if "fastest" in shape:
        return _relaxing(m, shape, scale)
    departure = kernels.yielding(shape["time_constant"], shape["order"])
    return _LAYER * m.of_response.with_departure(departure)


def _ringing(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    mode = kernels.mode(shape["frequency"], shape["damping"], m.step)
    return m.of_response.with_departure(mode)


def beside_mode(first: Shape) -> Family:
    """Modes in parallel to a first one: what a share of each adds that the first one has less."""

    def column(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
        return _ringing(m, shape, scale) - _ringing(m, first, scale)

    return MODE._replace(column=column)


def _drifting(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """A line and an exponential of time."""
    decay = 1 - np.exp(-m.times / shape["time_constant"])
    return _DRIFT * scale.span * np.stack([m.times / scale.duration, decay], axis=1)


def _warmed(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """A gain that changes with the warmth of the losses, and the unknown zero times it."""
    warmth = m.warming(shape["time_constant"], shape["losses"])
    moved = m.response - m.response[0]
    return _DRIFT * np.stack([moved * warmth, scale.span * warmth], axis=1)


def _worn(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """What changes with the path travelled, whatever function of the path it is: a gain, a curve,
    openings of a loop and of plays."""
    wear = -np.expm1(-m.path / shape["path"])
    moved = m.response - m.response[0]
    shapes = np.column_stack([moved, m.opening, scale.span * m.of_path])
    return _DRIFT * wear[:, None] * shapes


def _humming(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """Lines of the mains below Nyquist's frequency."""
    low = shape["frequency"]
    orders = [k for k in range(1, _HARMONICS + 1) if 2 * k * low * m.step < 1]
    angles = 2 * np.pi * low * np.outer(m.times, orders)
    return _HUM * scale.span * np.concatenate([np.cos(angles), np.sin(angles)], axis=1)


def _limited(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """A drive whose rate is limited."""
    return m.moved(limited(m.drive, shape["rate"] * m.step)) - m.moved(m.drive)


def _skewed(m: Motion, shape: Shape, scale: Scale) -> np.ndarray:
    """A clock that runs too fast: a delay that grows in time."""
    return _SKEW * m.times * np.gradient(m.response, m.step)


def _lines_apart(shape: Shape, scale: Scale) -> Shape:
    return {"frequency": 0.25 / (scale.duration * shape["frequency"])}


def _peaks_apart(shape: Shape, scale: Scale) -> Shape:
    return {"frequency": shape["damping"], "damping": float(np.log(3))}


_QUARTER = 10**0.25
_SHARES = (0.1, 0.3, 1.0)
_LATE = 30
"""The longest delay, in steps: a longer one is a clock's, or two files'."""

MAINS = "mains_interference"
MODE = Family("resonance", lambda scale: [], _ringing, True, _peaks_apart)
"""A mode, whose shapes are scanned."""
FAMILIES: dict[str, Family] = {
    family.effect: family
    for family in (
        Family(
            "creep",
            lambda s: [*({"onset": float(onset)} for onset in _onsets(s)), *_spectra(s)],
            _creeping,
            True,
            _apart(onset=5.6, fastest=10.0),
        ),
        Family("sensor_lag", _corners, _lagging, True, _apart(corner=_QUARTER)),
        Family(
            "drive_lag",
            _each_of("time_constant", _constants),
            _lagging_before,
            True,
            _apart(time_constant=_QUARTER),
        ),
        Family(
            "delay",
            _each_of("delay", lambda s: [c for c in _constants(s) if c < _LATE * s.step]),
            _late,
            True,
            _apart(delay=_QUARTER),
        ),
        Family(
            "viscoelastic_layer",
            lambda s: [
                *(
                    {"time_constant": float(c), "order": order}
                    for order in (0.15, 0.35, 0.7)
                    for c in np.geomspace(s.step, s.duration, 4)
                ),
                *_spectra(s),
            ],
            _yielding,
            False,
            _apart(time_constant=10.0, order=2.0, fastest=10.0),
        ),
        Family(
            "thermal_drift",
            _each_of("time_constant", lambda s: [share * s.duration for share in _SHARES]),
            _drifting,
            False,
            _apart(time_constant=3.0),
            each=True,
        ),
        Family(
            "gain_drift",
            lambda s: [
                {"time_constant": share * s.duration, "losses": losses}
                for share in _SHARES
                for losses in (1.0, 2.0)
            ],
            _warmed,
            False,
            _apart(time_constant=3.0),
        ),
        Family(
            "degradation",
            _each_of("path", lambda s: [share * s.strokes for share in _SHARES]),
            _worn,
            False,
            _apart(path=3.0),
        ),
        Family(
            MAINS,
            _each_of("frequency", _frequencies),
            _humming,
            False,
            _lines_apart,
            each=True,
        ),
        Family(
            "slew_rate_limit",
            _each_of("rate", lambda s: [q * s.jump / s.step for q in _LIMITS]),
            _limited,
            True,
            _apart(rate=1.2),
        ),
        Family("clock_skew", lambda scale: [{}], _skewed, False, _apart()),
    )
}
