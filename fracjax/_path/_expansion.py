"""Columns of every effect about the curve of a response behind a chain, and what they propose."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from ._chain import IN_SERIES, Chain, Fitted, Line, Stage, adequacy, lags_like
from ._dynamics import MODE, SENSOR_ORDERS, Columns, again, dynamics_of, refined
from ._filters import Shape
from ._law import Curve, PathLaw, Settled
from ._motion import Motion
from ._posterior import MOST_EFFECTS, Hypothesis, Kind, Law, search
from ._scans import TWO_MODES, lone_mode, modes_behind, scanned_lines
from ._signal import Signal, ends_of, response_of

PATH = "path"
"""The name of the law of path curves."""
UNKNOWN = 0.002
"""What path curves do not know, in variance along any direction over the noise's and a sample: 104
development cases of thirteen laws had wrong names in 12 at this value, in 15 at .001, in 24 at
.0005 and in 35 at .0002, and 64, 65, 67 and 67 right ones of 88."""
FAMILIES = (
    {"sensor_lag", "drive_lag", "delay"},
    {"creep", "viscoelastic_layer"},
    {"gain_drift", "degradation"},
    {MODE.effect, TWO_MODES},
)
"""Effects of which a hypothesis has one at most: together two of them make what neither is, such as
the loop of a rate-independent law from two relaxations of opposite sign."""
_CRUDE, _CLEAR = 5, 1e-4
"""Order of the polynomials of the first, crude curve, and the smallest singular value that counts
in its fit, over the largest."""
_CLOSE = 1.5
"""χ² per sample that free curves leave beside the effects so far up to which columns are made from
them."""
_FINER = (1.0, 3.0, 9.0)
"""The shapes that fit best are tried again this many times as near to each other."""
_AGAIN = 4
"""How often the columns are made again about the curve without their effects, at most."""
_PART = 0.25
"""The least share of what the best hypothesis explains beyond the best without an effect in series
for one to be tried."""
_PARTICIPATIONS = (0.1, 0.4)
"""The shares of a second mode at first."""
_BEGUN = 3
"""The shapes from which a chain's fit may begin; chosen by judgement."""
_SMALL_PART = 0.5
"""The part of the motion below which a mode is rather one of several; by judgement, as the next."""
_STIFF = 30.0
"""How many times as high another is whose ringing is not to be seen."""
_NOTHING = 1e-300


def family_of(name: str) -> set[str]:
    """The other effects of an effect's family, if it has one."""
    return {other for family in FAMILIES if name in family for other in family} - {name}


def apart() -> dict[str, set[str]]:
    """For each effect the others of its family."""
    return {name: family_of(name) for family in FAMILIES for name in family}


Key = tuple[tuple[str, float], ...]


def key_of(chain: Chain) -> Key:
    """What tells chains apart but for their fitted parameters."""
    return tuple((one.effect, one.shape.get("order", 0.0)) for one in chain)


class Proposal(NamedTuple):
    """A longer chain by the `starts` from which its fit may begin, and what is `beside` it."""

    starts: list[Chain]
    beside: Hypothesis

    @property
    def key(self) -> Key:
        """What tells it from other chains."""
        return key_of(self.starts[0])


@dataclass(frozen=True, eq=False)
class Expansion:
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
    ) -> Expansion:
        """The columns about the curve of the response without an effect (ΣN,), among them those of
        some shapes.

        The curve is the crude one unless that leaves as little as free curves: those of many
        branches take up part of an effect, and columns made from them miss it.
        """
        prior, response = line.prior, response_of(line.signals)
        whitening, without_effect = prior.whitening, response - effect
        settled = prior.settled(without_effect)
        free, crude = settled.curve(without_effect), _crude_curve(line, without_effect)
        rest, far = (
            whitening(without_effect - free.values),
            whitening(without_effect - crude.values),
        )
        is_free = float(rest @ rest) < _CLOSE * whitening.count and far @ far > rest @ rest
        curve = free if is_free else crude
        motions = motions_of(line.signals, curve)
        barred = {n for one in line.chain for n in (one.effect, *family_of(one.effect))}
        if lone_mode(line) or not any(one.effect == TWO_MODES for one in line.chain):
            barred -= {MODE.effect}
        scanned = settled.prior.weighted(whitening(without_effect))
        columns = [
            *dynamics_of(motions),
            *modes_behind(line, motions, curve, scanned),
            *scanned_lines(motions, whitening, scanned),
            *(again(motions, one) for one in shapes),
        ]
        columns = [c for c in columns if c.effect not in barred]
        matrix = np.concatenate([c.values for c in columns], axis=1)
        inner = settled.prior.inner(whitening(matrix), whitening(response))
        name = ", ".join([PATH, *(f"{e} {o:g}" for e, o in key_of(line.chain))])
        law = Law(name, kinds_of(columns), inner, float(whitening.count), UNKNOWN, apart())
        one = cls(line, chain, settled, motions, law, columns, matrix)
        for finer in _FINER:
            one = one._finer(finer)
        return one

    def _finer(self, finer: float) -> Expansion:
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

    def settling(self) -> Expansion:
        """The same about the curve without the columns' effects, until that gains nothing; what
        belongs in series the chains will decide."""
        one = self
        for _ in range(_AGAIN):
            if not one.best.names or set(one.best.names) & set(IN_SERIES):
                break
            shapes = [one.columns[k] for k in one.best.kinds]
            other = Expansion.about(one.line, one.added(one.best), one.fitted, shapes)
            if other.log_posterior < one.log_posterior + 1:
                break
            one = other
        return one

    @cached_property
    def _untempered(self) -> Sequence[Hypothesis]:
        """The hypotheses untempered by a misfit, what fits best first."""
        return search(self.law, 0.0).hypotheses

    @property
    def best(self) -> Hypothesis:
        """What fits best, likely or not."""
        return self._untempered[0]

    @cached_property
    def log_posterior(self) -> float:
        """Of what fits best, with the chain's own."""
        return max(h.log_posterior for h in self.hypotheses(0.0))

    def adequacy(self, hypothesis: Hypothesis) -> float:
        """How adequate the law behind the chain is beside a hypothesis."""
        return adequacy(self.settled, response_of(self.line.signals), self.sized(hypothesis))

    @cached_property
    def own_adequacy(self) -> float:
        """The same beside what fits best and does not belong in series."""
        return self.adequacy(_but(self.best, IN_SERIES))

    def of_chain(self, share: float) -> float:
        """The logarithm of the chain's prior and of the share of its parameters' that is likely, if
        only this share of the likelihood counts."""
        if self.fitted is None:
            return 0.0
        return self.fitted.log_prior + self.fitted.volume(share)

    def hypotheses(self, excess: float, front: Expansion | None = None) -> Iterator[Hypothesis]:
        """The hypotheses behind the chain, tempered by a misfit κ - 1.  What belongs in series is
        there exactly or not at all.

        Two laws of which one spends more coefficients than the other differ in χ² by chance, too:
        the odds of `front` are moderated by that (MacKay, Neural Comput. 4 (1992) 720).
        """
        places = [k for k, kind in enumerate(self.law.kinds) if kind.name not in IN_SERIES]
        beside = replace(self.law, kinds=[self.law.kinds[k] for k in places])
        listed = search(beside, excess).hypotheses
        best, share = listed[0], self.law.tempered(excess).count / self.law.count
        whole = share * self.adequacy(_placed(best, places))
        if front is not None and front is not self:
            other = share * front.own_adequacy
            chance = share**2 * abs(self.settled.freedom - front.settled.freedom) / 2
            whole = other + (whole - other) / np.sqrt(1 + np.pi * chance / 8)
        # Relative to the best columns, beside which the law behind the chain is adequate or not.
        of_chain = whole - (best.log_posterior - best.log_prior) + self.of_chain(share)
        chain = tuple(one.effect for one in self.line.chain)
        for one in listed:
            if len(chain) + len(one.names) <= MOST_EFFECTS:
                yield _placed(one, places)._replace(
                    names=(*chain, *one.names),
                    log_posterior=float(one.log_posterior + of_chain),
                )

    def proposed(self) -> list[Proposal]:
        """The chain longer by each effect whose columns explain much of what no other effect does,
        or could in the place of others."""
        listed, chain, lone = self._untempered, self.line.chain, lone_mode(self.line)
        values = {frozenset(h.names): h.log_posterior for h in listed}
        without = next(h.log_posterior for h in listed if not {*h.names} & {*IN_SERIES})
        much = _PART * (listed[0].log_posterior - without)
        begun: list[tuple[Stage, Hypothesis]] = []
        for name, own in self._leading():
            rest = frozenset(own.names) - {name}
            gain = own.log_posterior - (values.get(rest, without) if rest else without)
            # About one mode that follows two as well as it can a second looks like nothing.
            is_second = name == MODE.effect and lone is not None
            if (gain <= 0 or gain < much) and not is_second:
                continue
            # What is beside it may be there in its stead.
            for beside in (_but(listed[0], IN_SERIES), _but(own, own.names)):
                begun += [(one, beside) for one in self._begun(name, beside)]
        # Which lag it is the chains decide: about a curve they are alike.
        held = {one.effect for one, _ in begun}
        for (effect, shape), beside in list(begun):
            others = [one for one in lags_like(effect, shape) if one.effect not in held]
            begun += [(one, beside) for one in others]
            held |= {one.effect for one in others}
        proposals: dict[tuple, Proposal] = {}
        for stage, beside in begun:
            for longer in (one for one in _longer(chain, stage, lone) if len(one) <= MOST_EFFECTS):
                key = key_of(longer), beside.kinds, beside.sizes
                starts = proposals.setdefault(key, Proposal([], beside)).starts
                starts += [longer] if longer not in starts else []
        return list(proposals.values())

    def _leading(self) -> Iterator[tuple[str, Hypothesis]]:
        """Each effect in series with what fits best of the hypotheses that hold it, and of those
        that hold no other of its kind."""
        for only in (False, True):
            leading = {
                name: h
                for h in reversed(self._untempered)
                for name in h.names
                if name in IN_SERIES and not (only and len({*h.names} & {*IN_SERIES}) > 1)
            }
            yield from sorted(leading.items(), key=lambda pair: -pair[1].log_posterior)

    def _begun(self, name: str, beside: Hypothesis) -> Iterator[Stage]:
        """The stages from which a chain's fit may begin: the shapes that explain most beside a
        hypothesis as a stage does, with the coefficient one.  Of a mode half the width of a peak
        away the ringing is out of phase, so that its coefficient is free; one that is small in what
        fits best is beside another, which has the rest and is too stiff to be seen."""
        inner = self.law.inner.given(*beside.columns(self.law.kinds))
        shapes = [k for k, one in enumerate(self.columns) if one.effect == name]
        at = [self.law.kinds[k].start for k in shapes]
        along, square = inner.along[at], np.maximum(inner.columns[at, at], _NOTHING)
        size = np.maximum(along / square, 0.0) if name == MODE.effect else np.ones(len(at))
        gains = size * along - 0.5 * size**2 * square
        is_one = name == MODE.effect and name in self.best.names and lone_mode(self.line) is None
        for k in np.argsort(-gains)[:_BEGUN].tolist():
            shape = self.columns[shapes[k]].shape
            yield Stage(name, shape)
            if is_one and size[k] < _SMALL_PART:
                rest = {
                    "ratio": _STIFF,
                    "second_damping": shape["damping"],
                    "participation": 1 - float(size[k]),
                }
                yield Stage(TWO_MODES, shape | rest)

    def sized(self, hypothesis: Hypothesis) -> np.ndarray:
        """The columns (ΣN, k) of a hypothesis, of unit prior standard deviation."""
        chosen, sizes = hypothesis.columns(self.law.kinds)
        return self.matrix[:, chosen] * sizes

    def parts(self, hypothesis: Hypothesis) -> np.ndarray:
        """What each column (ΣN, k) of a hypothesis adds [response unit]."""
        chosen, sizes = hypothesis.columns(self.law.kinds)
        return self.matrix[:, chosen] * self.law.inner.coefficients(chosen, sizes)

    def added(self, hypothesis: Hypothesis) -> np.ndarray:
        """What a hypothesis adds (ΣN,) [response unit]."""
        return self.parts(hypothesis).sum(axis=1)


def _placed(hypothesis: Hypothesis, places: Sequence[int]) -> Hypothesis:
    """A hypothesis among all kinds that was among those at some places."""
    return hypothesis._replace(kinds=tuple(places[k] for k in hypothesis.kinds))


def _but(hypothesis: Hypothesis, names: Collection[str]) -> Hypothesis:
    """A hypothesis without some of its effects."""
    places = [k for k, name in enumerate(hypothesis.names) if name not in names]
    return hypothesis._replace(
        names=tuple(hypothesis.names[k] for k in places),
        kinds=tuple(hypothesis.kinds[k] for k in places),
        sizes=tuple(hypothesis.sizes[k] for k in places),
    )


def _longer(chain: Chain, stage: Stage, lone: tuple[int, Shape] | None) -> Iterator[Chain]:
    """A chain with a further stage, of each of its orders; beside a lone mode a further one makes
    two in parallel."""
    if stage.effect == MODE.effect and lone is not None:
        at, one = lone
        first, second = sorted([one, stage.shape], key=lambda shape: shape["frequency"])
        for share in _PARTICIPATIONS:
            both = {
                "frequency": first["frequency"],
                "damping": first["damping"],
                "ratio": second["frequency"] / first["frequency"],
                "second_damping": second["damping"],
                "participation": share if second is stage.shape else 1 - share,
            }
            yield (*chain[:at], Stage(TWO_MODES, both), *chain[at + 1 :])
    elif "order" in stage.shape:
        for order in SENSOR_ORDERS:
            yield (*chain, Stage(stage.effect, stage.shape | {"order": order}))
    elif stage.effect not in {one.effect for one in chain}:
        yield (*chain, stage)


def _crude_curve(line: Line, response: np.ndarray) -> Curve:
    """A response (ΣN,) by polynomials of the drive and fading memory alone: no curve of many
    branches, which would take up the ringing whose column is made from it."""
    prior = line.prior
    drive, nodes = prior.drive, prior.nodes(prior.drive)
    scaled = 2 * (nodes - drive.min()) / np.ptp(drive) - 1
    sizes = np.ones(prior.fading.shape[1]), np.full(prior.own.shape[1], prior.span)
    beside = prior.beside(np.ones(prior.fading.shape[1] + prior.own.shape[1], bool))
    before = np.concatenate(
        [chebyshev.chebvander(scaled, _CRUDE), beside / np.concatenate(sizes)], axis=1
    )
    columns = prior.filtered(before)
    coefficients = np.linalg.lstsq(columns, response, rcond=_CLEAR)[0]
    values, slope = columns @ coefficients, np.ptp(response) / np.ptp(drive)
    return Curve(
        values,
        before[: drive.size] @ coefficients,
        np.full(drive.size, slope),
        lambda other: values + prior.filtered(slope * (prior.nodes(other) - nodes)),
    )


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

        values, error = curve.values[first:last], float(np.median(signal.drive_error))
        motions.append(
            Motion(signal.drive, values, moved, signal.step, error=error, periodic=signal.periodic)
        )
    return motions
