"""From a fitted model and path curves to the named effects and their refits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .._blocks import EFFECTS, AbstractBlock
from .._computing import Clock
from .._inside import Inside
from .._path import PathView, Posterior, misfit
from .._solve import Progress, tolerated_error
from ._fitted import Fitted
from ._jumps import Jumps, jumps_of
from ._names import Name, names_of
from ._refits import Explanation, explained_by
from ._rivals import aim_of, compared
from ._thresholds import ADEQUATE, NUMERICS
from ._views import ModelView, View, trials_of

_MOST_TRIED, _PART = 4, 0.25
"""Effects that are refitted alone where columns do not reach the noise, and the least share of what
the best of them explains; chosen by judgement."""
_MINOR = 0.1
"""The numerical error that is accepted, over the residual's norm beyond the noise; chosen by
judgement."""


@dataclass(frozen=True, eq=False)
class Inquiry:
    """What is known of the effects.

    Attributes:
        base: the fitted model.
        path: the recordings under path curves; None where the model describes them, and of
            machines.
        model: the recordings under the model; None where no model is asked about.
        posterior: over effects, under the law that describes the recordings.
        is_adequate: whether the model describes them, with the named effects or without.
        names: the named effects.
        explanation: their refit with the model; None where none is named or the model is not
            adequate.
        refits: the refits that were compared.
        jumps: that explain the residual better than any effect; None if none do.
        shares: of the residual that each effect inside a machine explains beside the others.
    """

    base: Fitted
    path: PathView | None
    model: ModelView | None
    posterior: Posterior
    is_adequate: bool
    names: tuple[Name, ...] = ()
    explanation: Explanation | None = None
    refits: tuple[Explanation, ...] = ()
    jumps: Jumps | None = None
    shares: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, base: Fitted, path: PathView | None, model: ModelView | None) -> Inquiry:
        """What is known before anything is named: under the model, if there is one."""
        if model is not None:
            return cls(base, path, model, model.posterior, is_adequate=True)
        assert path is not None  # without a model recordings are under path curves
        return cls(base, path, None, path.posterior, is_adequate=False)

    def unnamed(self) -> Inquiry:
        """The same without names."""
        return replace(self, names=(), explanation=None)

    @property
    def view(self) -> View:
        """The columns under which the effects were judged."""
        return self.model if self.model is not None and self.is_adequate else self.curves

    @property
    def curves(self) -> PathView:
        """The recordings under path curves, where the model does not describe them."""
        assert self.path is not None
        return self.path

    @property
    def tested(self) -> View:
        """The columns about the model's residual, or path curves where there is no model."""
        if self.model is not None:
            return self.model
        return self.curves if self.curves.plain is None else self.curves.plain

    @cached_property
    def path_misfit(self) -> float:
        """κ - 1 that path curves with their effects leave."""
        return misfit(self.curves.law, self.curves.posterior.best)

    def share_of(self, name: str) -> float:
        """The share of the excess χ² that a named effect explains beside the others."""
        if name in self.shares:
            return self.shares[name]
        view, names = self.view, [n.effect for n in self.names]
        rest = [other for other in names if other != name]
        without = view.misfit_of(rest) if rest else view.base_misfit
        explained = without - view.misfit_of(names)
        return float(np.clip(explained / max(view.base_misfit, 1e-300), 0.0, 1.0))


def inquire(inquiry: Inquiry, nominal: AbstractBlock, progress: Progress, clock: Clock) -> Inquiry:
    """Search for the effects that recordings show: those that a model leaves out if there is one,
    otherwise those that no law of hysteresis makes."""
    path, view, base = inquiry.path, inquiry.model, inquiry.base
    if path is None:
        return inquiry
    of_curves = Inquiry(
        base, path, view, path.posterior, is_adequate=False,
        names=names_of(path.posterior, inquiry.path_misfit),
    )  # fmt: skip
    if view is None:
        return of_curves
    if base.numerics > tolerated_error(NUMERICS, base.solved, _MINOR):
        return inquiry
    best = misfit(view.law, view.posterior.best)
    limit = ADEQUATE * (1 + max(inquiry.path_misfit, 0.0)) - 1
    refits: list[Explanation] = []
    try:
        if best > limit:
            refits = _alone(view, path, nominal, progress, clock)
        posterior, refits = compared(view, path, refits, nominal, progress, clock)
    except KeyboardInterrupt:
        clock.stopped = True
        return of_curves.unnamed()
    names = names_of(posterior)
    named = {n.effect for n in names}
    own = next((e for e in refits if set(e.names) == named), None)
    reached = view.base_misfit if own is None else own.excess
    is_likelier = (1 + reached) * view.law.count <= aim_of(view, path, len(named))
    # A change of the loop's shape is one of many unless it is the whole of what is missing.
    is_another = reached > limit and any(EFFECTS[name].rate_independent for name in named)
    if is_likelier and not is_another and (own is not None or not names):
        answer = replace(inquiry, posterior=posterior, names=names, explanation=own)
    else:
        answer = of_curves
    return _beside_jumps(replace(answer, refits=tuple(refits)), reached, limit)


def inquired_inside(inquiry: Inquiry, inside: Inside) -> Inquiry:
    """The same with the effects inside a machine."""
    names = [
        Name(name, tuple(alike), float(inside.probability_of(name)))
        for name, (_, *alike) in zip(inside.names, inside.sets, strict=True)
    ]
    shares = {name: inside.share_of(name) for name in inside.names}
    return replace(inquiry, names=tuple(names), shares=shares)


def _beside_jumps(inquiry: Inquiry, reached: float, limit: float) -> Inquiry:
    """The inquiry with jumps instead of names, if they reach the noise and are more likely than
    what the model with the names leaves, at two coefficients each."""
    view = inquiry.model
    assert view is not None  # jumps are those of a model's residual
    if view.base_misfit <= limit:
        return inquiry
    jumps = jumps_of(view)
    if not jumps.samples or jumps.excess > limit:
        return inquiry
    count, coefficients = view.law.count, 2 * len(jumps.samples) - 2 * len(inquiry.names)
    gained = count * np.log((1 + max(reached, 0.0)) / (1 + max(jumps.excess, 0.0)))
    likelier = gained > coefficients * np.log(count)
    return replace(inquiry.unnamed(), jumps=jumps) if likelier else inquiry


def _alone(
    view: ModelView,
    path: PathView,
    nominal: AbstractBlock,
    progress: Progress,
    clock: Clock,
) -> list[Explanation]:
    """Refits of the effects that explain most of the residual, each alone: far from the fit an
    effect may explain it although its columns do not.  So does what fits path curves best."""
    singles = [h for h in view.posterior.hypotheses if len(h.names) == 1]
    falls = {h.names[0]: -misfit(view.law, h) for h in singles}
    none = view.base_misfit
    ranked = sorted(falls, key=lambda name: -falls[name])[:_MOST_TRIED]
    most = none + falls[ranked[0]]
    refits = []
    likely = [n for n in ranked if none + falls[n] >= _PART * most]
    setting = view.fitted.preparation.setting
    aim, shapes = aim_of(view, path, 1), dict[str, list[AbstractBlock]]()
    for one in path.leading:
        for name, block in trials_of(one, setting):
            shapes.setdefault(name, []).append(block)
    for name in dict.fromkeys([*shapes, *likely]):
        if clock.is_over:
            break
        progress(f"refitting with {name}")
        further = shapes.get(name, [])
        refits.append(explained_by([name], view, nominal, view.fitted.preparation, aim, further))
    return refits
