"""One objective, minimised by several methods: is the gradient fit at the optimum?"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import jax
import numpy as np

from .._blocks import AbstractBlock
from .._computing import compiled, computing
from .._fit import Fit, fit_of, scores_of, settle_finely
from .._models import Model
from .._parameters import named_parameters
from .._prepare import (
    HistoryOption,
    Layout,
    Noise,
    Preparation,
    Problem,
    SearchOptions,
    free_parameters_of,
    layout_of,
    model_of,
    prepare_fit,
    recordings_of,
    require_whole_number,
)
from .._recording import InputError, Recording
from .._show import Shown, Table, View, figure
from .._solve import (
    Objective,
    Progress,
    Solved,
    fit_block,
    limit_compiled_programs,
    silent,
    solved_at,
    starts_on,
)
from ._bounded import bounded_lbfgs, require_jaxopt
from ._box import SearchResult, dimension, objective, with_bounded_gains, with_bounded_shapes
from ._evolution import DifferentialEvolution
from ._swarm import ParticleSwarm

SCHEMA = "fracjax.crosscheck/1"
TOLERANCE = 1e-4
"""Relative excess of an error over the best one up to which methods agree; chosen by judgement."""
_SMALLEST_POPULATION = 4
"""A mutant of the evolution needs three members besides the one that it challenges."""

Search = ParticleSwarm | DifferentialEvolution


@dataclass(frozen=True)
class Optimum:
    """Where one method ended.

    Attributes:
        method: Name of the method.
        rmse: Root mean square error (the papers' e_RMS), in the response's unit.
        e_r: Relative error ‖y - ŷ‖/‖y - mean‖.
        over_best: Square root of its χ² over that of the best method; the ratio of their e_RMS if
            the noise is white.
        agrees: Whether `over_best` is at most 1.0001.
        parameters: Values of the parameters by label, in their units.
        evaluations: Number of evaluations of the objective.
        derivatives: Whether each evaluation includes derivatives.
        seconds: Time [s] without compilation.
    """

    method: str
    rmse: float
    e_r: float
    over_best: float
    agrees: bool
    parameters: dict[str, float]
    evaluations: int
    derivatives: bool
    seconds: float


@dataclass(frozen=True, repr=False)
class Crosscheck(Shown):
    """The same objective minimised by several methods, the gradient fit first.

    Attributes:
        fit: The gradient fit; it carries `warning` if another method has a smaller error.
        rows: The result of each method.
        units: Units of the parameters, by label.
        bounds: Lower and upper bounds of the searches over all parameters, by label, in these
            units.
    """

    fit: Fit
    rows: tuple[Optimum, ...]
    units: dict[str, str]
    bounds: dict[str, tuple[float, float]]

    @property
    def best(self) -> Optimum:
        """The first of the methods that agree with the smallest objective."""
        return next(row for row in self.rows if row.agrees)

    @property
    def warning(self) -> str | None:
        """Why the gradient fit is not at the optimum; None if it is."""
        return next(iter(self.fit.warnings), None)

    def _view(self) -> View:
        rows = [
            [row.method, figure(row.rmse, 5), f"{row.over_best:.6g}", "yes" if row.agrees else "no"]
            for row in self.rows
        ]
        unit = self.fit.noise.unit
        table = Table(["", f"rmse [{unit}]", "over the best", "agrees"], rows)
        agree = sum(row.agrees for row in self.rows)
        sentence = f"{self.fit.model.name} by {len(self.rows)} methods, of which {agree} agree."
        return View(sentence, [table], self.fit.warnings)

    def to_dict(self) -> dict:
        """The result as plain data, as in crosscheck.json.

        Returns:
            A dictionary that JSON can store.
        """
        return {
            "schema": SCHEMA,
            "model": self.fit.model.name,
            "recordings": [take.recording.source for take in self.fit.preparation.takes],
            "best": self.best.method,
            "warning": self.warning,
            "rows": [asdict(row) for row in self.rows],
            "units": self.units,
            "bounds": {name: list(pair) for name, pair in self.bounds.items()},
            "fit": self.fit.to_dict(),
        }

    def save(self, path: str | Path) -> None:
        """Write the result as crosscheck.json.

        Args:
            path: The file to write.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def crosscheck(
    model: Model | str,
    recordings: Recording | Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    starts: int = 8,
    population: int = 40,
    iterations: int = 200,
    seed: int = 0,
    progress: Progress = silent,
    **options: Unpack[SearchOptions],
) -> Crosscheck:
    """Fit a model by gradients, bounded L-BFGS, a particle swarm and differential evolution.

    `fit` decides noise, history, settling and grid; then every method minimises the same χ² from
    its own starting points.  The swarm and the evolution search twice: with the gains eliminated,
    as in the gradient fit, and over all parameters, as in the papers.  A recording's own offset is
    always eliminated.

    Args:
        model: The model, or its name.
        recordings: One recording or several, each with drive and response (N,) in their units.
        noise: The noise, or its standard deviation in the response's unit, as in `fit`.
        history: Assumption on the prior history of the drive, as in `fit`.
        settling: Samples at the start that do not count, or a time such as "1 s", as in `fit`.
        starts: Starting points of each of the two gradient methods.
        population: Members of the swarm and of the evolution.
        iterations: Iterations of both; each takes `population` evaluations.
        seed: Seed of all random numbers.
        progress: Called with a line of text at each stage.
        **options: `fixed`, `bounds`, `weights` and `mask`, as in `fit`.

    Returns:
        The gradient fit, and the optimum of each method; errors are in the response's unit.

    Raises:
        InputError: Parameters are tied, have priors, or differ between recordings; no parameter but
            gains is free; the population or the iterations are too few; jaxopt is not installed; or
            as `fit`.
    """
    listed = recordings_of(recordings)
    model = model_of(model, listed)
    starts, seed = require_whole_number(starts, "starts", 1), require_whole_number(seed, "seed", 0)
    require_jaxopt()  # checked before the long fits
    with computing():
        block, preparation = prepare_fit(
            model, listed, noise=noise, history=history, settling=settling, **options
        )
        _require_no_conditions(block, preparation)
        _require_searchable(model.name, block, population, iterations)
        progress(f"fitting {model.name}")
        settled, _ = settle_finely(
            block, preparation, history=history, starts=starts, seed=seed, progress=progress
        )
        preparation = settled.preparation
        block = with_bounded_shapes(block, settled.block)
        # Fitted again with these settings, to be timed without compilation as the others are.
        start_time = time.perf_counter()
        solved = fit_block(block, preparation, starts, seed)
        results = [_MethodResult("gradient fit", solved, True, time.perf_counter() - start_time)]
        progress("fitting by bounded L-BFGS")
        problems = preparation.problems()
        results.append(
            _result_of_bounded(starts_on(block, preparation, starts, seed), problems, preparation)
        )
        all_free = with_bounded_gains(solved.block, problems)
        spaces = {"gains eliminated": block}
        if layout_of(block).gains:
            spaces["all parameters"] = all_free
        searches: dict[str, Search] = {
            "PSO": ParticleSwarm(population, iterations),
            "DE": DifferentialEvolution(population, iterations),
        }
        generator = np.random.default_rng(seed)
        for name, search in searches.items():
            for space, search_block in spaces.items():
                method = f"{name}, {space}"
                progress(f"searching by {method}")
                results.append(
                    _result_of_search(method, search, search_block, preparation, generator)
                )
        return _crosscheck_of(model, results, layout_of(block), all_free)


def _require_no_conditions(block: AbstractBlock, preparation: Preparation) -> None:
    """Raise InputError for priors, ties and parameters that differ between recordings."""
    conditions = preparation.conditions
    own = free_parameters_of(block, len(preparation.takes), conditions).own
    unsupported = {"priors": conditions.priors, "tied": conditions.ties, "own": own}
    if any(unsupported.values()):
        raise InputError(
            "crosscheck: expected parameters that are fixed or bounded only, found "
            f"{', '.join(name for name, names in unsupported.items() if names)}; the searches "
            "cannot use these, leave them out"
        )


def _require_searchable(name: str, block: AbstractBlock, population: int, iterations: int) -> None:
    """Raise InputError if only gains are free, or if the population or iterations are too few."""
    if dimension(block) == 0:
        raise InputError(
            f"{name}: expected a free parameter that is no gain, found none; a linear fit needs no "
            "cross-check; free another parameter to use it"
        )
    if population < _SMALLEST_POPULATION or iterations < 1:
        raise InputError(
            f"crosscheck: expected a population of at least {_SMALLEST_POPULATION} and at least 1 "
            f"iteration, found {population} and {iterations}; give more"
        )


@dataclass(frozen=True)
class _MethodResult:
    """The result of one method and its cost.

    `derivatives` says whether each evaluation includes derivatives; `seconds` is the time [s]
    without compilation.
    """

    method: str
    solved: Solved
    derivatives: bool
    seconds: float


def _result_of_bounded(
    starts: list[AbstractBlock], problems: tuple[Problem, ...], preparation: Preparation
) -> _MethodResult:
    """Bounded L-BFGS from all starts, timed after a first run that compiles it."""
    bounded_lbfgs(starts[:1], problems)  # compiles it
    result, seconds = _with_time(lambda: bounded_lbfgs(starts, problems))
    solved = _as_solved(starts[0], result, preparation)
    return _MethodResult("bounded L-BFGS", solved, True, seconds)


def run_search(
    search: Search, block: AbstractBlock, problems: tuple[Problem, ...], draws: Any
) -> SearchResult:
    """A search over the block's shapes with these random numbers, to be compiled as one program."""
    return search(objective(block, problems), draws)


_run_search = compiled(run_search)


def _result_of_search(
    method: str,
    search: Search,
    block: AbstractBlock,
    preparation: Preparation,
    generator: np.random.Generator,
) -> _MethodResult:
    """One search over the block's shapes, timed without its compilation."""
    limit_compiled_programs()
    draws = search.draw(dimension(block), generator)
    arguments = (search, block, preparation.problems(), draws)
    program = _run_search.prepared(*arguments)
    result, seconds = _with_time(lambda: jax.block_until_ready(program()))
    return _MethodResult(method, _as_solved(block, result, preparation), False, seconds)


def _with_time(run: Callable[[], SearchResult]) -> tuple[SearchResult, float]:
    """The result of a search and its time [s]."""
    start_time = time.perf_counter()
    return run(), time.perf_counter() - start_time


def _as_solved(block: AbstractBlock, result: SearchResult, preparation: Preparation) -> Solved:
    """The result of a search as that of a fit, converged if its objective is finite."""
    return solved_at(
        Objective(block, preparation.problems(), preparation.conditions),
        np.asarray(result.position),
        preparation,
        converged=bool(np.isfinite(result.cost)),
        costs=(float(result.cost),),
        evaluations=int(result.evaluations),
    )


def _crosscheck_of(
    model: Model,
    results: list[_MethodResult],
    layout: Layout,
    all_free: AbstractBlock,
) -> Crosscheck:
    """All methods compared with the best, and a warning if the gradient fit does not agree."""
    least = min(result.solved.cost for result in results)
    rows = []
    for result in results:
        scores = scores_of(result.solved)
        ratio = float(np.sqrt(result.solved.cost / least))
        rows.append(
            Optimum(
                method=result.method,
                rmse=scores.rmse,
                e_r=scores.e_r,
                over_best=ratio,
                agrees=ratio <= 1 + TOLERANCE,
                parameters=_by_label(result.solved.block, layout, "value"),
                evaluations=result.solved.evaluations,
                derivatives=result.derivatives,
                seconds=result.seconds,
            )
        )
    fit = fit_of(model, results[0].solved)
    low, high = (_by_label(all_free, layout, end) for end in ("lower", "upper"))
    return Crosscheck(
        fit=replace(fit, warnings=_warnings(model.name, rows)),
        rows=tuple(rows),
        units={estimate.name: estimate.unit for estimate in fit.estimates},
        bounds={label: (low[label], high[label]) for label in low},
    )


def _warnings(name: str, rows: list[Optimum]) -> tuple[str, ...]:
    """A warning if the gradient fit does not agree with the best method."""
    gradient, best = rows[0], min(rows, key=lambda row: row.over_best)
    if gradient.agrees:
        return ()
    return (
        f"The gradient fit of {name} is not at the optimum: its error is "
        f"{gradient.over_best:.6g} times that of {best.method}; fit again from more starts or with "
        "another seed.",
    )


def _by_label(block: AbstractBlock, layout: Layout, field: str) -> dict[str, float]:
    """An attribute of the free parameters by label: `name`, or `name[k]` for a vector."""
    parameters = named_parameters(block)
    free = [parameters[name] for name, _ in layout.shapes + layout.gains]
    fields = [np.ravel(np.broadcast_to(getattr(p, field), np.shape(p.value))) for p in free]
    return dict(zip(layout.labels(block), np.concatenate(fields).tolist(), strict=True))
