"""Fitting a model to recordings, and the result."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

import numpy as np

from .._blocks import AbstractBlock, Setting
from .._computing import computing
from .._models import Model, parse_model
from .._recording import InputError, Recording, require_units_of
from ._asked import Asked, OfParameters, conditioned
from ._border import model_of, past_of, recordings_of, settling_of, sigma_of, whole
from ._combinations import Combination
from ._conditions import PLAIN, Conditions
from ._history import is_likelier
from ._noise import Noise, cleared, measured_noises, read_from_residual
from ._numerics import fine_enough, too_coarse
from ._preparation import Past, Preparation, coarse_oversampling, other_histories, take_of
from ._robust import ROUNDS, SETTLED, Loss, Robust, shape_of, weigh
from ._solve import Progress, Solved, fit_block, silent, solve_from
from ._uncertainty import Estimate, uncertainty_of
from ._weights import Mask, Weights, weights_of

if TYPE_CHECKING:
    from ._profile import Profile

SCHEMA = "fracjax.fit/1"
_OVERRATED = 0.5


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
class Fit:
    """A fitted model with its uncertainty, scores and the assumptions it rests on.

    `simulations` are the model's responses at the recordings' samples, offset included, in the
    response's unit; `correlated` names parameters that the data only know together, `combinations`
    what they know of them; `warnings` are what later checks held against it.  `residual_order` is
    that of the whitened residual's autoregression, which the standard errors allow for; `robust`
    says how a robust loss weighed the samples; `profiles` are those that were asked for.  Where
    recordings have parameters of their own, `models` are theirs and `model` is the first's.
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
    models: tuple[Model, ...] = ()
    combinations: tuple[Combination, ...] = ()
    residual_order: int = 0
    robust: Robust | None = None
    profiles: tuple[Profile, ...] = ()

    @property
    def weighed(self) -> Preparation:
        """The recordings with the weights that a robust loss ended with."""
        if self.robust is None:
            return self.preparation
        return self.preparation.with_trust(self.robust.weights)

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
            "parameters": {e.name: e.to_dict() for e in self.estimates},
            "known_only_together": list(self.correlated),
            "combinations": [combination.to_dict() for combination in self.combinations],
            **self.preparation.conditions.to_dict(),
            "offsets": list(self.offsets),
            "scores": asdict(self.scores),
            "noise": {"sigma": noise.sigma, "unit": noise.unit, "method": noise.method},
            "assumptions": [
                {"history": t.history, "settling_samples": t.settling}
                for t in self.preparation.takes
            ],
            "samples_left_out": [
                int(np.count_nonzero(~t.used[t.settling :])) for t in self.preparation.takes
            ],
            "profiles": [profile.to_dict() for profile in self.profiles],
            "residual_order": self.residual_order,
            "loss": {"name": "least_squares"} if self.robust is None else self.robust.to_dict(),
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
        values = content["values"]
        model = parse_model(content["model"], Setting(**content["setting"]), values)
        return model.with_values(values)
    except FileNotFoundError:
        raise InputError(
            f"{path}: expected a fit.json, found no such file; check the path"
        ) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, ValueError):
        raise InputError(
            f'{path}: expected a fit saved by fracjax (schema "{SCHEMA}"), found something else; '
            "save it again by `fracjax fit`"
        ) from None


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
    repeats: Sequence[Recording] = (),
    specification: float | str | None = None,
    history: Past | None = None,
    settling: int | str | None = None,
    weights: Weights = None,
    mask: Mask = (),
    conditions: Conditions = PLAIN,
) -> Preparation:
    """Decide noise, history, settling and grid for recordings that are to be fitted together."""
    if not recordings:
        raise InputError("expected at least one recording, found none; give one")
    for other in recordings[1:]:
        require_units_of(recordings[0], other)
    past_of(history)
    sigma = sigma_of(specification, recordings[0].response_unit)
    counts = weights_of(recordings, weights, mask)
    noises = [noise] * len(recordings)
    if noise is None:
        noises = measured_noises(recordings, repeats, sigma, counts)
    takes = tuple(
        take_of(recording, its_noise, history, settling_of(settling, recording), its_counts)
        for recording, its_noise, its_counts in zip(recordings, noises, counts, strict=True)
    )
    return Preparation(takes, coarse_oversampling(list(recordings)), conditions)


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
            if is_likelier(other, alternative, solved, preparation):
                solved, preparation = other, alternative
    believed, noises = _believed_noises(solved, preparation), []
    for noise, take, simulation in zip(
        believed, preparation.takes, solved.simulations, strict=True
    ):
        left = take.recording.response - simulation
        if noise is None or noise.is_leftover:
            noises.append(read_from_residual(noise, left, take.used, take.recording))
        else:
            noises.append(cleared(noise, left, take.used, take.recording))
    if any(found is not take.noise for found, take in zip(noises, preparation.takes, strict=True)):
        known = preparation.with_noises(noises)
        solved, preparation = _refitted(solved, preparation, known, starts, seed), known
    return solved, preparation


def settle_finely(
    block: AbstractBlock,
    preparation: Preparation,
    *,
    history: Past | None,
    starts: int,
    seed: int,
    progress: Progress,
) -> tuple[Solved, Preparation, float]:
    """`settle`, on a grid fine enough for the noise, which is read again where a fit told it; and
    √λ_num, the numerical error that is left."""
    solved, preparation = settle(block, preparation, history=history, starts=starts, seed=seed)
    while True:
        coarse = preparation
        solved, preparation, error = fine_enough(solved, preparation, progress)
        noises = [take.noise for take in preparation.takes]
        if preparation is coarse or not any(noise and noise.is_leftover for noise in noises):
            return solved, preparation, error
        pairs = zip(preparation.takes, solved.simulations, strict=True)
        preparation = preparation.with_noises(
            [
                read_from_residual(
                    take.noise, take.recording.response - simulation, take.used, take.recording
                )
                if take.noise is None or take.noise.is_leftover
                else take.noise
                for take, simulation in pairs
            ]
        )
        solved = solve_from([solved.block], preparation)


def _refitted(
    solved: Solved, before: Preparation, preparation: Preparation, starts: int, seed: int
) -> Solved:
    """A fit under other noises: where they only scale χ², its optimum is theirs."""
    scale = _scale(before, preparation)
    if scale is None:
        return fit_block(solved.block, preparation, starts, seed)
    return replace(
        solved,
        cost=scale**2 * solved.cost,
        whitened=tuple(scale * residual for residual in solved.whitened),
        start_costs=tuple(scale**2 * cost for cost in solved.start_costs),
    )


def _scale(before: Preparation, after: Preparation) -> float | None:
    """What multiplies every whitened residual, where it is one number; None of other changes."""
    pairs = list(zip(before.problems(), after.problems(), strict=True))
    scale = float(pairs[0][1].whitening[0] / pairs[0][0].whitening[0])
    alike = all(
        np.allclose(b.whitening, scale * a.whitening, 1e-12, 0)
        and np.array_equal(a.weights, b.weights)
        for a, b in pairs
    )
    return scale if alike and not after.conditions.priors else None


def _believed_noises(solved: Solved, preparation: Preparation) -> list[Noise | None]:
    """The noises that were measured, but for those far larger than what the fit leaves over: then
    what differed between periods, or moved at rest, was no noise."""
    found: list[Noise | None] = []
    for take, whitened in zip(preparation.takes, solved.whitened, strict=True):
        counted = whitened[whitened != 0]
        told = take.noise is not None and take.noise.method != "specification"
        overrated = told and counted.size > 0 and float(np.mean(counted**2)) < _OVERRATED
        found.append(None if overrated else take.noise)
    return found


def reweighted(
    solved: Solved, preparation: Preparation, loss: Loss
) -> tuple[Solved, Robust, float]:
    """The optimum of a robust loss, from that of least squares; what it made of the samples, and
    the inflation of its standard errors.  Its cost Σ 2s²ρ takes the place of χ²."""
    shape = shape_of(loss)
    assert shape is not None  # of least squares nothing is to be done
    counted = [np.asarray(p.weights) > 0 for p in preparation.problems()]
    sizes = [len(take.recording) for take in preparation.takes]
    roots = [np.ones(len(c)) for c in counted]
    cost, rounds = np.inf, 0
    while True:
        plain = [r / root for r, root in zip(solved.whitened, roots, strict=True)]
        seen = weigh(shape, plain, counted)
        settled = abs(cost - seen.cost) <= SETTLED * seen.cost
        if settled or rounds == ROUNDS:
            break
        cost, roots, rounds = seen.cost, [np.sqrt(w) for w in seen.weights], rounds + 1
        trust = [w[:size] for w, size in zip(seen.weights, sizes, strict=True)]
        solved = solve_from([solved.block], preparation.with_trust(trust))
    one = shape.weight(np.zeros(1))[0]
    weights = tuple(w[:size] / one for w, size in zip(seen.weights, sizes, strict=True))
    robust = Robust(loss, seen.scale, weights, seen.downweighted, rounds)
    found = replace(
        solved,
        cost=seen.cost,
        whitened=tuple(seen.bounded),
        converged=solved.converged and settled,
    )
    return found, robust, seen.inflation


def fit_of(
    model: Model, solved: Solved, preparation: Preparation, loss: Loss = "least_squares"
) -> Fit:
    """The result, with standard errors, from a solved block."""
    robust = None
    if loss == "least_squares":
        inflation = float(np.sqrt(solved.left))
    else:
        solved, robust, inflation = reweighted(solved, preparation, loss)
    first = preparation.takes[0].recording
    known = uncertainty_of(
        solved.blocks,
        preparation.problems(),
        preparation.conditions,
        units=(first.drive_unit, first.response_unit),
        inflation=inflation,
        residuals=solved.whitened,
    )
    return Fit(
        model=Model(solved.block, model.name),
        preparation=preparation,
        estimates=known.estimates,
        correlated=known.correlated,
        offsets=tuple(float(terms[0]) for terms in solved.own),
        simulations=solved.simulations,
        scores=scores_of(solved, preparation),
        converged=solved.converged,
        start_costs=solved.start_costs,
        models=tuple(Model(block, model.name) for block in solved.blocks),
        combinations=known.combinations,
        residual_order=known.order,
        robust=robust,
    )


def ready(
    model: Model,
    recordings: Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    history: Past | None = None,
    settling: int | str | None = None,
    weights: Weights = None,
    mask: Mask = (),
    **asked: Unpack[OfParameters],
) -> tuple[AbstractBlock, Preparation]:
    """The block and the recordings as a call asks for them.  Raises InputError."""
    block, conditions = conditioned(model, **asked)
    return block, prepare(
        recordings,
        noise=noise if isinstance(noise, Noise) else None,
        specification=None if isinstance(noise, Noise) else noise,
        history=history,
        settling=settling,
        weights=weights,
        mask=mask,
        conditions=conditions,
    )


def fit(
    model: Model | str,
    recordings: Recording | Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    settling: int | str | None = None,
    history: Past | None = None,
    loss: Loss = "least_squares",
    starts: int = 8,
    seed: int = 0,
    progress: Progress = silent,
    **asked: Unpack[Asked],
) -> Fit:
    """Fit a model to one recording, or to several with shared parameters and own offsets.

    Least squares, whitened by the noise's own colour, gains eliminated, from `starts` points.  A
    model is also given by its name, "foh >> creep".  `noise`: the sensor's, as specified, such as
    "0.07 um", used where neither repeats nor rests show it; or a Noise, used as it is.
    `history` and `settling`, samples or a time such as "1 s", are decided from the data where not
    given; the history "estimated" fits what the drive before the first sample still adds.  `loss`:
    "huber", "soft_l1" or "student_t" let outliers weigh less.

    By name, `fixed` holds parameters at values, `bounds` narrows their range, `priors` says what
    was known of them before, `tied` lets one equal another, `{"second.mu": "first.alpha"}`, or a
    multiple of it, `("first.alpha", 2.0)`; of `own` every recording has its own value, told as
    `name@1`, `name@2`, …, as it has of what begins anew with it, such as the mains' phases.
    `weights` (N,), one array per recording, multiply the squared residuals, `mask` leaves out times
    [s], ends included.

    The simulation's step is halved until that no longer matters beside the noise, or to 32 steps
    per sample; where it still matters then, a warning says so.
    Raises InputError where names are unknown, and for what does not fit together.  A fit that did
    not converge says so in `converged`.
    """
    listed = recordings_of(recordings)
    model = model_of(model, listed)
    shape_of(loss)
    starts, seed = whole(starts, "starts", 1), whole(seed, "seed", 0)
    with computing():
        progress(f"fitting {model.name}")
        block, preparation = ready(
            model, listed, noise=noise, history=history, settling=settling, **asked
        )
        solved, preparation, numerics = settle_finely(
            block, preparation, history=history, starts=starts, seed=seed, progress=progress
        )
        found = fit_of(model, solved, preparation, loss)
        return replace(found, warnings=too_coarse(numerics))
