r"""Effects of any size in series with the path, each exact and with its parameters fitted.

Behind a chain of effects the response is that of the path of a drive that a lag, a dead time or a
limited rate has changed, filtered by sensors and modes.  Under path curves it stays linear in all
that is not known of the law, so that the evidence of a chain is exact; its parameters are found by
Newton's method, from the columns of their changes.

Source: MacKay, Neural Comput. 4 (1992) 415 (evidence by Laplace's method); Nocedal & Wright,
Numerical Optimization (2006), chapter 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from . import _kernels as kernels
from ._drive import delayed, limited
from ._filters import (
    RESPONSE_SIDE,
    Filter,
    Shape,
    corner_of,
    filters_of,
    time_constant_of,
)
from ._law import PathLaw, Settled
from ._posterior import EACH
from ._prior import Inner, log_likelihood
from ._signal import Signal, response_of, span_of
from ._whitening import Whitening

DRIVE_SIDE = ("drive_lag", "delay", "slew_rate_limit")
"""The effects that change the drive before its path."""
IN_SERIES = (*DRIVE_SIDE, *RESPONSE_SIDE)
"""The effects of a chain."""
FIXED = ("order",)
"""Parameters that are not fitted."""
_CHANGE = 0.01
"""The change of a parameter's logarithm from which its column is made."""
_FARTHEST = 0.7
"""The largest change of a parameter's logarithm in a step of Newton's method."""
_STEPS, _SMALL = 12, 0.05
"""Newton's steps at most, and the gain of evidence below which another is not worth it."""
_HALVINGS = 4
_HOPEFUL = 10.0
"""How much more than the columns predict a chain may gain at most."""
_DAMPINGS = 2.3
"""The range of the logarithm of a damping ratio about .03: from .003 to .3."""


class Stage(NamedTuple):
    """An effect of a chain, with the parameters of its shape, in s and Hz."""

    effect: str
    shape: Shape

    @property
    def free(self) -> list[str]:
        """The names of the parameters that are fitted."""
        return [name for name in self.shape if name not in FIXED]

    def changed(self, name: str, by: float) -> Stage:
        """The same with a parameter changed by this, in its logarithm unless it may be negative."""
        value = self.shape[name]
        other = value + by if name == _SIGNED else value * np.exp(by)
        if name in _DAMPED:
            other = np.clip(other, *_DAMPING)
        return Stage(self.effect, self.shape | {name: float(other)})


def lags_like(effect: str, shape: Shape) -> list[Stage]:
    """The other effects that are as late as a lag or a dead time of a shape, if it is one."""
    lates = {
        "sensor_lag": lambda s: s["order"] * time_constant_of(s["corner"], s["order"]),
        "drive_lag": lambda s: s["time_constant"],
        "delay": lambda s: s["delay"],
    }
    if effect not in lates:
        return []
    late = lates[effect](shape)
    every = [
        Stage("sensor_lag", {"corner": corner_of(late, 1.0), "order": 1.0}),
        Stage("drive_lag", {"time_constant": late}),
        Stage("delay", {"delay": late}),
    ]
    return [one for one in every if one.effect != effect]


_SIGNED = "participation"
_DAMPED, _DAMPING = ("damping", "second_damping"), (1e-3, 0.9)
Chain = tuple[Stage, ...]


@dataclass(frozen=True, eq=False)
class Line:
    """Path curves behind a chain: the recordings with the drives behind it, the drives
    themselves, and the prior."""

    chain: Chain
    signals: Sequence[Signal]
    undriven: Sequence[np.ndarray]
    prior: PathLaw

    @classmethod
    def of(cls, signals: Sequence[Signal], chain: Chain, like: Line | None = None) -> Line:
        """Recordings behind a chain; `like` is that of another chain, whose curves are the same
        where the effects on the drive are."""
        if like is not None and _before(chain) == _before(like.chain):
            filtered = _filter(like.signals, chain)
            return cls(chain, like.signals, like.undriven, replace(like.prior, filter=filtered))
        driven = [replace(s, drive=_driven(s, chain)) for s in signals]
        whitening = Whitening([s.taps for s in signals], [s.weights for s in signals])
        error = max(float(np.median(s.drive_error)) for s in signals)
        drives = [s.drive for s in driven]
        prior = PathLaw.of(drives, whitening, span_of(signals), error, _filter(driven, chain))
        return cls(chain, driven, [s.drive for s in signals], prior)


def _before(chain: Chain) -> Chain:
    """The stages of a chain that change the drive."""
    return tuple(one for one in chain if one.effect in DRIVE_SIDE)


def _filter(signals: Sequence[Signal], chain: Chain) -> Filter | None:
    """What is between the path of driven signals and the response, if anything."""
    after = [one for one in chain if one.effect in RESPONSE_SIDE]
    if not after:
        return None
    departures = [[f for one in after for f in filters_of(*one, s.step)] for s in signals]
    return Filter([s.drive.size for s in signals], departures, [s.periodic for s in signals])


def _driven(signal: Signal, chain: Chain) -> np.ndarray:
    """The drive (N,) behind the effects of a chain that change it."""
    drive = signal.drive
    for effect, shape in chain:
        if effect == "delay":
            drive = delayed(drive, shape["delay"] / signal.step, periodic=signal.periodic)
        elif effect == "drive_lag":
            lag = kernels.lag(shape["time_constant"], signal.step)
            convolution = kernels.Convolution(drive, signal.step, periodic=signal.periodic)
            drive = drive + convolution.with_departure(lag)
        elif effect == "slew_rate_limit":
            drive = limited(drive, shape["rate"] * signal.step)
    return drive


@dataclass(frozen=True, eq=False)
class Fitted:
    """A chain with its most likely parameters.

    Attributes:
        line: behind the chain.
        log_likelihood: with the effects beside it, at these parameters.
        curvature: (k, k) of the log likelihood in the parameters' logarithms.
        ranges: (k,) of the parameters' logarithms before the recording.
    """

    line: Line
    log_likelihood: float
    curvature: np.ndarray
    ranges: np.ndarray

    @property
    def log_posterior(self) -> float:
        """With the prior of its effects, and the share of that of its parameters that is likely."""
        return self.log_likelihood + self.log_prior + self.volume(1.0)

    @property
    def log_prior(self) -> float:
        """Of the chain's effects.  Two modes are one of them: what has one mode has further ones,
        and that another is seen, too, is no second coincidence."""
        return len(self.line.chain) * float(np.log(EACH))

    def volume(self, share: float) -> float:
        """The logarithm of the share of the parameters' prior that is likely, if only this share
        of the likelihood counts."""
        matrix = self.curvature * share + np.diag(self.ranges**-2.0)
        return float(-np.log(self.ranges).sum() - 0.5 * np.linalg.slogdet(matrix)[1])


def fitted(
    signals: Sequence[Signal],
    starts: Sequence[Chain],
    beside: np.ndarray,
    like: Settled,
    least: float = -np.inf,
) -> Fitted:
    """A chain with its most likely parameters, from the likeliest of its starts, beside columns
    (ΣN, k) of other effects, of unit prior standard deviation [response unit], with the roughness
    and the fading of another law; one that is not to reach the `least` log likelihood goes no
    further."""
    response, ranges = response_of(signals), _ranges(signals, starts[0])
    free = [(k, name) for k, one in enumerate(starts[0]) for name in one.free]

    def at(chain: Chain, near: Line | None = None) -> tuple[float, Line, Settled]:
        line = Line.of(signals, chain, near)
        settled = Settled(line.prior, like.roughness, like.fading)
        return adequacy(settled, response, beside), line, settled

    best, line, settled = max((at(chain) for chain in starts), key=lambda one: one[0])
    curvature = np.zeros((len(free), len(free)))
    for _ in range(_STEPS):
        columns, spent = _changes(signals, settled, line, beside, free)
        curvature, gradient = _quadratic(settled, response, beside, columns, spent)
        step = np.linalg.solve(curvature + np.diag(ranges**-2.0), gradient)
        if best + _HOPEFUL * float(gradient @ step) < least:
            break
        step = np.clip(step, -_FARTHEST, _FARTHEST)
        for _ in range(_HALVINGS):
            value, other, further = at(_stepped(line.chain, free, step), line)
            if value > best:
                break
            step = 0.5 * step
        else:
            break
        gain, best, line, settled = value - best, value, other, further
        if gain < _SMALL:
            break
    return Fitted(line, best, curvature, ranges)


Free = list[tuple[int, str]]
"""The place in a chain and the name of each parameter that is fitted."""


def _stepped(chain: Chain, free: Free, step: np.ndarray) -> Chain:
    """A chain with its parameters changed."""
    stages = list(chain)
    for (k, name), by in zip(free, step, strict=True):
        stages[k] = stages[k].changed(name, float(by))
    return tuple(stages)


def adequacy(settled: Settled, response: np.ndarray, beside: np.ndarray) -> float:
    """The log likelihood of a response (ΣN,) beside columns (ΣN, k), were curves spent as noise.

    An adequate law leaves as much of χ² as the samples are more than the coefficients that it
    spends.  How smooth or cheap its curves are does not count, as no law of them is known: a lag
    may make any loop smoother, and with the determinant of the evidence did so on drives of which
    it was no part.
    """
    inner = _inner_beside(settled, response, beside, beside[:, :0])
    if inner.square < 0:  # a filter so slow that no digit is left
        return -np.inf
    count = settled.law.whitening.count
    return float(log_likelihood(inner.square + settled.freedom, 0.0, count))


def _inner_beside(
    settled: Settled, response: np.ndarray, beside: np.ndarray, columns: np.ndarray
) -> Inner:
    """Inner products of columns (ΣN, K) and of a response (ΣN,) with columns `beside` (ΣN, k) in
    the covariance."""
    whitening, others = settled.law.whitening, beside.shape[1]
    whole = whitening(np.column_stack([beside, columns]))
    inner = settled.prior.inner(whole, whitening(response))
    inner = inner.given(np.arange(others), np.ones(others))
    return inner._replace(columns=inner.columns[others:, others:], along=inner.along[others:])


def _quadratic(
    settled: Settled,
    response: np.ndarray,
    beside: np.ndarray,
    columns: np.ndarray,
    spent: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The curvature (k, k) of the log likelihood, negative, and its gradient (k,) along columns
    that change the law's freedom by what is `spent` (k,)."""
    inner = _inner_beside(settled, response, beside, columns)
    excess = max(1.0, (inner.square + settled.freedom) / settled.law.whitening.count)
    return inner.columns / excess, (inner.along - 0.5 * spent) / excess


def _changes(
    signals: Sequence[Signal], settled: Settled, line: Line, beside: np.ndarray, free: Free
) -> tuple[np.ndarray, np.ndarray]:
    """What a change of each parameter's logarithm adds to the response (ΣN, k), and to the law's
    freedom (k,)."""
    response, whitening = response_of(signals), settled.law.whitening
    inner = settled.prior.inner(whitening(beside), whitening(response))
    every = np.arange(beside.shape[1])
    rest = whitening(response - beside @ inner.coefficients(every, np.ones(every.size)))
    # What the covariance gains is what curves gain behind the probes of the freedom.
    probes, taken = settled.probed
    path = settled.behind(np.column_stack([rest, probes]))
    now, columns, spent = path.through(line.prior), [], []
    for k, name in free:
        stage = line.chain[k].changed(name, _CHANGE)
        changed = Line.of(signals, (*line.chain[:k], stage, *line.chain[k + 1 :]), line)
        moved = (path.through(changed.prior) - now) / _CHANGE
        columns.append(moved[:, 0])
        gained = (probes - taken) * whitening(moved[:, 1:])
        spent.append(2 * float(gained.sum()) / probes.shape[1])
    return np.column_stack(columns), np.array(spent)


def _ranges(signals: Sequence[Signal], chain: Chain) -> np.ndarray:
    """How far the logarithm of each fitted parameter may be from its middle, before the
    recordings."""
    steps, duration = [s.step for s in signals], max(s.step * s.drive.size for s in signals)
    times = float(np.log(duration / min(steps)))
    ranges = {"damping": _DAMPINGS, "second_damping": _DAMPINGS, "participation": 1.0, "ratio": 1.0}
    return np.array([ranges.get(name, times) for one in chain for name in one.free])


def without(line: Line, settled: Settled, response: np.ndarray, k: int) -> np.ndarray:
    """What the most probable path behind a response (ΣN,) would give (ΣN,) without the k-th
    stage."""
    plain = [replace(s, drive=d) for s, d in zip(line.signals, line.undriven, strict=True)]
    other = Line.of(plain, (*line.chain[:k], *line.chain[k + 1 :]))
    return settled.path(response).through(other.prior)
