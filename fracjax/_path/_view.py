"""Recordings under path curves: the dynamics that they show whatever their law of hysteresis.

Columns propose, chains decide: an effect in series with the path (a lag, a dead time, a mode) is
fitted exactly, of any size, where its columns explain much of what is left; drift, creep and the
like are columns beside.  All chains and all sets of columns have one posterior.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.polynomial import chebyshev
from scipy.signal import find_peaks

from ._chain import IN_SERIES, Chain, Fitted, Line, Stage, adequacy, fitted, without
from ._curves import Curves
from ._dynamics import MODE, SENSOR_ORDERS, Columns, Motion, again, dynamics_of, modes_of, refined
from ._law import Curve, Inner, PathLaw, Prior, Settled
from ._posterior import (
    EACH,
    MOST_EFFECTS,
    Hypothesis,
    Kind,
    Law,
    Posterior,
    misfit,
    search,
    select,
)
from ._signal import Signal, ends_of, response_of, span_of

PATH = "path"
"""The name of the law of path curves."""
MISFIT = 0.1
"""κ - 1 from which path curves do not describe a recording: of recordings that a law with return
points made they leave -.4 to .1, as the level of a noise is uncertain."""
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
_PEAKS = 6
"""Peaks of a scan for modes that become columns, of each damping."""
_FINER = (1.0, 3.0, 9.0)
"""The shapes that fit best are tried again this many times as near to each other."""
_AGAIN = 4
"""How often the columns are made again about the curve without their effects, at most."""
_PART = 0.25
"""The least share of what the best hypothesis explains for an effect to be tried in series."""
_LIKELY, _MOST_LIKELY = 60.0, 3
"""The logarithm of the odds against a chain from which it goes no further, and how many of a round
go further."""
_PARTICIPATION = 0.1
"""The share of a second mode at first."""


@dataclass(frozen=True, eq=False)
class PathView:
    """The posterior over dynamics under path curves.

    Attributes:
        posterior: over sets of effects.
        law: the inner products of the columns behind the likeliest chain.
        laws: those behind every chain, by name.
        columns: the effects' columns.
        whole: (K,) the length of each whitened column, before what the curves can absorb.
        residual: (ΣN,) the response minus curve and effects of the best hypothesis [response unit].
        curves: of the path.
        span: of the responses [response unit].
        effects: (ΣN,) what each effect of the best hypothesis adds [response unit].
        shapes: of the effects of the best hypothesis.
        leading: the effects that fit best, likely or not, with their shapes.
        plain: the view without any chain, by columns alone; None for itself.
    """

    posterior: Posterior
    law: Law
    laws: dict[str, Law]
    columns: list[Columns]
    whole: np.ndarray
    residual: np.ndarray
    curves: Curves
    span: float
    effects: dict[str, np.ndarray]
    shapes: tuple[Stage, ...]
    leading: tuple[Stage, ...]
    plain: PathView | None = None

    @property
    def base_misfit(self) -> float:
        """κ - 1 without any effect, the excess of χ² per sample."""
        return misfit(self.laws[PATH], Hypothesis(0.0, 0.0, PATH, (), (), ()))

    def misfit_of(self, names: Collection[str]) -> float:
        """κ - 1 beside effects, or the best where this set was not tried."""
        own = [h for h in self.posterior.hypotheses if set(h.names) == set(names)]
        best = own[0] if own else self.posterior.best
        return misfit(self.laws[best.law], best)

    @cached_property
    def matrix(self) -> np.ndarray:
        """The columns (ΣN, K) of all effects [response unit]."""
        return np.concatenate([c.values for c in self.columns], axis=1)

    def shape_of(self, name: str) -> dict[str, float]:
        """The most likely shape of an effect that the best hypothesis holds."""
        return next(shape for effect, shape in self.shapes if effect == name)


def family_of(name: str) -> set[str]:
    """The other effects of an effect's family, if it has one."""
    return {other for family in FAMILIES if name in family for other in family} - {name}


def apart() -> dict[str, set[str]]:
    """For each effect the others of its family."""
    return {name: family_of(name) for family in FAMILIES for name in family}


def view_of(signals: Sequence[Signal]) -> PathView:
    """The posterior over dynamics of recordings of one actuator."""
    response = response_of(signals)
    if any(s.drive_error.any() for s in signals):
        slopes = Line.of(signals, ()).prior.settled(response).curve(response).slope
        signals = [
            s.weighted_by(slope)
            for s, slope in zip(signals, np.split(slopes, ends_of(signals)), strict=True)
        ]
    plain = _Expansion.about(Line.of(signals, ()), np.zeros_like(response)).settling()
    found = _expansions(signals, plain)
    posterior, chosen = _joint(found, min(misfit(one.law, one.best) for one in found))
    posterior, chosen = _joint(found, misfit(chosen.law, posterior.best))
    leading = max(found, key=lambda one: one.log_posterior)
    laws = {one.law.name: one.law for one in found}
    own = plain.view(select(plain.law), {PATH: plain.law}, plain)
    return replace(chosen.view(posterior, laws, leading), plain=own)


def _joint(found: Sequence[_Expansion], excess: float) -> tuple[Posterior, _Expansion]:
    """The posterior over all chains and columns, tempered by a misfit κ - 1, and the expansion that
    its best hypothesis is of."""
    posterior = Posterior.of([h for one in found for h in one.hypotheses(excess)])
    return posterior, next(one for one in found if one.law.name == posterior.best.law)


def _expansions(signals: Sequence[Signal], plain: _Expansion) -> list[_Expansion]:
    """The best expansion behind each likely chain, that without any first."""
    found: dict[_Key, _Expansion] = {(): plain}
    tried: set[_Key] = set()
    while True:
        front = max(found.values(), key=lambda one: one.log_posterior)
        chains = [(c, beside) for c, beside in front.proposed() if _key(c) not in tried]
        if not chains:
            break
        tried |= {_key(chain) for chain, _ in chains}
        longer: list[tuple[Fitted, Hypothesis]] = []
        for chain, beside in chains:
            least = max((one.log_posterior for one, _ in longer), default=-np.inf) - _LIKELY
            one = fitted(signals, chain, front.sized(beside), least)
            if one.log_posterior > least:
                longer.append((one, beside))
        longer.sort(key=lambda pair: pair[0].log_posterior + len(pair[1].names) * np.log(EACH))
        best = {_key(one.line.chain): (one, beside) for one, beside in longer}
        for key in list(best)[: -_MOST_LIKELY - 1 : -1]:
            one, beside = best[key]
            if one.log_posterior > longer[-1][0].log_posterior - _LIKELY:
                shapes = [front.columns[k] for k in beside.kinds]
                found[key] = _Expansion.about(one.line, front.added(beside), one, shapes).settling()
    return list(found.values())


_Key = tuple[tuple[str, float], ...]


def _key(chain: Chain) -> _Key:
    """What tells chains apart but for their fitted parameters."""
    return tuple((one.effect, one.shape.get("order", 0.0)) for one in chain)


@dataclass(frozen=True, eq=False)
class _Expansion:
    """The columns of all effects about a curve behind a chain, and their inner products."""

    line: Line
    fitted: Fitted | None
    settled: Settled
    motions: list[Motion]
    law: Law
    columns: list[Columns]
    matrix: np.ndarray

    @classmethod
    def about(
        cls,
        line: Line,
        effect: np.ndarray,
        chain: Fitted | None = None,
        shapes: Sequence[Columns] = (),
    ) -> _Expansion:
        """The columns about the curve of the response without an effect (ΣN,), among them those of
        some shapes.

        The curve is the crude one unless that leaves as little as free curves: those of many
        branches take up part of an effect, and columns made from them miss it.
        """
        prior, response = line.prior, response_of(line.signals)
        whitening, left = prior.whitening, response - effect
        settled = prior.settled(left)
        free, crude = settled.curve(left), _crude_curve(line, left)
        rest, far = whitening(left - free.values), whitening(left - crude.values)
        is_free = float(rest @ rest) < _CLOSE * whitening.count and far @ far > rest @ rest
        motions = motions_of(line.signals, free if is_free else crude)
        barred = {n for one in line.chain for n in (one.effect, *family_of(one.effect))}
        barred -= {MODE.effect}
        columns = [
            *dynamics_of(motions),
            *scanned_modes(motions, whitening, settled.prior, whitening(left)),
            *(again(motions, one) for one in shapes),
        ]
        columns = [c for c in columns if c.effect not in barred]
        matrix = np.concatenate([c.values for c in columns], axis=1)
        inner = settled.prior.inner(whitening(matrix), whitening(response))
        name = ", ".join([PATH, *(f"{e} {o:g}" for e, o in _key(line.chain))])
        law = Law(name, kinds_of(columns), inner, float(whitening.count), UNKNOWN, apart())
        one = cls(line, chain, settled, motions, law, columns, matrix)
        for finer in _FINER:
            one = one._finer(finer)
        return one

    def _finer(self, finer: float) -> _Expansion:
        """The same with the shapes of the best columns tried again, this many times as near to each
        other."""
        shapes = [self.columns[k] for k in self.best.kinds]
        new = refined(self.motions, [c for c in shapes if c.effect not in IN_SERIES], finer)
        if not new:
            return self
        columns = [*self.columns, *new]
        added = np.concatenate([c.values for c in new], axis=1)
        matrix = np.concatenate([self.matrix, added], axis=1)
        whitening, inner = self.line.prior.whitening, self.law.inner
        white, response = whitening(added), whitening(response_of(self.line.signals))
        weighted = self.settled.prior.weighted(white)
        across, own = whitening(self.matrix).T @ weighted, white.T @ weighted
        inner = inner._replace(
            columns=np.block([[inner.columns, across], [across.T, own]]),
            along=np.concatenate([inner.along, weighted.T @ response]),
        )
        law = replace(self.law, kinds=kinds_of(columns), inner=inner)
        return replace(self, law=law, columns=columns, matrix=matrix)

    def settling(self) -> _Expansion:
        """The same about the curve without the columns' effects, until that gains nothing; what
        belongs in series the chains will decide."""
        one = self
        for _ in range(_AGAIN):
            if not one.best.names or set(one.best.names) & set(IN_SERIES):
                break
            shapes = [one.columns[k] for k in one.best.kinds]
            other = _Expansion.about(one.line, one.added(one.best), one.fitted, shapes)
            if other.log_posterior < one.log_posterior + 1:
                break
            one = other
        return one

    @cached_property
    def best(self) -> Hypothesis:
        """What fits best, likely or not: untempered by a misfit."""
        return search(self.law, 0.0).best

    @cached_property
    def log_posterior(self) -> float:
        """Of what fits best, with the chain's own."""
        return max(h.log_posterior for h in self.hypotheses(0.0))

    def hypotheses(self, excess: float) -> Iterator[Hypothesis]:
        """The hypotheses behind the chain, tempered by a misfit κ - 1.  What belongs in series is
        there exactly or not at all."""
        places = [k for k, kind in enumerate(self.law.kinds) if kind.name not in IN_SERIES]
        beside = replace(self.law, kinds=[self.law.kinds[k] for k in places])
        listed = search(beside, excess).hypotheses
        best, share = listed[0], self.law.tempered(excess).count / self.law.count
        chosen, sizes = best.columns(beside.kinds)
        response = response_of(self.line.signals)
        whole = adequacy(self.settled, response, self.matrix[:, chosen] * sizes)
        # Relative to the best columns, beside which the law behind the chain is adequate or not.
        of_chain = share * whole - (best.log_posterior - best.log_prior)
        if self.fitted is not None:
            of_chain += self.fitted.log_prior + self.fitted.volume(share)
        chain = tuple(one.effect for one in self.line.chain)
        for one in listed:
            if len(chain) + len(one.names) <= MOST_EFFECTS:
                yield one._replace(
                    names=(*chain, *one.names),
                    kinds=tuple(places[k] for k in one.kinds),
                    log_posterior=float(one.log_posterior + of_chain),
                )

    def proposed(self) -> Iterator[tuple[Chain, Hypothesis]]:
        """The chain longer by each effect whose columns explain much, and what is beside it."""
        listed = search(self.law, 0.0).hypotheses
        most = listed[0].log_posterior - self.law_alone
        chain = self.line.chain
        beside = _but(listed[0], [n for n in listed[0].names if n in IN_SERIES])
        if len(chain) == MOST_EFFECTS:
            return
        nothing = _but(listed[0], listed[0].names)
        leading = {name: h for h in reversed(listed) for name in h.names if name in IN_SERIES}
        alone = {h.names[0]: h for h in listed if len(h.names) == 1}
        for name in sorted(leading, key=lambda name: -leading[name].log_posterior):
            own, is_second = leading[name], name == MODE.effect and _has_mode(chain)
            enough = own.log_posterior - self.law_alone >= max(_PART * most, 0.0)
            # What two modes leave beside one looks like neither.
            if not enough and not is_second:
                continue
            # What is beside it may be there in its stead.
            for start, companions in {own: beside, alone[name]: nothing}.items():
                shape = self.columns[start.kinds[start.names.index(name)]].shape
                yield from ((c, companions) for c in _longer(chain, Stage(name, shape)))

    @cached_property
    def law_alone(self) -> float:
        """The log posterior of no column."""
        return next(h.log_posterior for h in search(self.law, 0.0).hypotheses if not h.names)

    def sized(self, hypothesis: Hypothesis) -> np.ndarray:
        """The columns (ΣN, k) of a hypothesis, of unit prior standard deviation."""
        chosen, sizes = hypothesis.columns(self.law.kinds)
        return self.matrix[:, chosen] * sizes

    def parts(self, hypothesis: Hypothesis) -> np.ndarray:
        """What each column (ΣN, k) of a hypothesis adds [response unit]."""
        chosen, sizes = hypothesis.columns(self.law.kinds)
        return self.matrix[:, chosen] * _coefficients(self.law.inner, chosen, sizes)

    def added(self, hypothesis: Hypothesis) -> np.ndarray:
        """What a hypothesis adds (ΣN,) [response unit]."""
        return self.parts(hypothesis).sum(axis=1)

    def view(self, posterior: Posterior, laws: dict[str, Law], leading: _Expansion) -> PathView:
        """The view of a posterior whose best hypothesis is about this curve."""
        best, response = posterior.best, response_of(self.line.signals)
        parts = self.parts(best)
        own = [self.columns[k] for k in best.kinds]
        owners = [one.effect for one in own for _ in range(one.values.shape[1])]
        left = response - parts.sum(axis=1)
        values = self.settled.curve(left).values
        effects = dict(_summed(owners, parts))
        for k, one in enumerate(self.line.chain):
            effects[one.effect] = values - without(self.line, self.settled, left, k)
        shapes = [Stage(c.effect, c.shape) for c in own]
        of_leading = [leading.columns[k] for k in leading.best.kinds]
        return PathView(
            posterior=posterior,
            law=self.law,
            laws=laws,
            columns=self.columns,
            whole=np.linalg.norm(self.line.prior.whitening(self.matrix), axis=0),
            residual=left - values,
            curves=self.line.prior.curves,
            span=span_of(self.line.signals),
            effects=effects,
            shapes=(*self.line.chain, *shapes),
            leading=(*leading.line.chain, *(Stage(c.effect, c.shape) for c in of_leading)),
        )


def _but(hypothesis: Hypothesis, names: Collection[str]) -> Hypothesis:
    """A hypothesis without some of its effects."""
    kept = [k for k, name in enumerate(hypothesis.names) if name not in names]
    return hypothesis._replace(
        names=tuple(hypothesis.names[k] for k in kept),
        kinds=tuple(hypothesis.kinds[k] for k in kept),
        sizes=tuple(hypothesis.sizes[k] for k in kept),
    )


def _has_mode(chain: Chain) -> bool:
    return any(one.effect == MODE.effect for one in chain)


def _longer(chain: Chain, stage: Stage) -> Iterator[Chain]:
    """A chain with a further stage, of each of its orders; beside a mode a further one makes two in
    parallel."""
    modes = [k for k, one in enumerate(chain) if one.effect == MODE.effect]
    if stage.effect == MODE.effect and modes:
        first, second = sorted(
            [chain[modes[0]].shape, stage.shape], key=lambda shape: shape["frequency"]
        )
        both = {
            "frequency": first["frequency"],
            "damping": first["damping"],
            "ratio": second["frequency"] / first["frequency"],
            "second_damping": second["damping"],
            "participation": _PARTICIPATION if second is stage.shape else 1 - _PARTICIPATION,
        }
        yield (*chain[: modes[0]], Stage("second_mode", both), *chain[modes[0] + 1 :])
    elif "order" in stage.shape:
        for order in SENSOR_ORDERS:
            yield (*chain, Stage(stage.effect, stage.shape | {"order": order}))
    elif stage.effect not in {one.effect for one in chain}:
        yield (*chain, stage)


def _crude_curve(line: Line, response: np.ndarray) -> Curve:
    """A response (ΣN,) by polynomials of the drive and fading memory alone: no curve of many
    branches, which would take up the ringing whose column is made from it."""
    prior, drive = line.prior, np.concatenate([s.drive for s in line.signals])
    scaled = 2 * (drive - drive.min()) / np.ptp(drive) - 1
    columns = np.concatenate(
        [
            prior.filtered(np.concatenate([chebyshev.chebvander(scaled, _CRUDE), prior.fading], 1)),
            prior.own / prior.span,
        ],
        axis=1,
    )
    coefficients = np.linalg.lstsq(columns, response, rcond=_CLEAR)[0]
    values, slope = columns @ coefficients, np.ptp(response) / np.ptp(drive)
    return Curve(
        values,
        np.full(drive.size, slope),
        lambda other: values + prior.filtered(slope * (other - drive)),
    )


def _summed(names: Sequence[str], parts: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The sum (ΣN,) of the parts (ΣN, k) of each name."""
    for name in dict.fromkeys(names):
        yield name, parts[:, [k for k, own in enumerate(names) if own == name]].sum(axis=1)


def prior_of(signals: Sequence[Signal]) -> PathLaw:
    """The prior of path curves of recordings."""
    return Line.of(signals, ()).prior


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
    bounds = [0, *ends_of(signals).tolist(), sum(s.drive.size for s in signals)]
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
    scanned, chosen = prior.weighted(white), []
    for modes in modes_of(motions):
        # Exact are the peaks alone: what the curves absorb hardly depends on the frequency.
        columns = whitened(np.concatenate([m.values for m in modes], axis=1))
        along, squares = columns.T @ scanned, np.einsum("nk,nk->k", columns, columns)
        falls = np.where(along > 0, along**2 / np.maximum(squares, 1e-12), 0.0)
        peaks = find_peaks(np.pad(falls, 1))[0] - 1
        chosen += [modes[k] for k in peaks[np.argsort(-falls[peaks])[:_PEAKS]]]
    return chosen


def _coefficients(inner: Inner, chosen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The most probable coefficients (k,) of columns with these prior sizes (k,)."""
    own = inner.columns[chosen][:, chosen]
    return np.linalg.solve(np.diag(sizes**-2) + own, inner.along[chosen])
