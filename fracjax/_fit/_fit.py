"""Fitting a model to recordings, and the result."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
import numpy as np

from .._blocks import AbstractBlock, Setting
from .._models import Model, parse_model
from .._parameters import Parameter, named_parameters, replace_parameters, set_values
from .._recording import InputError, Recording, require_units_of
from ._layout import layout_of
from ._least_squares import Objective, begin, descend, simulate
from ._noise import Noise, measured_noise, residual_noise
from ._preparation import Past, Preparation, Take, coarse_oversampling, other_histories, take_of
from ._programs import make_room
from ._search import search
from ._uncertainty import Estimate, estimates

SCHEMA = "fracjax.fit/1"
_ROUNDS = 20
_LOOKS = 12
_AGREED = 1e-3

Progress = Callable[[str], None]


def silent(message: str) -> None:
    """Report no progress."""


@dataclass(frozen=True)
class Scores:
    """How well a model reproduces a recording, over the samples that count.

    rmse (the papers' e_RMS) in the response's unit; e_r = ‖y-ŷ‖/‖y - mean‖; nrmse_percent is
    MATLAB's `compare`, 100 (1 - e_r); bic with the noise known.
    """

    rmse: float
    e_r: float
    nrmse_percent: float
    r_squared: float
    bic: float


@dataclass(frozen=True)
class Solved:
    """A block at its optimum, χ² and convergence.

    `own`: each recording's own coefficients (q,), its offset first; `simulations` (N,) hold them.
    `evaluations` counts how often the objective was computed, over all starts.
    """

    block: AbstractBlock
    own: tuple[np.ndarray, ...]
    simulations: tuple[np.ndarray, ...]
    cost: float
    converged: bool
    start_costs: tuple[float, ...]
    samples: int
    evaluations: int

    @property
    def bic(self) -> float:
        """χ² + k ln n, the noise known."""
        layout = layout_of(self.block)
        free = sum(size for _, size in layout.shapes + layout.gains) + sum(map(len, self.own))
        return self.cost + free * float(np.log(self.samples))


@dataclass(frozen=True)
class Fit:
    """A fitted model with its uncertainty, scores and the assumptions it rests on.

    `simulations` are the model's responses at the recordings' samples, offset included, in the
    response's unit; `correlated` names parameters that the data only know together; `warnings` are
    what later checks held against it.
    """

    model: Model
    preparation: Preparation
    estimates: tuple[Estimate, ...]
    correlated: tuple[str, ...]
    offsets: tuple[float, ...]
    simulations: tuple[np.ndarray, ...]
    scores: Scores
    converged: bool
    start_costs: tuple[float, ...]
    warnings: tuple[str, ...] = ()

    @property
    def residuals(self) -> tuple[np.ndarray, ...]:
        """Measured minus simulated, (N,) per recording, in the response's unit."""
        pairs = zip(self.preparation.takes, self.simulations, strict=True)
        return tuple(take.recording.response - simulation for take, simulation in pairs)

    def to_dict(self) -> dict:
        """Plain data, as in fit.json."""
        first = self.preparation.takes[0]
        noise = first.noise
        assert noise is not None  # fit() always ends with a noise model
        return {
            "schema": SCHEMA,
            "model": self.model.name,
            "setting": asdict(self.preparation.setting),
            "values": {n: np.asarray(p.value).tolist() for n, p in self.model.parameters.items()},
            "recordings": [take.recording.source for take in self.preparation.takes],
            "units": {
                "drive": first.recording.drive_unit,
                "response": first.recording.response_unit,
            },
            "parameters": {
                e.name: {
                    "value": e.value,
                    "standard_error": e.standard_error,
                    "low": e.interval[0],
                    "high": e.interval[1],
                    "unit": e.unit,
                    "identified": e.identified,
                    "at_bound": e.at_bound,
                }
                for e in self.estimates
            },
            "known_only_together": list(self.correlated),
            "offsets": list(self.offsets),
            "scores": asdict(self.scores),
            "noise": {"sigma": noise.sigma, "unit": noise.unit, "method": noise.method},
            "assumptions": [
                {"history": t.history, "settling_samples": t.settling}
                for t in self.preparation.takes
            ],
            "oversampling": self.preparation.oversampling,
            "converged": self.converged,
            "warnings": list(self.warnings),
        }

    def save(self, path: str | Path) -> None:
        """Write fit.json; `load_model` reads the model back."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def load_model(path: str | Path) -> Model:
    """The fitted model from a fit.json.  Raises InputError where the file is none."""
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise KeyError(content["schema"])
        model = parse_model(content["model"], Setting(**content["setting"]))
        return model.with_values(content["values"])
    except FileNotFoundError:
        raise InputError(
            f"{path}: expected a fit.json, found no such file; check the path"
        ) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, ValueError):
        raise InputError(
            f'{path}: expected a fit saved by fracjax (schema "{SCHEMA}"), found something else; '
            "save it again by `fracjax fit`"
        ) from None


def starts_of(block: AbstractBlock, count: int, seed: int) -> list[AbstractBlock]:
    """The block as it stands, and draws of its shapes from their plausible ranges."""
    generator = np.random.default_rng(seed)
    parameters = named_parameters(block)
    names = [n for n, _ in layout_of(block).shapes]
    draws = [
        set_values(block, {n: parameters[n].draw(generator) for n in names})
        for _ in range(count - 1)
    ]
    return [block, *draws]


def solve_from(
    starts: list[AbstractBlock], preparation: Preparation, hopeless: float = np.inf
) -> Solved:
    """A few looks from every start, then the two best to convergence; the best of them finished.

    A fit counts as converged too when twelve looks gain less than a tenth in χ², or less than 1e-4
    of what is left beyond the noise.  Above `hopeless` in χ² the first looks are all that is spent.
    """
    make_room()
    problems = preparation.problems()
    samples = int(sum(p.weights.sum() for p in problems))
    descents = [descend(begin(start), problems, _LOOKS) for start in starts]
    for _ in range(_ROUNDS):
        order = np.argsort([d.cost for d in descents])
        best = descents[order[0]]
        if best.converged or not best.cost <= hopeless:
            break
        for k in order[:2]:
            if not descents[k].converged:
                descents[k] = descend(descents[k], problems, _LOOKS)
        least = min(descents, key=lambda d: d.cost)
        if best.cost - least.cost < max(0.1, 1e-4 * (best.cost - samples)):
            descents[descents.index(least)] = least._replace(converged=True)
    best = min(descents, key=lambda d: d.cost)
    return solved_at(
        best.block,
        best.position,
        preparation,
        converged=best.converged and np.isfinite(best.cost),
        costs=tuple(d.cost for d in descents),
        evaluations=sum(d.evaluations for d in descents),
    )


def solved_at(
    block: AbstractBlock,
    position: np.ndarray,
    preparation: Preparation,
    *,
    converged: bool,
    costs: tuple[float, ...],
    evaluations: int,
) -> Solved:
    """The block at the best position that was found, finished; `costs` (S,) of all starts."""
    problems = preparation.problems()
    point = Objective(block, problems).at(position)
    counts = [p.own.shape[1] for p in problems]
    own = np.split(point.own, np.cumsum(counts)[:-1])
    simulations = [
        (simulate(point.block, problem) + problem.own @ terms)[: len(take.recording)]
        for take, problem, terms in zip(preparation.takes, problems, own, strict=True)
    ]
    return Solved(
        block=jax.tree_util.tree_map(np.asarray, point.block),
        own=tuple(own),
        simulations=tuple(simulations),
        cost=min(costs),
        converged=bool(converged),
        start_costs=costs,
        samples=int(sum(p.weights.sum() for p in problems)),
        evaluations=evaluations,
    )


def fit_block(block: AbstractBlock, preparation: Preparation, starts: int, seed: int) -> Solved:
    """Multi-start fit: on the compressed problem where that is cheaper, the full model having the
    last word; else, or where the two disagree, from every start on the full model."""
    blocks = starts_of(block, starts, seed)
    searched = search(blocks, preparation.problems())
    if searched is not None:
        solved = solve_from([searched.best], preparation)
        if solved.converged and solved.cost <= searched.cost * (1 + _AGREED):
            costs = np.where(searched.costs > searched.cost, searched.costs, solved.cost)
            return replace(
                solved,
                start_costs=tuple(np.maximum(costs, solved.cost).tolist()),
                evaluations=solved.evaluations + searched.evaluations,
            )
    return solve_from(blocks, preparation)


def scores_of(solved: Solved, preparation: Preparation) -> Scores:
    """Scores over the samples that count, all recordings together."""
    pairs = list(zip(preparation.takes, solved.simulations, strict=True))
    residual = np.concatenate([(t.recording.response - s)[t.used] for t, s in pairs])
    centred = np.concatenate(
        [t.recording.response[t.used] - t.recording.response[t.used].mean() for t, _ in pairs]
    )
    e_r = float(np.linalg.norm(residual) / np.linalg.norm(centred))
    return Scores(
        rmse=float(np.sqrt(np.mean(residual**2))),
        e_r=e_r,
        nrmse_percent=100 * (1 - e_r),
        r_squared=1 - e_r**2,
        bic=solved.bic,
    )


def prepare(
    recordings: Sequence[Recording],
    *,
    noise: Noise | None = None,
    repeat: Recording | None = None,
    specification: float | None = None,
    history: Past | None = None,
    settling: int | None = None,
) -> Preparation:
    """Decide noise, history, settling and grid for recordings that are to be fitted together."""
    if not recordings:
        raise InputError("expected at least one recording, found none; give one")
    for other in recordings[1:]:
        require_units_of(recordings[0], other)
    takes = tuple(
        take_of(
            recording,
            noise or measured_noise(recording, repeat, specification),
            history,
            settling,
        )
        for recording in recordings
    )
    return Preparation(takes, coarse_oversampling(list(recordings)))


def settle(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: Past | None,
    starts: int,
    seed: int,
) -> tuple[Solved, Preparation]:
    """Fit, and settle what only a fit can tell: the history, and a noise that was not measured."""
    solved = fit_block(block, preparation, starts, seed)
    if history is None:
        others = [other_histories(take) for take in preparation.takes]
        if any(others):
            takes = zip(others, preparation.takes, strict=True)
            alternative = replace(preparation, takes=tuple(o or t for o, t in takes))
            other = fit_block(block, alternative, starts, seed)
            if _error_in_common(other, alternative, others) < _error_in_common(
                solved, preparation, others
            ):
                solved, preparation = other, alternative
    if any(take.noise is None for take in preparation.takes):
        preparation = preparation.with_noises(
            [
                take.noise
                or residual_noise(
                    (take.recording.response - s)[take.used], take.recording.response_unit
                )
                for take, s in zip(preparation.takes, solved.simulations, strict=True)
            ]
        )
        solved = fit_block(solved.block, preparation, starts, seed)
    return solved, preparation


def _error_in_common(
    solved: Solved, preparation: Preparation, others: Sequence[Take | None]
) -> float:
    """Mean square residual where both histories are put to the test: of a jump the settling samples
    too, of steady cycles the whole periods after the first."""
    errors = []
    for take, other, simulation in zip(preparation.takes, others, solved.simulations, strict=True):
        steady = other is not None and other.history == "periodic"
        stop = len(other.recording) if other is not None else len(take.recording)
        start = stop // 10 if steady else 0
        errors.append((take.recording.response - simulation)[start:stop] ** 2)
    return float(np.mean(np.concatenate(errors)))


def fit_of(model: Model, solved: Solved, preparation: Preparation) -> Fit:
    """The result, with standard errors, from a solved block."""
    first = preparation.takes[0].recording
    inflation = max(1.0, float(np.sqrt(solved.cost / solved.samples)))
    found, correlated = estimates(
        solved.block, preparation.problems(), (first.drive_unit, first.response_unit), inflation
    )
    return Fit(
        model=Model(solved.block, model.name),
        preparation=preparation,
        estimates=found,
        correlated=correlated,
        offsets=tuple(float(terms[0]) for terms in solved.own),
        simulations=solved.simulations,
        scores=scores_of(solved, preparation),
        converged=solved.converged,
        start_costs=solved.start_costs,
    )


def fit(
    model: Model,
    recordings: Recording | Sequence[Recording],
    *,
    noise: Noise | None = None,
    history: Past | None = None,
    settling: int | None = None,
    fixed: dict[str, float] | None = None,
    bounds: dict[str, tuple[float, float]] | None = None,
    starts: int = 8,
    seed: int = 0,
    progress: Progress = silent,
) -> Fit:
    """Fit a model to one recording, or to several with shared parameters and own offsets.

    Least squares, whitened by the noise's own colour, gains eliminated, from `starts` points.
    `history` and `settling` [samples] are decided from the data where not given; the history
    "estimated" fits what the drive before the first sample still adds.  `fixed` holds
    parameters at values, `bounds` narrows their range, by name.
    Raises InputError where names are unknown.  A fit that did not converge says so in `converged`.
    """
    listed = [recordings] if isinstance(recordings, Recording) else list(recordings)
    with jax.enable_x64(True):
        progress(f"fitting {model.name}")
        block = replace_parameters(
            model.block, constrained(model.parameters, fixed or {}, bounds or {})
        )
        preparation = prepare(listed, noise=noise, history=history, settling=settling)
        solved, preparation = settle(block, preparation, history=history, starts=starts, seed=seed)
        return fit_of(model, solved, preparation)


def constrained(
    parameters: dict[str, Parameter],
    fixed: dict[str, float],
    bounds: dict[str, tuple[float, float]],
) -> dict[str, Parameter]:
    """The parameters that a call fixes or bounds, as it wants them.  Raises InputError."""
    for name in (*fixed, *bounds):
        if name not in parameters:
            raise InputError(
                f'parameter "{name}": expected one of {", ".join(parameters)}, found none of that '
                "name; correct it"
            )
    changed = {}
    for name in {*fixed, *bounds}:
        p = parameters[name]
        low, high = bounds.get(name, (p.lower, p.upper))
        if name in bounds and not np.isfinite(np.subtract(high, low)):
            raise InputError(
                f'parameter "{name}": expected two finite bounds, found {low} and {high}; '
                "give the widest range that makes sense"
            )
        value = fixed[name] if name in fixed else np.clip(p.value, low, high)
        try:
            changed[name] = Parameter(
                value,
                p.unit,
                lower=low,
                upper=high,
                plausible=(np.clip(p.plausible[0], low, high), np.clip(p.plausible[1], low, high)),
                logarithmic=p.logarithmic,
                gain=p.gain and name not in bounds,
                fixed=name in fixed,
            )
        except ValueError as error:
            raise InputError(f'parameter "{name}": {error}.') from None
    return changed
