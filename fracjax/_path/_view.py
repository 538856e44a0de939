"""Recordings under path curves: the dynamics that they show whatever their law of hysteresis."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from scipy.signal import find_peaks

from ._curves import Curves
from ._dynamics import MODE, Columns, Motion, dynamics_of, modes_of, pairs_of, refined
from ._kernels import Convolution, lag
from ._law import Curve, Inner, PathLaw, Prior, Settled, Whitening, log_likelihood
from ._posterior import (
    EACH,
    MOST_EFFECTS,
    Hypothesis,
    Kind,
    Law,
    Posterior,
    evidence,
    misfit,
    search,
    select,
)

PATH, BEHIND = "path", "path behind a lag"
"""The names of the law of path curves, and of that of the lagged drive's path."""
MISFIT = 0.1
"""κ - 1 from which path curves do not describe a recording: of recordings that a law with return
points made they leave -.4 to .1, as the level of a noise is uncertain."""
LAG = "drive_lag"
"""The effect that moves the turning points."""
_TRIED = 5
"""Time constants of that lag that are tried about the likeliest, and again about the best."""
UNKNOWN = 0.002
"""What path curves do not know, in variance along any direction over the noise's and a sample: 40
development cases of nine laws had wrong names of probability .95 in 6 at this value, in 7 at .001,
in 10 at .0005 and in 23 at 0, and right ones in 13, 14, 15 and 17."""
FAMILIES = (
    {"sensor_lag", "drive_lag", "delay"},
    {"creep", "viscoelastic_layer"},
    {"gain_drift", "degradation"},
    {"resonance", "second_mode"},
)
"""Effects of which a hypothesis has one at most: together two of them make what neither is, such as
the loop of a rate-independent law from two relaxations of opposite sign."""
_CRUDE, _CLEAR = 5, 1e-4
"""Order of the polynomials of the first, crude curve, and the smallest singular value that counts
in its fit, over the largest."""
_CLOSE = 1.5
"""χ² per sample that free curves leave beside the effects so far up to which columns are made from
them."""
_PAIRED = 3
"""Peaks that are tried as one of two modes, beside the mode that fits best."""
_PEAKS = 6
"""Peaks of a scan for modes that become columns, of each damping."""
_FINER = (1.0, 3.0, 9.0)
"""The curve is fitted anew beside the effects that fit best with it, as often as there are values
here, and their shapes are tried this many times as near to each other."""


@dataclass(frozen=True)
class Signal:
    """What path curves need of a recording: drive (N,) and response (N,), its step [s], whether it
    is of steady cycles, the noise's whitening filter (p+1,), the samples' weights (N,), 0 for one
    that does not count, and the rms error (N,) of the drive."""

    drive: np.ndarray
    response: np.ndarray
    step: float
    periodic: bool
    taps: np.ndarray
    weights: np.ndarray
    drive_error: np.ndarray

    def behind_lag(self, constant: float) -> Signal:
        """The same with its drive behind a lag of first order [s]."""
        drive = Convolution(self.drive, self.step, periodic=self.periodic)
        return replace(self, drive=self.drive + drive.with_departure(lag(constant)))

    def weighted_by(self, slope: np.ndarray) -> Signal:
        """The same with the error of the drive in the noise, through the response's slope (N,)."""
        moved = slope * self.drive_error * abs(self.taps[0])
        return replace(self, weights=self.weights / np.sqrt(1 + moved**2))


@dataclass(frozen=True, eq=False)
class PathView:
    """The posterior over dynamics under path curves.

    Attributes:
        posterior: over sets of effects.
        law: the inner products of the columns.
        columns: the effects' columns.
        whole: (K,) the length of each whitened column, before what the curves can absorb.
        residual: (ΣN,) the response minus curve and effects of the best hypothesis [response unit].
        curves: of the path.
        span: of the responses [response unit].
        effects: (ΣN,) what each effect of the best hypothesis adds [response unit].
        leading: the shapes that fit best, likely or not.
        behind: the time constant of a lag of the drive whose path this is [s], None without.
        first: the view without that lag, where both were compared.
    """

    posterior: Posterior
    law: Law
    columns: list[Columns]
    whole: np.ndarray
    residual: np.ndarray
    curves: Curves
    span: float
    effects: dict[str, np.ndarray]
    leading: tuple[Columns, ...]
    behind: float | None = None
    first: PathView | None = None

    def effects_but(self, names: Collection[str]) -> np.ndarray:
        """What all effects add (ΣN,) but those of some names [response unit]."""
        parts = [part for name, part in self.effects.items() if name not in names]
        return sum(parts, np.zeros_like(self.residual))

    @property
    def base_misfit(self) -> float:
        """κ - 1 without any effect, the excess of χ² per sample."""
        view = self if self.first is None else self.first
        return misfit(view.law, Hypothesis(0.0, 0.0, view.law.name, (), (), ()))

    @property
    def matrix(self) -> np.ndarray:
        """The columns (ΣN, K) of all effects [response unit]."""
        return np.concatenate([c.values for c in self.columns], axis=1)

    def shape_of(self, name: str) -> dict[str, float]:
        """The most likely shape of an effect that the best hypothesis holds."""
        if name == LAG and self.behind is not None:
            return {"time_constant": self.behind}
        best = self.posterior.best
        return self.columns[best.kinds[best.names.index(name)]].shape


def family_of(name: str) -> set[str]:
    """The other effects of an effect's family, if it has one."""
    return {other for family in FAMILIES if name in family for other in family} - {name}


def apart() -> dict[str, set[str]]:
    """For each effect the others of its family."""
    return {name: family_of(name) for family in FAMILIES for name in family}


def view_of(signals: Sequence[Signal]) -> PathView:
    """The posterior over dynamics of recordings of one actuator.

    A lag of the drive moves the turning points themselves.  Where a lag is what is there and leaves
    more than noise, the path of the lagged drive is followed too, and both are compared.
    """
    view = _view_of(signals)
    lags = [h for h in view.posterior.hypotheses[:1] if FAMILIES[0] & {*h.names}]
    if not lags or misfit(view.law, lags[0]) < MISFIT:
        return view
    (own,) = (
        k for k, name in zip(lags[0].kinds, lags[0].names, strict=True) if name in FAMILIES[0]
    )
    other = _behind(signals, _constant_of(view.columns[own].shape), view)
    excess = min(misfit(one.law, one.posterior.best) for one in (view, other))
    own, lagged = (search(one.law, excess).hypotheses for one in (view, other))
    # Another path is another law: whole evidences count, with the freedom of all its branches.
    gain = evidence(other.law, lagged[0]) - evidence(view.law, own[0])
    above = own[0].log_posterior + gain + np.log(EACH / _TRIED) - lagged[0].log_posterior
    lagged = [
        h._replace(names=(*h.names, LAG), log_posterior=float(h.log_posterior + above))
        for h in lagged
        if len(h.names) < MOST_EFFECTS
    ]
    both = Posterior.of([*own, *lagged])
    chosen = other if both.best.law == BEHIND else view
    return replace(chosen, posterior=both, first=view)


def _constant_of(shape: dict[str, float]) -> float:
    """The time constant [s] of a lag of any of the kinds."""
    if "corner" in shape:
        return 1 / (2 * np.pi * shape["corner"])
    return shape.get("time_constant") or shape["delay"]


def _behind(signals: Sequence[Signal], constant: float, view: PathView) -> PathView:
    """The view of the path of the lagged drive, of the time constant of the largest evidence about
    one [s]."""

    def lagged(tau: float) -> list[Signal]:
        return [s.behind_lag(tau) for s in signals]

    def evidence_of(tau: float) -> float:
        parts = lagged(tau)
        settled = prior_of(parts, view.span).settled(response)
        white = settled.law.whitening(response)
        inner = settled.prior.inner(np.zeros((white.size, 0)), white)
        return float(
            log_likelihood(inner.square, inner.log_determinant, settled.law.whitening.count)
        )

    # Beside the effects that are no lag, as far as they are known.
    response = _response_of(signals) - view.effects_but(FAMILIES[0])
    bracket = constant * np.array([0.5, 0.7, 1.0, 1.4, 2.0])
    best = bracket[int(np.argmax([evidence_of(tau) for tau in bracket]))]
    bracket = best * np.array([0.84, 0.92, 1.0, 1.09, 1.19])
    best = float(bracket[int(np.argmax([evidence_of(tau) for tau in bracket]))])
    return replace(_view_of(lagged(best), barred=FAMILIES[0], law_name=BEHIND), behind=best)


def _response_of(signals: Sequence[Signal]) -> np.ndarray:
    """The responses (ΣN,), each minus its first value."""
    return np.concatenate([s.response - s.response[0] for s in signals])


def _view_of(
    signals: Sequence[Signal], barred: Collection[str] = (), law_name: str = PATH
) -> PathView:
    """The posterior over dynamics but for effects that are `barred`."""
    response = _response_of(signals)
    span = max(float(np.ptp(s.response)) for s in signals)
    if any(s.drive_error.any() for s in signals):
        slopes = prior_of(signals, span).settled(response).curve(response).slope
        signals = [
            s.weighted_by(slope)
            for s, slope in zip(signals, np.split(slopes, _ends(signals)), strict=True)
        ]
    prior = prior_of(signals, span)
    whitening = prior.whitening
    nothing = np.zeros_like(response)
    expansion = _about(signals, prior, response, nothing, [], _FINER[0], barred, law_name)
    expansions = [expansion]
    for finer in _FINER:
        # What fits best is what the next columns are made about; what is named is judged at last.
        best = expansion.best
        if not best.names:
            break
        effect = expansion.parts(best).sum(axis=1)
        shapes = [expansion.columns[k] for k in best.kinds]
        expansion = _about(signals, prior, response, effect, shapes, finer, barred, law_name)
        expansions.append(expansion)
    expansion = min(expansions, key=lambda e: misfit(e.law, e.best))
    posterior = select(expansion.law)
    parts, best = expansion.parts(posterior.best), posterior.best
    own = [expansion.columns[k] for k in best.kinds]
    owners = [one.effect for one in own for _ in range(one.values.shape[1])]
    without = response - parts.sum(axis=1)
    return PathView(
        posterior=posterior,
        law=expansion.law,
        columns=expansion.columns,
        whole=np.linalg.norm(whitening(expansion.matrix), axis=0),
        residual=without - expansion.settled.curve(without).values,
        curves=prior.curves,
        span=span,
        effects=dict(_summed(owners, parts)),
        leading=tuple(expansion.columns[k] for k in expansion.best.kinds),
    )


def _crude_curve(signals: Sequence[Signal], prior: PathLaw, response: np.ndarray) -> Curve:
    """A response (ΣN,) by polynomials of the drive and fading memory alone: no curve of many
    branches, which would take up the ringing whose column is made from it."""
    drive = np.concatenate([s.drive for s in signals])
    scaled = 2 * (drive - drive.min()) / np.ptp(drive) - 1
    columns = np.concatenate(
        [chebyshev.chebvander(scaled, _CRUDE), prior.fading, prior.own / prior.span], axis=1
    )
    coefficients = np.linalg.lstsq(columns, response, rcond=_CLEAR)[0]
    values, slope = columns @ coefficients, np.ptp(response) / np.ptp(drive)
    return Curve(values, np.full(drive.size, slope), lambda other: values + slope * (other - drive))


@dataclass(frozen=True, eq=False)
class _Expansion:
    """The columns of all effects about a curve, and their inner products."""

    settled: Settled
    law: Law
    columns: list[Columns]
    matrix: np.ndarray

    @cached_property
    def best(self) -> Hypothesis:
        """What fits best, likely or not: untempered by a misfit."""
        return search(self.law, 0.0).best

    def parts(self, hypothesis: Hypothesis) -> np.ndarray:
        """What each column (ΣN, k) of a hypothesis adds [response unit]."""
        chosen, sizes = hypothesis.columns(self.law.kinds)
        return self.matrix[:, chosen] * _coefficients(self.law.inner, chosen, sizes)


def _about(
    signals: Sequence[Signal],
    prior: PathLaw,
    response: np.ndarray,
    effect: np.ndarray,
    shapes: Sequence[Columns],
    finer: float,
    barred: Collection[str],
    law_name: str,
) -> _Expansion:
    """The columns about the curve of a response (ΣN,) without an effect (ΣN,), some shapes of which
    are tried again, `finer`.

    The curve is the crude one unless that leaves as little as free curves: those of many branches
    take up part of an effect, and columns made from them miss it.
    """
    whitening, without = prior.whitening, response - effect
    settled = prior.settled(without)
    free, crude = settled.curve(without), _crude_curve(signals, prior, without)
    rest, far = whitening(without - free.values), whitening(without - crude.values)
    is_free = float(rest @ rest) < _CLOSE * whitening.count and far @ far > rest @ rest
    motions = motions_of(signals, free if is_free else crude)
    modes = scanned_modes(motions, whitening, settled.prior, whitening(without))
    ringing = [one for one in shapes if one.effect == MODE.effect]
    columns = [
        *dynamics_of(motions),
        *modes,
        *pairs_of(motions, [*ringing, *modes[:: max(1, len(modes) // _PAIRED)]]),
        *refined(motions, shapes, finer),
    ]
    columns = [c for c in columns if c.effect not in barred]
    matrix = np.concatenate([c.values for c in columns], axis=1)
    inner = settled.prior.inner(whitening(matrix), whitening(response))
    law = Law(law_name, kinds_of(columns), inner, float(whitening.count), UNKNOWN, apart())
    return _Expansion(settled, law, columns, matrix)


def _summed(names: Sequence[str], parts: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The sum (ΣN,) of the parts (ΣN, k) of each name."""
    for name in dict.fromkeys(names):
        yield name, parts[:, [k for k, own in enumerate(names) if own == name]].sum(axis=1)


def prior_of(signals: Sequence[Signal], span: float) -> PathLaw:
    """The prior of path curves of recordings whose responses have a span."""
    whitening = Whitening([s.taps for s in signals], [s.weights for s in signals])
    error = max(float(np.median(s.drive_error)) for s in signals)
    return PathLaw.of([s.drive for s in signals], whitening, span, error)


def _ends(signals: Sequence[Signal]) -> np.ndarray:
    """Where one recording ends and the next begins."""
    return np.cumsum([s.drive.size for s in signals])[:-1]


def kinds_of(columns: Sequence[Columns]) -> list[Kind]:
    """The range of each effect's columns in their matrix."""
    kinds, at = [], 0
    for one in columns:
        width = one.values.shape[1]
        kinds.append(Kind(one.effect, at, at + width, one.one_sided))
        at += width
    return kinds


def motions_of(signals: Sequence[Signal], curve: Curve) -> list[Motion]:
    """Each recording's drive with the curve of its response."""
    bounds = [0, *_ends(signals).tolist(), sum(s.drive.size for s in signals)]
    whole = np.concatenate([s.drive for s in signals])
    motions = []
    for signal, first, last in zip(signals, bounds[:-1], bounds[1:], strict=True):

        def moved(drive: np.ndarray, first: int = first, last: int = last) -> np.ndarray:
            other = whole.copy()
            other[first:last] = drive
            return curve.at(other)[first:last]

        values = curve.values[first:last]
        motions.append(Motion(signal.drive, values, moved, signal.step, periodic=signal.periodic))
    return motions


def scanned_modes(
    motions: Sequence[Motion],
    whitened: Callable[[np.ndarray], np.ndarray],
    prior: Prior,
    white: np.ndarray,
) -> list[Columns]:
    """The modes that explain most of a whitened response (ΣN,) beside a prior's own."""
    chosen = []
    for modes in modes_of(motions):
        columns = whitened(np.concatenate([m.values for m in modes], axis=1))
        weighted = prior.weighted(columns)
        along, squares = weighted.T @ white, np.einsum("nk,nk->k", columns, weighted)
        falls = np.where(along > 0, along**2 / np.maximum(squares, 1e-12), 0.0)
        peaks = find_peaks(np.pad(falls, 1))[0] - 1
        chosen += [modes[k] for k in peaks[np.argsort(-falls[peaks])[:_PEAKS]]]
    return chosen


def _coefficients(inner: Inner, chosen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The most probable coefficients (k,) of columns with these prior sizes (k,)."""
    own = inner.columns[chosen][:, chosen]
    return np.linalg.solve(np.diag(sizes**-2) + own, inner.along[chosen])
