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

from ._chain import Fitted, Line, Stage, fitted, without
from ._curves import Curves
from ._dynamics import Columns
from ._expansion import PATH, Expansion, Key, Proposal, key_of
from ._filters import RESPONSE_SIDE
from ._posterior import (
    EACH,
    Hypothesis,
    Law,
    Posterior,
    misfit,
    select,
)
from ._signal import Signal, ends_of, response_of, span_of
from ._spent import spent_of

MISFIT = 0.1
"""κ - 1 from which path curves do not describe a recording: of recordings that a law with return
points made they leave -.4 to .1, as the level of a noise is uncertain."""
_LIKELY, _MOST_LIKELY = 60.0, 4
"""The logarithm of the odds against a chain from which it goes no further, and how many of other
effects go further of those that one proposes."""
_ROUGHLY = 0.1
"""The share of what a chain gains that another may lack beside it: what is beside them was made
about the curve without either."""


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
        spent: the share (N//2+1,) of each recording's noise that the curves take up, by frequency.
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
    spent: list[np.ndarray]
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


def view_of(signals: Sequence[Signal], is_over: Callable[[], bool] = lambda: False) -> PathView:
    """The posterior over dynamics of recordings of one actuator; no further chain is tried once its
    time `is_over`."""
    signals = _weighted(signals)
    plain = Expansion.about(Line.of(signals, ()), np.zeros_like(response_of(signals))).settling()
    expansions = _expansions(signals, plain, is_over)
    posterior, chosen = _joint(expansions, min(misfit(e.law, e.best) for e in expansions))
    posterior, chosen = _joint(expansions, misfit(chosen.law, posterior.best))
    leading = max(expansions, key=lambda one: one.log_posterior)
    laws = {one.law.name: one.law for one in expansions}
    own = _view(plain, select(plain.law), {PATH: plain.law}, plain)
    return replace(_view(chosen, posterior, laws, leading), plain=own)


def _weighted(signals: Sequence[Signal]) -> Sequence[Signal]:
    """Signals with the errors of their drives in the noise, by the slopes of the curve."""
    if not any(s.drive_error.any() for s in signals):
        return signals
    response = response_of(signals)
    slopes = Line.of(signals, ()).prior.settled(response).curve(response).slope
    return [
        s.weighted_by(slope)
        for s, slope in zip(signals, np.split(slopes, ends_of(signals)), strict=True)
    ]


def _joint(expansions: Sequence[Expansion], excess: float) -> tuple[Posterior, Expansion]:
    """The posterior over all chains and columns, tempered by a misfit κ - 1, and the expansion that
    its best hypothesis is of."""
    front = max(expansions, key=lambda one: one.log_posterior)
    posterior = Posterior.of([h for one in expansions for h in one.hypotheses(excess, front)])
    return posterior, next(one for one in expansions if one.law.name == posterior.best.law)


def _expansions(
    signals: Sequence[Signal], plain: Expansion, is_over: Callable[[], bool]
) -> list[Expansion]:
    """The best expansion behind each likely chain, that without any first."""
    behind: dict[Key, Expansion] = {(): plain}
    # Of one mode two are made, whose fit begins elsewhere than that of two at once.
    tried: set[tuple[int, Key]] = set()
    asked: set[Key] = set()
    while True:
        most = max(one.log_posterior for one in behind.values()) - _LIKELY
        likely = {k: one for k, one in behind.items() if one.log_posterior > most}
        fronts = sorted(likely.keys() - asked, key=lambda key: -likely[key].log_posterior)
        if not fronts or is_over():
            break
        front, size = behind[fronts[0]], len(fronts[0])
        asked.add(fronts[0])
        proposals = [one for one in front.proposed() if (size, one.key) not in tried]
        tried |= {(size, one.key) for one in proposals}
        for key, one in _longer(signals, front, proposals, is_over).items():
            if key not in behind or one.log_posterior > behind[key].log_posterior:
                behind[key] = one
                asked.discard(key)
    return list(behind.values())


def _longer(
    signals: Sequence[Signal],
    front: Expansion,
    proposals: Sequence[Proposal],
    is_over: Callable[[], bool],
) -> dict[Key, Expansion]:
    """The expansions behind the likeliest of longer chains that one proposes, of those that are
    likelier than it."""
    longer: list[tuple[Fitted, Hypothesis]] = []
    before, least = front.adequacy(front.best), front.own_adequacy + front.of_chain(1.0)
    # Those without a filter first, which cost least: a later one ends where it cannot come near.
    cheap = sorted(proposals, key=lambda one: any(e in RESPONSE_SIDE for e, _ in one.key))
    for starts, beside in cheap:
        if is_over():
            break
        one = fitted(signals, starts, front.sized(beside), front.settled, least)
        if one.log_posterior > least:
            longer.append((one, beside))
            gain = max(one.log_posterior - before, 0.0)
            least = max(least, one.log_posterior - _LIKELY - _ROUGHLY * gain)
    longer.sort(key=lambda pair: -pair[0].log_posterior - len(pair[1].names) * np.log(EACH))
    best: dict[tuple[str, ...], tuple[Fitted, Hypothesis]] = {}
    for one, beside in longer:
        best.setdefault(tuple(stage.effect for stage in one.line.chain), (one, beside))
    behind = {}
    for one, beside in list(best.values())[:_MOST_LIKELY]:
        if one.log_posterior > least and not (behind and is_over()):
            shapes = [front.columns[k] for k in beside.kinds]
            further = Expansion.about(one.line, front.added(beside), one, shapes).settling()
            # Of filters so slow that no digit is left χ² is no sum of squares.
            if misfit(further.law, further.best) > -1:
                behind[key_of(one.line.chain)] = further
    return behind


def _view(
    one: Expansion, posterior: Posterior, laws: dict[str, Law], leading: Expansion
) -> PathView:
    """The view of a posterior whose best hypothesis is about this curve."""
    best, response = posterior.best, response_of(one.line.signals)
    parts = one.parts(best)
    own = [one.columns[k] for k in best.kinds]
    owners = [c.effect for c in own for _ in range(c.values.shape[1])]
    without_effect = response - parts.sum(axis=1)
    values = one.settled.curve(without_effect).values
    effects = dict(_summed(owners, parts))
    for k, stage in enumerate(one.line.chain):
        effects[stage.effect] = values - without(one.line, one.settled, without_effect, k)
    shapes = [Stage(c.effect, c.shape) for c in own]
    of_leading = [leading.columns[k] for k in leading.best.kinds]
    return PathView(
        posterior=posterior,
        law=one.law,
        laws=laws,
        columns=one.columns,
        whole=np.linalg.norm(one.line.prior.whitening(one.matrix), axis=0),
        residual=without_effect - values,
        spent=spent_of(one.settled, ends_of(one.line.signals)),
        curves=one.line.prior.curves,
        span=span_of(one.line.signals),
        effects=effects,
        shapes=(*one.line.chain, *shapes),
        leading=(*leading.line.chain, *(Stage(c.effect, c.shape) for c in of_leading)),
    )


def _summed(names: Sequence[str], parts: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """The sum (ΣN,) of the parts (ΣN, k) of each name."""
    for name in dict.fromkeys(names):
        yield name, parts[:, [k for k, own in enumerate(names) if own == name]].sum(axis=1)
