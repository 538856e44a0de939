r"""Profile likelihood: how χ² rises as one parameter is held and all others follow.

    Δ(v) = (min_{θ_i = v} χ² - min χ²) / f²,     68 %: Δ ≤ 1,   95 %: Δ ≤ 3.84

f is the ratio of the parameter's standard error to the one that χ² alone gives it, so that mismatch
and coloured residuals widen the profile as they widen the error.
Sources: Venzon & Moolgavkar, Appl. Stat. 37 (1988) 87; Raue et al., Bioinformatics 25 (2009) 1923.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from scipy.stats import norm

from .._blocks import AbstractBlock
from .._computing import computing, map_in_threads
from .._parameters import Parameter, named_parameters, replace_parameters
from .._prepare import Conditions, Preparation
from .._recording import InputError, require_kind
from .._solve import Progress, silent, solve_from
from ._fit import Fit
from ._result import Interval, Profile
from ._uncertainty import Estimate, uncertainty_of

_MOST = 14
_STEP = 0.5
"""Of √Δ from one point to the next."""
_BEYOND = 2.2
_LONGEST, _SHORTEST = 3.0, 0.4
_PARTS = 12
"""In which a step never takes more than one of the way between the bounds."""
_LOWER = 0.05
_REACH = 1.96
_NEAR = 0.03
"""As near to it as √Δ is looked for; the rest is a straight line."""
_LOOKS = 8
_BEYOND_BOUNDS = 1e3
_LEAST_STRETCH, _LARGEST_STRETCH = 1.1, 3.0
_LEAST_SHARE = 0.2
_COARSER = 8


def with_profiles(fit: Fit, names: Iterable[str], progress: Progress = silent) -> Fit:
    """The fit with profiles of the named parameters, and a warning where one found a better fit.

    Each profile is in its parameter's unit.  Raises InputError as `profile` does.
    """
    found = []
    for name in names:
        progress(f"profile of {name}")
        found.append(profile(fit, name))
    better = [p.name for p in found if p.lower_found]
    warnings = (
        f"The profile of {', '.join(better)} found a better fit of {fit.model.name} than the fit; "
        "fit again from more starts or with another seed.",
    )
    return replace(fit, profiles=tuple(found), warnings=fit.warnings + (warnings if better else ()))


def with_profiled_intervals(fit: Fit, names: Iterable[str]) -> Fit:
    """The fit with 95 % intervals of the named numbers that end where their profiles reach 3.84.

    A time constant near the recording's length, or a threshold near the drive's peak, is known far
    better on one side than on the other, which no standard error tells.  Numbers that the data
    leave open, that are one recording's own or part of a vector keep the interval that they have.
    Beside another number that ended at its bound no interval is shorter than its standard error
    tells: the noise may have put that one there, and a profile does not see it move.
    """
    single = named_parameters(fit.model.block).keys() & set(names)
    wanted = [k for k, e in enumerate(fit.estimates) if e.name in single and e.identified]
    if not wanted:
        return fit
    curvatures = _curvatures(fit)
    # How fast χ² rises hardly depends on the grid, only where it is least does.
    coarse = fit.weighed.with_oversampling(max(1, fit.weighed.oversampling // _COARSER))
    block = solve_from([fit.model.block], coarse).block

    def end(which: tuple[int, int]) -> float:
        k, side = which
        estimate = fit.estimates[k]
        held = _Held(estimate, block, coarse, _BEYOND_BOUNDS)
        factor = (estimate.standard_error / curvatures[k]) ** 2
        reach = _end(held, held.at(0.0), factor, side)
        return _Held(estimate, fit.model.block, fit.weighed, _BEYOND_BOUNDS).value(reach)

    ends = iter(map_in_threads(end, [(k, side) for k in wanted for side in (-1, 1)]))
    told = list(fit.estimates)
    for k in wanted:
        low, high = next(ends), next(ends)
        if any(e.at_bound for e in (*told[:k], *told[k + 1 :])):
            low, high = min(low, told[k].interval[0]), max(high, told[k].interval[1])
        told[k] = replace(told[k], ends=(low, high))
    return replace(fit, estimates=tuple(told))


def profile(fit: Fit, name: str) -> Profile:
    """The profile likelihood of one parameter, from the fit outwards on both sides.

    Its values are in the parameter's unit.  Of a robust loss the weights are held.  Raises
    InputError where the name is none of the fit's single numbers that all recordings share.
    """
    require_kind(fit, Fit, "fit", "fit a model first")
    labels = [estimate.name for estimate in fit.estimates]
    parameters = named_parameters(fit.model.block)
    if name not in labels or name not in parameters:
        raise InputError.at(
            f'profile of "{name}"',
            f"one of {', '.join(label for label in labels if label in parameters)}",
            "none of that name",
            "correct it",
        )
    with computing():
        at = labels.index(name)
        estimate = fit.estimates[at]
        held = _Held(estimate, fit.model.block, fit.weighed)
        centre = held.at(0.0)
        factor = (estimate.standard_error / _curvatures(fit)[at]) ** 2
        low, high = (_walk(held, centre, factor, side) for side in (-1, 1))
    z = np.array([*low[0][::-1], 0.0, *high[0]])
    delta = np.array([*low[1][::-1], 0.0, *high[1]])
    values = np.array([held.value(place) for place in z])
    lower = float(delta.min())
    return Profile(
        name=name,
        unit=estimate.unit,
        estimate=estimate.value,
        standard_error=estimate.standard_error,
        values=values,
        delta=delta - lower,
        interval_68=_interval(values, delta - lower, 0.68),
        interval_95=_interval(values, delta - lower, 0.95),
        lower_found=lower < -_LOWER,
    )


def _curvatures(fit: Fit) -> np.ndarray:
    """The errors (n,) that χ² alone gives the fit's estimates."""
    preparation = fit.weighed
    blocks = tuple(model.block for model in fit.models)
    problems, conditions = preparation.problems(), preparation.conditions
    return uncertainty_of(blocks, problems, conditions, units=("1", "1"), inflation=1.0).curvature


class _Held:
    """The best fit with one parameter held, at a distance from the estimate in standard errors.

    A logarithmic parameter may go by a factor `beyond` its bounds, which only say where to search.
    """

    def __init__(
        self,
        estimate: Estimate,
        block: AbstractBlock,
        preparation: Preparation,
        beyond: float = 1.0,
    ):
        self.block, self.name, self.error = block, estimate.name, estimate.standard_error
        name, parameter = self.name, named_parameters(block)[self.name]
        self.parameter = parameter
        beyond = beyond if parameter.logarithmic else 1.0
        self.lower = np.asarray(parameter.lower).item() / beyond
        self.upper = np.asarray(parameter.upper).item() * beyond
        asked = preparation.conditions
        # Those tied to it are held with it.
        self.followers = {n: f for n, (source, f) in asked.ties.items() if source == name}
        self.prior = asked.priors.get(name)
        self.preparation = replace(
            preparation,
            conditions=Conditions(
                {n: tie for n, tie in asked.ties.items() if n not in self.followers},
                asked.own,
                {n: p for n, p in asked.priors.items() if n not in (name, *self.followers)},
            ),
        )
        self.followers_priors = {n: asked.priors[n] for n in self.followers if n in asked.priors}

    def value(self, z: float) -> float:
        """The value `z` standard errors off, within the bounds."""
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
        """χ² and what the priors add, all other parameters at their best."""
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


def _walk(held: _Held, centre: float, factor: float, side: int) -> tuple[list[float], list[float]]:
    """Places [standard errors] and Δ to one side, until Δ is beyond 95 % or the bound is met."""
    places: list[float] = []
    deltas: list[float] = []
    block, z, step, root = held.block, 0.0, min(_STEP, held.longest), 0.0
    for _ in range(_MOST):
        before, z = z, z + step
        if held.value(side * z) == held.value(side * before):
            break
        places.append(side * z)
        deltas.append((held.at(side * z) - centre) / factor)
        now = np.sqrt(max(deltas[-1], 0.0))
        if now > _BEYOND:
            break
        step *= np.clip(_STEP / max(now - root, 1e-9), _SHORTEST, _LONGEST)
        step = min(step, held.longest)
        root = now
    held.block = block
    return places, deltas


def _end(held: _Held, centre: float, factor: float, side: int) -> float:
    """How far off [standard errors] √Δ reaches 1.96 to one side, by secants from where it would if
    it were straight; where the parameter's bound is, if it does not."""
    z, inside, outside, block = _REACH, (0.0, 0.0), None, held.block
    for _ in range(_LOOKS):
        # From where the fit was still good: beyond, it may have gone astray.
        held.block = block
        rise = (held.at(side * z) - centre) / factor
        root = float(np.sqrt(rise)) if rise > 0 else 0.0
        if abs(root - _REACH) < _NEAR:
            return side * z * _REACH / root
        if root > _REACH:
            outside = z, root
        elif held.value(side * z) in (held.lower, held.upper):
            break
        else:
            inside, block = (z, root), held.block
        if outside is None:
            z *= float(np.clip(_REACH / max(root, 1e-9), _LEAST_STRETCH, _LARGEST_STRETCH))
        else:
            share = (_REACH - inside[1]) / (outside[1] - inside[1])
            z = inside[0] + max(share, _LEAST_SHARE) * (outside[0] - inside[0])
    return side * z


def _interval(values: np.ndarray, delta: np.ndarray, level: float) -> Interval:
    """Where Δ crosses the level on either side of its minimum, by interpolation of √Δ."""
    reach = float(norm.ppf(0.5 + level / 2))
    middle, root = int(np.argmin(delta)), np.sqrt(delta)
    ends: list[float | None] = []
    for side in (slice(middle, None, -1), slice(middle, None)):
        rising = np.maximum.accumulate(root[side])
        end = float(np.interp(reach, rising, values[side]))
        ends.append(end if rising[-1] >= reach else None)
    return ends[0], ends[1]
