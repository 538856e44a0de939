"""One objective, minimised in five ways: does the gradient fit stand at the optimum?"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import equinox as eqx
import jax
import numpy as np

from .._blocks import AbstractBlock
from .._computing import compiler_options, computing
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
from .._solve import (
    Objective,
    Progress,
    Solved,
    fit_block,
    limit_compiled_programs,
    silent,
    solved_at,
    starts_of,
)
from ._bounded import bounded, require_jaxopt
from ._box import Found, dimension, objective, with_bounded_gains, with_bounded_shapes
from ._evolution import DifferentialEvolution
from ._swarm import ParticleSwarm

SCHEMA = "fracjax.crosscheck/1"
TOLERANCE = 1e-4
_SMALLEST_POPULATION = 4

Search = ParticleSwarm | DifferentialEvolution


@dataclass(frozen=True)
class Optimum:
    """Where one method ended.

    rmse (the papers' e_RMS) in the response's unit and e_r = ‖y-ŷ‖/‖y - mean‖; `over_best` is the
    square root of its objective over the best method's: the ratio of the e_RMS where the noise is
    white, and of what was minimised in any case.  `agrees` where that is 1.0001 at most.
    `evaluations` of the objective, each with its derivatives where `derivatives` says so; `seconds`
    without compilation.
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


@dataclass(frozen=True)
class Crosscheck:
    """The same objective minimised by several methods, the gradient fit first.

    `fit` is the gradient fit, and carries `warning` where another method beats it.  `units` and
    `bounds` (of the searches that move all parameters) are by parameter.
    """

    fit: Fit
    rows: tuple[Optimum, ...]
    units: dict[str, str]
    bounds: dict[str, tuple[float, float]]

    @property
    def best(self) -> Optimum:
        """The first of the methods that agree with the least objective."""
        return next(row for row in self.rows if row.agrees)

    @property
    def warning(self) -> str | None:
        """What speaks against the gradient fit, if anything does."""
        return next(iter(self.fit.warnings), None)

    def to_dict(self) -> dict:
        """Plain data, as in crosscheck.json."""
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
        """Write crosscheck.json."""
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
    **asked: Unpack[SearchOptions],
) -> Crosscheck:
    """Fit a model by gradients, by bounded L-BFGS, by a particle swarm and by evolution.

    `fit` decides noise, history, settling and grid; then every method minimises the same χ², from
    its own starts: `starts` points for the two that follow gradients, `population` × `iterations`
    evaluations for the others.  These search twice: with gains eliminated, as the gradient fit
    does, and over all parameters, as the papers do.  A recording's own offset is always eliminated.
    Arguments as in `fit`, of what is `asked` those that every search knows: fixed, bounds, weights
    and mask.  Errors are in the response's unit.  Raises InputError for others, where jaxopt is not
    installed, and as `fit` does.
    """
    listed = recordings_of(recordings)
    model = model_of(model, listed)
    starts, seed = require_whole_number(starts, "starts", 1), require_whole_number(seed, "seed", 0)
    require_jaxopt()  # before minutes are spent
    with computing():
        block, preparation = prepare_fit(
            model, listed, noise=noise, history=history, settling=settling, **asked
        )
        _require_plain(block, preparation)
        _require_searchable(model.name, block, population, iterations)
        progress(f"fitting {model.name}")
        first, _ = settle_finely(
            block, preparation, history=history, starts=starts, seed=seed, progress=progress
        )
        preparation = first.preparation
        block = with_bounded_shapes(block, first.block)
        # Once more on what was settled, as the others will: its programs are compiled by now.
        began = time.perf_counter()
        solved = fit_block(block, preparation, starts, seed)
        ways = [_Way("gradient fit", solved, True, time.perf_counter() - began)]
        progress("fitting by bounded L-BFGS")
        problems = preparation.problems()
        ways.append(_by_bounded(starts_of(block, starts, seed), problems, preparation))
        freed = with_bounded_gains(solved.block, problems)
        spaces = {"gains eliminated": block}
        if layout_of(block).gains:
            spaces["all parameters"] = freed
        searches: dict[str, Search] = {
            "PSO": ParticleSwarm(population, iterations),
            "DE": DifferentialEvolution(population, iterations),
        }
        generator = np.random.default_rng(seed)
        for name, search in searches.items():
            for space, searched in spaces.items():
                method = f"{name}, {space}"
                progress(f"searching by {method}")
                ways.append(_by_search(method, search, searched, preparation, generator))
        return _compared(model, ways, layout_of(block), freed)


def _require_plain(block: AbstractBlock, preparation: Preparation) -> None:
    asked = preparation.conditions
    own = free_parameters_of(block, len(preparation.takes), asked).own
    told = {"priors": asked.priors, "tied": asked.ties, "own": own}
    if any(told.values()):
        raise InputError(
            "crosscheck: expected parameters fixed or bounded at most, found "
            f"{', '.join(name for name, names in told.items() if names)}; the searches know none "
            "of these, leave them out"
        )


def _require_searchable(name: str, block: AbstractBlock, population: int, iterations: int) -> None:
    if dimension(block) == 0:
        raise InputError(
            f"{name}: expected a free parameter that is no gain, found none; a linear fit needs no "
            "cross-check, or set one free"
        )
    if population < _SMALLEST_POPULATION or iterations < 1:
        raise InputError(
            f"crosscheck: expected a population of at least {_SMALLEST_POPULATION} and at least 1 "
            f"iteration, found {population} and {iterations}; give more"
        )


@dataclass(frozen=True)
class _Way:
    """What one method solved, and what it took."""

    method: str
    solved: Solved
    derivatives: bool
    seconds: float


def _by_bounded(
    starts: list[AbstractBlock], problems: tuple[Problem, ...], preparation: Preparation
) -> _Way:
    bounded(starts[:1], problems)  # compiles
    found, seconds = _timed(lambda: bounded(starts, problems))
    solved = _solved(starts[0], found, preparation)
    return _Way("bounded L-BFGS", solved, True, seconds)


def searched(
    search: Search, block: AbstractBlock, problems: tuple[Problem, ...], draws: Any
) -> Found:
    """A search over the block's shapes, with its own draws, as one compiled program."""
    return search(objective(block, problems), draws)


def _by_search(
    method: str,
    search: Search,
    block: AbstractBlock,
    preparation: Preparation,
    generator: np.random.Generator,
) -> _Way:
    limit_compiled_programs()
    draws = search.draw(dimension(block), generator)
    arguments = (search, block, preparation.problems(), draws)
    # Equinox hands on what its types do not say.
    run: Any = eqx.filter_jit(searched, compiler_options=compiler_options())  # type: ignore
    program = run.lower(*arguments).compile()
    found, seconds = _timed(lambda: jax.block_until_ready(program(*arguments)))
    return _Way(method, _solved(block, found, preparation), False, seconds)


def _timed(run: Callable[[], Found]) -> tuple[Found, float]:
    began = time.perf_counter()
    return run(), time.perf_counter() - began


def _solved(block: AbstractBlock, found: Found, preparation: Preparation) -> Solved:
    """A search's end as a fit's: it ends by its budget, and has no other criterion."""
    return solved_at(
        Objective(block, preparation.problems(), preparation.conditions),
        np.asarray(found.position),
        preparation,
        converged=bool(np.isfinite(found.cost)),
        costs=(float(found.cost),),
        evaluations=int(found.evaluations),
    )


def _compared(
    model: Model,
    ways: list[_Way],
    layout: Layout,
    freed: AbstractBlock,
) -> Crosscheck:
    """All methods beside the best of them, and a warning on the fit that is not among the best."""
    least = min(way.solved.cost for way in ways)
    rows = []
    for way in ways:
        scores = scores_of(way.solved)
        ratio = float(np.sqrt(way.solved.cost / least))
        rows.append(
            Optimum(
                method=way.method,
                rmse=scores.rmse,
                e_r=scores.e_r,
                over_best=ratio,
                agrees=ratio <= 1 + TOLERANCE,
                parameters=_labelled(way.solved.block, layout, "value"),
                evaluations=way.solved.evaluations,
                derivatives=way.derivatives,
                seconds=way.seconds,
            )
        )
    fit = fit_of(model, ways[0].solved)
    low, high = (_labelled(freed, layout, end) for end in ("lower", "upper"))
    return Crosscheck(
        fit=replace(fit, warnings=_warnings(model.name, rows)),
        rows=tuple(rows),
        units={estimate.name: estimate.unit for estimate in fit.estimates},
        bounds={label: (low[label], high[label]) for label in layout.labels},
    )


def _warnings(name: str, rows: list[Optimum]) -> tuple[str, ...]:
    gradient, best = rows[0], min(rows, key=lambda row: row.over_best)
    if gradient.agrees:
        return ()
    return (
        f"The gradient fit of {name} is not at the optimum: its error is "
        f"{gradient.over_best:.6g} times that of {best.method}; fit again from more starts or with "
        "another seed.",
    )


def _labelled(block: AbstractBlock, layout: Layout, field: str) -> dict[str, float]:
    """A field of the free parameters by label: `name`, or `name[k]` of a vector."""
    parameters = named_parameters(block)
    free = [parameters[name] for name, _ in layout.shapes + layout.gains]
    fields = [np.ravel(np.broadcast_to(getattr(p, field), np.shape(p.value))) for p in free]
    return dict(zip(layout.labels, np.concatenate(fields).tolist(), strict=True))
