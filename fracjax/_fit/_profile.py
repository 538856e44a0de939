"""Profile likelihood: the rise of χ² as one parameter is held and all others are fitted.

    Δ(v) = (min_{θ_i = v} χ² - min χ²) / f²,     68 %: Δ ≤ 1,   95 %: Δ ≤ 3.84

f is the ratio of the parameter's standard error to the one from χ² alone, so that mismatch and
coloured residuals widen the profile as they widen the error.

Sources: Venzon & Moolgavkar, Appl. Stat. 37 (1988) 87; Raue et al., Bioinformatics 25 (2009) 1923.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.special import ndtri

from .._blocks import AbstractBlock
from .._computing import computing, map_in_threads
from .._naming import path_of_name
from .._parameters import Parameter, named_parameters, replace_parameters
from .._prepare import Conditions, Preparation
from .._recording import InputError, closest, require_kind
from .._solve import Progress, silent, solve_from
from ._fit import Fit
from ._result import Interval, Profile
from ._uncertainty import Estimate, uncertainty_of

_MOST_POINTS = 14
"""Most points of a profile on one side.  Chosen by judgement."""
_STEP = 0.5
"""Change of √Δ from one point to the next."""
_FARTHEST = 2.2
"""√Δ at which a profile ends, above the 1.96 of the 95 % interval."""
_LONGEST, _SHORTEST = 3.0, 0.4
"""Largest and smallest ratio of a step to the one before.  Chosen by judgement."""
_PARTS = 12
"""A step is at most this fraction of the distance between the bounds.  Chosen by judgement."""
_BETTER = 0.05
"""Decrease of Δ below the fit from which the fit counts as short of the optimum.  Chosen by
judgement."""
_REACH = 1.96
"""√Δ at the ends of the 95 % interval."""
_CLOSE_TO_REACH = 0.01
"""Largest distance of √Δ from `_REACH` at the last secant; the rest is a straight line, which is
true to 0.2 % of the interval where √Δ bends by a third on its way."""
_SECANTS = 8
"""Most secants for an end.  Chosen by judgement."""
_BOUNDS_FACTOR = 1e3
"""Factor by which an interval's end may exceed the bounds of a logarithmic parameter.  Chosen by
judgement."""
_LEAST_STRETCH, _LARGEST_STRETCH = 1.1, 3.0
"""Least and largest growth of the distance as long as √Δ has not exceeded `_REACH`."""
_LEAST_SHARE = 0.2
"""Least share of the distance between the points on both sides that a secant advances."""
_COARSER = 8
"""The profile's width is computed with oversampling reduced by this factor."""


def with_profiles(fit: Fit, names: Iterable[str], progress: Progress = silent) -> Fit:
    """The fit with profiles of the named parameters, and a warning where one reached a better fit.

    Args:
        fit: the fit.
        names: names of parameters that are single values shared by all recordings.
        progress: called with a sentence at each parameter.

    Returns:
        The fit with the profiles, each in its parameter's unit.

    Raises:
        InputError: where a name is no such parameter.

    Source: Venzon & Moolgavkar, Appl. Stat. 37 (1988) 87.
    """
    profiles = []
    for name in names:
        progress(f"profile of {name}")
        profiles.append(profile(fit, name))
    better = [p.name for p in profiles if p.lower_found]
    warnings = (
        f"The profile of {', '.join(better)} reached a smaller χ² than the fit of "
        f"{fit.model.name}; fit again with more starts or another seed.",
    )
    return replace(
        fit, profiles=tuple(profiles), warnings=fit.warnings + (warnings if better else ())
    )


def with_profiled_intervals(fit: Fit, names: Iterable[str]) -> Fit:
    """The fit with 95 % intervals that end where the profiles of parameters reach 3.84.

    `names` are the places of the parameters in the composition, as in `Estimate.path`.

    A time constant near the recording's length, or a threshold near the drive's peak, is known far
    better on one side than on the other, which a standard error cannot express.  Parameters that
    are not identified, that belong to one recording or that are part of a vector keep their
    interval.  If another parameter ended at its bound, no interval is shorter than that from the
    standard error: the noise may have moved that parameter to its bound, where a profile does not
    vary it.
    """
    single = named_parameters(fit.model.block).keys() & set(names)
    selected = [k for k, e in enumerate(fit.estimates) if e.path in single and e.identified]
    if not selected:
        return fit
    curvatures = _curvatures(fit)
    # The rise of χ² hardly depends on the grid; only the position of its minimum does.
    coarse = fit.weighed.with_oversampling(max(1, fit.weighed.oversampling // _COARSER))
    block = solve_from([fit.model.block], coarse).block

    def end(which: tuple[int, int]) -> float:
        """The value at one end of a parameter's interval."""
        k, side = which
        estimate = fit.estimates[k]
        constrained = _ConstrainedFit(estimate, block, coarse, _BOUNDS_FACTOR)
        factor = (estimate.standard_error / curvatures[k]) ** 2
        reach = _end(constrained, constrained.at(0.0), factor, side)
        return _ConstrainedFit(estimate, fit.model.block, fit.weighed, _BOUNDS_FACTOR).value(reach)

    ends = iter(map_in_threads(end, [(k, side) for k in selected for side in (-1, 1)]))
    estimates = list(fit.estimates)
    for k in selected:
        low, high = next(ends), next(ends)
        if any(e.at_bound for e in (*estimates[:k], *estimates[k + 1 :])):
            low, high = min(low, estimates[k].interval[0]), max(high, estimates[k].interval[1])
        estimates[k] = replace(estimates[k], ends=(low, high))
    return replace(fit, estimates=tuple(estimates))


def profile(fit: Fit, name: str) -> Profile:
    """The profile likelihood of one parameter, from the fit outwards on both sides.

    The weights of a robust loss are held.

    Args:
        fit: the fit.
        name: the name of a parameter that is a single value shared by all recordings.

    Returns:
        The profile, its values in the parameter's unit.

    Raises:
        InputError: where the name is no such parameter, or `fit` is no fit.

    Source: Venzon & Moolgavkar, Appl. Stat. 37 (1988) 87.
    """
    require_kind(fit, Fit, "fit", "fit a model first")
    parameters = named_parameters(fit.model.block)
    single = {e.path: k for k, e in enumerate(fit.estimates) if e.path in parameters}
    path = path_of_name(name, fit.model.block)
    if path not in single:
        names = [fit.estimates[k].name for k in single.values()]
        raise InputError.at(
            f'profile of "{name}"',
            f"one of {', '.join(names)}",
            f"none of that name{closest(name, names)}",
            "correct it",
        )
    with computing():
        at = single[path]
        estimate = fit.estimates[at]
        constrained = _ConstrainedFit(estimate, fit.model.block, fit.weighed)
        centre = constrained.at(0.0)
        factor = (estimate.standard_error / _curvatures(fit)[at]) ** 2
        low, high = (_walk(constrained, centre, factor, side) for side in (-1, 1))
    z = np.array([*low[0][::-1], 0.0, *high[0]])
    delta = np.array([*low[1][::-1], 0.0, *high[1]])
    values = np.array([constrained.value(place) for place in z])
    lower = float(delta.min())
    return Profile(
        name=estimate.name,
        unit=estimate.unit,
        estimate=estimate.value,
        standard_error=estimate.standard_error,
        values=values,
        delta=delta - lower,
        interval_68=_interval(values, delta - lower, 0.68),
        interval_95=_interval(values, delta - lower, 0.95),
        lower_found=lower < -_BETTER,
    )


def _curvatures(fit: Fit) -> np.ndarray:
    """The standard errors (n,) of the fit's estimates from χ² alone."""
    preparation = fit.weighed
    blocks = tuple(model.block for model in fit.models)
    problems, conditions = preparation.problems(), preparation.conditions
    return uncertainty_of(blocks, problems, conditions, units=("1", "1"), inflation=1.0).curvature


class _ConstrainedFit:
    """The best fit with one parameter held, at a distance from the estimate in standard errors.

    A logarithmic parameter may exceed its bounds by a factor `beyond`, because they only limit the
    search.
    """

    def __init__(
        self,
        estimate: Estimate,
        block: AbstractBlock,
        preparation: Preparation,
        beyond: float = 1.0,
    ):
        self.block, self.name, self.error = block, estimate.path, estimate.standard_error
        name, parameter = self.name, named_parameters(block)[self.name]
        self.parameter = parameter
        beyond = beyond if parameter.logarithmic else 1.0
        self.lower = np.asarray(parameter.lower).item() / beyond
        self.upper = np.asarray(parameter.upper).item() * beyond
        conditions = preparation.conditions
        # Parameters that are tied to it are held with it.
        self.followers = {n: f for n, (source, f) in conditions.ties.items() if source == name}
        self.prior = conditions.priors.get(name)
        self.preparation = replace(
            preparation,
            conditions=Conditions(
                {n: tie for n, tie in conditions.ties.items() if n not in self.followers},
                conditions.own,
                {n: p for n, p in conditions.priors.items() if n not in (name, *self.followers)},
            ),
        )
        self.followers_priors = {
            n: conditions.priors[n] for n in self.followers if n in conditions.priors
        }

    def value(self, z: float) -> float:
        """The value `z` standard errors from the estimate, within the bounds."""
        start = np.asarray(self.parameter.value).item()
        if self.parameter.logarithmic:
            moved = start * np.exp(np.clip(z * self.error / start, -300, 300))
        else:
            moved = start + z * self.error
        return float(np.clip(moved, self.lower, self.upper))

    @property
    def longest(self) -> float:
        """The longest step [standard errors]."""
        if not self.parameter.bounded:
            return np.inf
        return np.asarray(self.parameter.slope()).item() / self.error / _PARTS

    def at(self, z: float) -> float:
        """χ² plus the share of the priors, all other parameters at their optimum."""
        value = self.value(z)
        fixed = {self.name: value} | {n: f * value for n, f in self.followers.items()}
        solved = solve_from([_with_fixed(self.block, fixed)], self.preparation)
        # The next point starts where this one ended.
        self.block = solved.block
        priors = self.followers_priors | ({} if self.prior is None else {self.name: self.prior})
        return min(solved.start_costs) + sum(
            float(((fixed[n] - p.mean) / p.sd) ** 2) for n, p in priors.items()
        )


def _with_fixed(block: AbstractBlock, values: Mapping[str, float]) -> AbstractBlock:
    """The block with parameters fixed at values."""
    parameters = named_parameters(block)
    return replace_parameters(
        block,
        {
            n: Parameter(
                np.full(np.shape(parameters[n].value), v),
                parameters[n].unit,
                lower=np.minimum(parameters[n].lower, v),
                upper=np.maximum(parameters[n].upper, v),
                logarithmic=parameters[n].logarithmic,
                fixed=True,
            )
            for n, v in values.items()
        },
    )


def _walk(
    constrained: _ConstrainedFit, centre: float, factor: float, side: int
) -> tuple[list[float], list[float]]:
    """Places [standard errors] and Δ on one side, until Δ exceeds 95 % or the bound is reached."""
    places: list[float] = []
    deltas: list[float] = []
    block, z, step, root = constrained.block, 0.0, min(_STEP, constrained.longest), 0.0
    for _ in range(_MOST_POINTS):
        previous, z = z, z + step
        if constrained.value(side * z) == constrained.value(side * previous):
            break
        places.append(side * z)
        deltas.append((constrained.at(side * z) - centre) / factor)
        current = np.sqrt(max(deltas[-1], 0.0))
        if current > _FARTHEST:
            break
        step *= np.clip(_STEP / max(current - root, 1e-9), _SHORTEST, _LONGEST)
        step = min(step, constrained.longest)
        root = current
    constrained.block = block
    return places, deltas


def _end(constrained: _ConstrainedFit, centre: float, factor: float, side: int) -> float:
    """The distance [standard errors] at which √Δ reaches 1.96 on one side.

    It is found by secants, starting where a straight √Δ would reach it.  It is the parameter's
    bound where √Δ stays below.
    """
    z, inside, outside, block = _REACH, (0.0, 0.0), None, constrained.block
    for _ in range(_SECANTS):
        # Start from the last point below `_REACH`: beyond it the fit may be at another optimum.
        constrained.block = block
        rise = (constrained.at(side * z) - centre) / factor
        root = float(np.sqrt(rise)) if rise > 0 else 0.0
        if abs(root - _REACH) < _CLOSE_TO_REACH:
            return side * z * _REACH / root
        if root > _REACH:
            outside = z, root
        elif constrained.value(side * z) in (constrained.lower, constrained.upper):
            break
        else:
            inside, block = (z, root), constrained.block
        if outside is None:
            z *= float(np.clip(_REACH / max(root, 1e-9), _LEAST_STRETCH, _LARGEST_STRETCH))
        else:
            share = (_REACH - inside[1]) / (outside[1] - inside[1])
            z = inside[0] + max(share, _LEAST_SHARE) * (outside[0] - inside[0])
    return side * z


def _interval(values: np.ndarray, delta: np.ndarray, level: float) -> Interval:
    """Where Δ crosses the level on either side of its minimum, by interpolation of √Δ."""
    reach = float(ndtri(0.5 + level / 2))
    middle, root = int(np.argmin(delta)), np.sqrt(delta)
    ends: list[float | None] = []
    for side in (slice(middle, None, -1), slice(middle, None)):
        rising = np.maximum.accumulate(root[side])
        end = float(np.interp(reach, rising, values[side]))
        ends.append(end if rising[-1] >= reach else None)
    return ends[0], ends[1]
