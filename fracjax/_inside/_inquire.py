"""From a machine and recordings to the physics that its model leaves out inside its dynamics."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import numpy as np
from scipy.optimize import least_squares
from scipy.special import softmax

from .._blocks import INSIDE, AbstractMachine, Within
from .._computing import computing, map_in_threads, time_is_over
from .._naming import block_name
from .._parameters import named_parameters, set_values
from .._path import MOST_EFFECTS, Hypothesis, Posterior
from .._prepare import Preparation
from .._solve import (
    Descent,
    Progress,
    Solved,
    begin,
    descend,
    orthonormal_basis,
    silent,
    solve_from,
)
from ._columns import Column, Columns, columns_of
from ._posterior import About, Worth
from ._result import ALTERNATIVE, Candidate, Inside

_ALONE, _TOGETHER = 4, 3
"""Effects that are fitted alone in each round, and likely sets; chosen by judgement."""
_HOPELESS = 30.0
"""The logarithm of the odds against a set, after its first evaluations, from which its fit is not
brought to its end."""
_WORTHY = 1e-3
"""The probability to first order, over that of the best set, below which a set is not fitted."""
_ROUNDS = 3
"""How often columns are made about the best fit so far; chosen by judgement."""
_STARTS = (1.0, 0.3)
"""Starts of an effect's size, over the one that the columns say: a large effect is overstated to
first order."""
_HELD, _FREE = 5, 15
"""Evaluations of a start with its effects held, to which the machine adapts, and with all free,
before the best is fitted to its end; chosen by judgement."""
_SEEN = 1.0
"""The change of χ², as it is judged, from which a step is too long: no hypothesis gains from
less."""
_FINEST = 64
"""Most steps of the integration in a sample; chosen by judgement."""
_SMALLEST = 0.01
"""The coefficient of a trial that one of the other sign starts from: it has only one sign."""

HeldOut = Callable[[Solved], float]
"""The rms error of a fit on data that it has not used [response]."""


def inquire_inside(
    block: AbstractMachine | Within,
    preparation: Preparation,
    held_out: HeldOut | None = None,
    progress: Progress = silent,
) -> Inside:
    """Name the effects inside a machine that its model leaves out.

    The machine is fitted; every effect that one of its ports admits is a column about the fit, in
    several shapes and at every place of the port, beside static curves and further linear dynamics;
    the most probable sets of up to three are fitted with all parameters free, and look-alikes of
    the best, again about the best of them and what could stand in its place, and each effect of the
    best is taken away once.  What is named is the most probable set of all that were fitted.
    Where a step of half the length changes the best of them visibly, all goes on with that step.

    Args:
        block: the machine, with the effects that it is believed to have.
        preparation: the recordings with noise and history.
        held_out: the error of a fit on data that it has not used.
        progress: is called with a text at every step.

    Returns:
        The effects, what else was considered, and the fits.
    """
    within = block if isinstance(block, Within) else Within(block)
    # A start far from the recordings may overflow: its χ² is infinite, and it is not taken.
    with computing(), np.errstate(over="ignore", invalid="ignore"):
        specified = all(take.noise is not None for take in preparation.takes)
        progress("fitting the machine")
        base = solve_from([within], _unweighted(preparation))
        columns = columns_of(base)
        fits = [_Fit.of(base, (), columns.others)]
        inquiry = _Inquiry(specified, progress, columns, fits)
        inquiry.search()
        while inquiry.is_coarse() and not time_is_over():
            progress("halving the step of the integration")
            inquiry = inquiry.finer()
            inquiry.search()
        base = inquiry.fits[0].solved
        fits, probabilities = inquiry.ranked()
        best = fits[0]
        worth = inquiry.worth
        needs = best.about.evidence(worth, len(best.names))[1] > 0
        errors = [held_out(s) if held_out else None for s in (base, best.solved)]
        return Inside(
            base,
            best.solved,
            tuple(
                Candidate(f.names, f.block, f.solved.cost / base.cost, float(p))
                for f, p in zip(fits, probabilities, strict=True)
            ),
            best.about.outside(worth) if needs else "",
            *errors,
        )


def _unweighted(preparation: Preparation) -> Preparation:
    """The recordings with white noises of their levels.

    What the model leaves out is far above the noise, and the colour of a rest or of a converter is
    not its own: whitened by that, a fit would follow frequencies at which nothing happens.
    """
    noises = [take.noise for take in preparation.takes]
    if any(noise is None for noise in noises):
        return replace(preparation, takes=tuple(replace(t, noise=None) for t in preparation.takes))
    return preparation.with_noises([noise.uncoloured() for noise in noises if noise])


@dataclass(frozen=True, eq=False)
class _Fit:
    """A fitted set of effects beside those that the machine is believed to have.

    Attributes:
        names: of the effects, in alphabetical order.
        solved: the fit.
        about: inner products about it, of what is no effect.
    """

    names: tuple[str, ...]
    solved: Solved
    about: About

    @classmethod
    def of(cls, solved: Solved, names: Sequence[str], others: dict[str, list[Column]]) -> _Fit:
        """A fit beside what is no effect, as it was about the machine without any."""
        residual, tangent = np.concatenate(solved.whitened), solved.whitened_derivative()
        size = float(np.sqrt(sum(p.size**2 for p in solved.preparation.problems())))
        about = About.of(Columns({}, others, residual, tangent, size), frozenset())
        return cls(tuple(sorted(names)), solved, about)

    @property
    def block(self) -> Within:
        """The machine with the effects."""
        return self.solved.block  # type: ignore[return-value]


@dataclass(eq=False)
class _Inquiry:
    """The sets that were fitted so far; the first is the machine as it is believed to be, and
    `columns` are about it."""

    specified: bool
    progress: Progress
    columns: Columns
    fits: list[_Fit]

    @property
    def worth(self) -> Worth:
        """What residuals are judged by: the best fit so far."""
        least = min(fit.solved.cost for fit in self.fits)
        return Worth.of(least, self.fits[0].about.samples, specified=self.specified)

    def ranked(self) -> tuple[list[_Fit], np.ndarray]:
        """The fits and their probabilities, the most probable first."""
        worth = self.worth
        logs = np.array([fit.about.evidence(worth, len(fit.names))[0] for fit in self.fits])
        order = np.argsort(-logs, kind="stable")
        return [self.fits[k] for k in order], softmax(logs)[order]

    def search(self) -> None:
        """Fit what may be missing about the best fit, as long as that changes it.

        With a finer step a set may need an effect less, which was there for a longer one's error.
        """
        self._reduce(self.ranked()[0][0])
        extended: set[tuple[str, ...]] = set()
        for _ in range(_ROUNDS):
            # Where the best set leaves more than noise, what could stand in its place may be what
            # leads to a better one.
            ranked, probabilities = self.ranked()
            first = 2 if self.worth.variance > 1 or not self.specified else 1
            likely = [
                fit
                for fit, probability in zip(ranked[:first], probabilities[:first], strict=True)
                if probability >= ALTERNATIVE * probabilities[0] and fit.names not in extended
            ]
            if not likely or time_is_over():
                break
            for fit in likely:
                self._extend(fit, again=fit is not ranked[0])
                extended.add(fit.names)
            self._reduce(self.ranked()[0][0])

    def is_coarse(self) -> bool:
        """Whether half the step changes the best fit by more than is told apart, beside what the
        machine's own parameters absorb: what an effect absorbs, it may be there for."""
        solved, worth = self.ranked()[0][0].solved, self.worth
        now, finer = solved.preparation, _finer(solved.preparation)
        if not solved.block.effects or finer.oversampling > _FINEST:  # type: ignore[attr-defined]
            return False
        ends = [
            np.concatenate([p.whiten(p.respond(solved.block)) for p in each.problems()])
            for each in (now, finer)
        ]
        basis = orthonormal_basis(_machines_own(solved))
        change = ends[1] - ends[0]
        change = change - basis @ (basis.T @ change)
        samples = self.fits[0].about.samples
        return float(change @ change) * worth.samples > _SEEN * worth.variance * samples

    def finer(self) -> _Inquiry:
        """The same with half the step, with the sets that are likely so far."""
        ranked, probabilities = self.ranked()
        preparation = _finer(self.fits[0].solved.preparation)
        base = solve_from([self.fits[0].block], preparation)
        columns = columns_of(base)
        likely = [
            fit
            for fit, probability in zip(ranked, probabilities, strict=True)
            if fit.names and probability > _WORTHY * probabilities[0]
        ]
        fits = [_Fit.of(base, (), columns.others)] + [
            _Fit.of(solve_from([fit.block], preparation), fit.names, columns.others)
            for fit in likely
        ]
        return replace(self, columns=columns, fits=fits)

    def _extend(self, fit: _Fit, *, again: bool) -> None:
        """Fit the most probable sets of further effects about a fit; `again` those too that were
        fitted about another."""
        self.progress("comparing effects")
        is_first = fit is self.fits[0]
        columns = self.columns if is_first else columns_of(fit.solved, self.columns.others)
        one_sided = frozenset(name for name, effect in INSIDE.items() if effect.one_sided)
        about = About.of(columns, one_sided)
        posterior, worth = self._judged(about)
        sets: dict[tuple[str, ...], list[Hypothesis]] = {}
        for one in posterior.hypotheses:
            sets.setdefault(tuple(sorted(one.names)), []).append(one)
        # Far from the fit an effect may explain it although its columns do not, so that the first
        # few are fitted alone, whatever their probability.
        alone = [names for names in sets if len(names) == 1][:_ALONE]
        least = posterior.best.log_posterior + np.log(_WORTHY)
        likely = [n for n, own in sets.items() if n and own[0].log_posterior > least][:_TOGETHER]

        def fit_each(several: Sequence[tuple[str, ...]]) -> None:
            for names in dict.fromkeys(several):
                whole = tuple(sorted((*fit.names, *names)))
                there = any(f.names == whole for f in self.fits)
                if len(whole) > MOST_EFFECTS or (there and not again):
                    continue
                if time_is_over():
                    break
                self.progress(f"fitting {' and '.join(whole)}")
                shapes = {one.kinds: (about, one) for one in reversed(sets[names])}
                starts = [
                    _started(fit.block, beside, one, worth, factor)
                    for beside, one in [*shapes.values(), *_by_form(about, names, worth)]
                    for factor in _STARTS
                ]
                self._fit(whole, starts, len(fit.block.effects))

        fit_each([*alone, *likely])
        # A set is complete only where what could stand in its effect's place was fitted too.
        more = {*self.ranked()[0][0].names} - {*fit.names}
        if len(more) == 1:
            fit_each([(name,) for name in _alike(*more) if (name,) in sets])

    def _judged(self, about: About) -> tuple[Posterior, Worth]:
        """The posterior to first order about a fit, and what it judges by: what the best set
        leaves to first order, or what the best fit leaves."""
        least, samples = min(f.solved.cost for f in self.fits), about.samples
        worth = self.worth
        for _ in range(2):
            remainder = about.remainder(about.posterior(worth).best, worth)
            worth = Worth.of(min(least, remainder), samples, specified=self.specified)
        return about.posterior(worth), worth

    def _reduce(self, fit: _Fit) -> None:
        """Fit a set without each of its effects."""
        for name in fit.names if len(fit.names) > 1 else ():
            fewer = tuple(n for n in fit.names if n != name)
            if any(f.names == fewer for f in self.fits) or time_is_over():
                continue
            block = fit.block
            believed = len(self.fits[0].block.effects)
            for k in reversed(range(believed, len(block.effects))):
                if block_name(block.effects[k]) == name:
                    block = block.without(k)
            self.progress(f"fitting {' and '.join(fewer)}")
            self._fit(fewer, [block], len(block.effects))

    def _fit(self, names: tuple[str, ...], starts: Sequence[Within], held: int) -> None:
        """Fit a set of effects from starts, first with the effects from `held` on held."""
        descents = map_in_threads(lambda start: self._descent(start, held), starts)
        best = min(descents, key=lambda each: each.cost)
        least = min(fit.solved.cost for fit in self.fits)
        if 0.5 * self.worth.samples * np.log(best.cost / least) > _HOPELESS:
            return
        block = best.objective.at(best.position).blocks[0]
        solved = solve_from([block], self.fits[0].solved.preparation)
        same = next((fit for fit in self.fits if fit.names == names), None)
        if same is not None and same.solved.cost <= solved.cost:
            return
        self.fits = [fit for fit in self.fits if fit is not same]
        self.fits.append(_Fit.of(solved, names, self.columns.others))

    def _descent(self, start: Within, held: int) -> Descent:
        """A few evaluations from a start."""
        preparation = self.fits[0].solved.preparation
        # NumPy's handling of overflow is a thread's own.
        with np.errstate(over="ignore", invalid="ignore"):
            descent = begin(start, preparation.problems(), preparation.conditions)
            return descend(_adapted(descent, start, held), _FREE)


def _machines_own(solved: Solved) -> np.ndarray:
    """The whitened derivative (ΣL, d) by the machine's own parameters and the offsets."""
    parameters, _, whitened = solved.sensitivity()
    is_own = np.ones(whitened.shape[1], dtype=bool)
    is_own[: len(parameters)] = [_place(p.name) < 0 for p in parameters]
    return whitened[:, is_own]


def _finer(preparation: Preparation) -> Preparation:
    """The same with half the step."""
    return replace(preparation, oversampling=2 * preparation.oversampling)


def _alike(name: str) -> list[str]:
    """The effects that the catalogue says look like one, or that one looks like."""
    return [
        other
        for other, effect in INSIDE.items()
        if name in effect.separated_by or other in INSIDE[name].separated_by
    ]


def _by_form(about: About, names: tuple[str, ...], worth: Worth) -> list[tuple[About, Hypothesis]]:
    """The best shape of each form of an effect that has several, as friction has one with bristles
    and one without: to first order one may hide the other."""
    own: dict[type, list[int]] = {}
    for k, (kind, shape) in enumerate(zip(about.kinds, about.shapes, strict=True)):
        if names == (kind.name,):
            own.setdefault(type(shape.inside[0][1]), []).append(k)
    forms = [
        replace(
            about,
            kinds=tuple(about.kinds[k] for k in places),
            shapes=tuple(about.shapes[k] for k in places),
        )
        for places in own.values()
    ]
    if len(forms) < 2:
        return []
    return [
        (form, next(one for one in form.posterior(worth).hypotheses if one.names)) for form in forms
    ]


def _started(block: Within, about: About, one: Hypothesis, worth: Worth, factor: float) -> Within:
    """A machine with the effects of a hypothesis about it, at a factor of their sizes.

    Where a port may have several places, that of the hypothesis' first effect is taken.
    """
    machine = about.shapes[one.kinds[0]].machine
    block = eqx.tree_at(lambda within: within.machine, block, machine)
    for kind, values in zip(one.kinds, about.coefficients(one, worth), strict=True):
        for (site, effect), coefficient in zip(about.shapes[kind].inside, values, strict=True):
            signed = INSIDE[block_name(effect)].one_sided
            share = max(coefficient, _SMALLEST) if signed else coefficient
            value = getattr(effect, effect.size).value * float(share) * factor
            block = block.at(site, set_values(effect, {effect.size: value}))
    return block


def _adapted(descent: Descent, start: Within, held: int) -> Descent:
    """A descent after a few evaluations in which the effects from `held` on keep their values.

    It is that of all parameters with their columns left out, so that nothing is compiled anew.
    """
    objective, position = descent.objective, descent.position
    parameters = named_parameters(start)
    nudged = {
        name: p.from_share(0.9 * p.to_share(p.value) + 0.01)
        for name, p in parameters.items()
        if _place(name) >= held and not p.fixed
    }
    other = objective.parameters.position_of(set_values(start, nudged))
    moves = other == position
    if moves.all() or not moves.any() or not np.isfinite(objective.at(position).cost):
        return descent

    def whole(part: np.ndarray) -> np.ndarray:
        moved = position.copy()
        moved[moves] = part
        return moved

    result = least_squares(
        lambda part: objective.residual(whole(part)),
        position[moves],
        lambda part: objective.derivative(whole(part))[:, moves],  # type: ignore[arg-type]
        bounds=tuple(bound[moves] for bound in objective.bounds()),
        x_scale="jac",
        max_nfev=_HELD,
    )
    return descent._replace(position=whole(result.x))


def _place(name: str) -> int:
    """The place of the effect that a parameter belongs to; -1 for the machine's own."""
    first, _, rest = name.partition(".")
    return int(rest.partition(".")[0]) if first == "effects" else -1
