"""The drive that makes a model's response follow a trajectory."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock, QuasiStaticForce
from .._computing import compiled, computing
from .._models import Model, as_model
from .._naming import path_of_name
from .._operators import HISTORIES, History, interpolate
from .._parameters import set_values
from .._prepare import layout_of, values_by_name
from .._recording import UNSTATED, InputError, Recording, require_kind, unit
from .._solve import Progress, silent
from ._bounded import Bounds, optimise_within
from ._inverse import inverse_of, obstacles_to_inversion, without_disturbances
from ._plant import Plant
from ._result import Compensation, ModelError
from ._trajectory import Trajectory
from ._unbounded import InvertedPlant, Solution, find_drive, respond

_GRID_TOLERANCE, _FINEST = 1e-5, 8
"""The grid is refined until halving it changes the response by at most this share of the stroke, a
hundredth of the error that counts as missed, or to so many steps per sample; by judgement."""
_DRAWS = 200
"""Most draws for the band: its 2.5 % ends then rest on five draws each; chosen by judgement."""
_AT_ONCE = 8
"""Draws that are simulated at once, the number that took the least time."""
_SMOOTH = ("akima", "cubic")
"""Methods of `interpolate` that stand for a drive without corners."""
_inverse_drive = compiled(InvertedPlant.drive)


def compensate(
    model: Model | str,
    trajectory: Trajectory,
    *,
    limits: tuple[float, float] | None = None,
    slew: float | None = None,
    regularisation: float = 0.0,
    history: History = "constant",
    offset: float = 0.0,
    drive_unit: str = "",
    response_unit: str | None = None,
    draws: Mapping[str, np.ndarray] | None = None,
    identified_by: Recording | None = None,
    model_error: ModelError | None = None,
    progress: Progress = silent,
) -> Compensation:
    """The drive u with model(u) + offset = trajectory [L 10, 12], at the trajectory's samples.

    The search starts from the model's own inverse, or from that of its linear part, and adds the
    remaining error to the reference motion again and again.  If this does not contract,
    Levenberg–Marquardt goes on, by products with the Jacobian alone.  It ends at an error of 1e-6
    of the stroke.  If limits stand in the way, it finds the drive of least squared error within
    them.  Thermal drift and mains lines of the recorded run are left out of the model, because
    their phase will differ in the next run.

    Args:
        model: The model to invert, or its name.
        trajectory: The desired response (N,).
        limits: Lowest and highest drive [drive_unit]; None for no limit.  A model says nothing
            about drives beyond those of its recording: the command line takes that range.
        slew: Fastest change of the drive [drive_unit/s]; None for no limit.
        regularisation: A time τ [s]; detail of the drive that is faster is damped, by adding
            (τ² g ü)² to the squared error, with g = stroke/drive span.
        history: What the drive did before the first sample: "rest" (zero), "constant" (its first
            value) or "periodic" (the same cycles).
        offset: What the sensor reads where the model's response is zero [response].
        response_unit: Unit of the model's response, to which the trajectory is converted; by
            default that of `identified_by`, else the trajectory's.
        drive_unit: Unit of the drive that the model was fitted with; "drive units" unless stated.
        draws: Values (D,) of the model's free parameters by name, such as `Posterior.samples`, for
            the band of the predicted response; None for no band.
        identified_by: The recording that the draws were sampled for.  Each draw then gets the
            offset that keeps the mean of the response to this recording.
        model_error: What the model left of a recording, so that the result states the error to
            expect on the stage.
        progress: Called with a sentence at each stage.

    Returns:
        The drive with its predicted response.  A trajectory that cannot be followed is no error:
        the result states where and by how much the response misses it.

    Raises:
        InputError: When limits are out of order, the history or a unit is unknown, the draws lack a
            parameter, or the model does not respond to its drive.

    Source: [L 10, 12], the inverse of the linear fractional-order model used as feed-forward.
    """
    model = as_model(model)
    require_kind(trajectory, Trajectory, "trajectory", "make one: Trajectory(response, dt, unit)")
    if response_unit is None and identified_by is not None:
        response_unit = identified_by.response_unit
    if response_unit is not None:
        trajectory = trajectory.in_unit(response_unit)
    bounds = _bounds(limits, slew, trajectory.dt)
    if not 0 <= regularisation < np.inf:
        raise _refusal("regularisation", "a time of 0 s or more", f"{regularisation}")
    if not np.isfinite(offset):
        raise _refusal("offset", "a finite number", f"{offset}")
    if history not in HISTORIES:
        raise _refusal("history", f"one of {', '.join(HISTORIES)}", f'"{history}"')
    drive_unit = drive_unit or UNSTATED["drive"]
    unit(drive_unit, "compensate, drive_unit")
    block, left_out = without_disturbances(model.block)
    if block is None:
        raise InputError.at(
            "compensate", "a model with a drive", f"{model.name}", "choose another model"
        )
    with computing():
        step = np.asarray(trajectory.dt)
        plant = Plant(block, step, np.asarray(float(offset)), history, 1, False)
        desired, stroke = trajectory.response, trajectory.stroke
        progress(f"inverting {model.name}")
        inverted = InvertedPlant(plant, _approximate_inverse(plant, trajectory))
        system = _refined(inverted, desired, stroke)
        solution = find_drive(system, desired, stroke, progress)
        if not np.isfinite(solution.response).all() or np.ptp(solution.drive) == 0:
            raise InputError.at(
                "compensate",
                "a model whose response follows its drive",
                f"no finite drive for {model.name}",
                "check the parameters, or the trajectory's unit and offset",
            )
        if regularisation or not bounds.admits(solution.drive, history):
            smoothing = regularisation / trajectory.dt
            solution = optimise_within(
                system.plant, solution, desired, stroke, bounds, smoothing, progress
            )
        band = None
        if draws is not None:
            progress("predicting the response for draws of the parameters")
            band = _band(model.block, draws, system.plant, solution.drive, identified_by)
        return Compensation(
            model=model.name,
            source=trajectory.source,
            dt=trajectory.dt,
            units=(drive_unit, trajectory.response_unit),
            history=history,
            offset=float(offset),
            limits=limits if limits is None else (float(limits[0]), float(limits[1])),
            slew=None if slew is None else float(slew),
            regularisation=float(regularisation),
            left_out=left_out,
            desired=desired,
            drive=solution.drive,
            predicted=solution.response,
            band=band,
            method=solution.method,
            iterations=solution.iterations,
            converged=solution.converged,
            numerics=_numerics(system.plant, solution, stroke),
            warnings=obstacles_to_inversion(block),
            model_error=model_error,
            inverted=Model(block, model.name),
        )


def _refusal(name: str, expected: str, actual: str) -> InputError:
    """The error for an option of `compensate` that has no valid value."""
    return InputError.at(f"compensate, {name}", expected, actual, "correct it")


def _bounds(limits: tuple[float, float] | None, slew: float | None, step: float) -> Bounds:
    """The limits, with the slew rate as a change per sample [drive]."""
    low, high = (-np.inf, np.inf) if limits is None else limits
    if not low < high:
        raise _refusal("limits", "the lower limit, then the upper", f"{low} and {high}")
    if slew is not None and not slew > 0:
        raise _refusal("slew", "a rate above 0", f"{slew}")
    return Bounds(float(low), float(high), np.inf if slew is None else slew * step)


def _approximate_inverse(plant: Plant, trajectory: Trajectory) -> AbstractBlock:
    """The block's inverse, or an approximate one; else the gain at which the strokes agree."""
    shape = (trajectory.response - trajectory.response[0]) / trajectory.stroke
    # The frequency of a sine with the same ratio of rms rate to rms amplitude.
    frequency = np.std(np.diff(shape)) / (2 * np.pi * trajectory.dt * np.std(shape))
    inversion = inverse_of(plant.block, float(frequency))
    if inversion is not None:
        return inversion.block
    span, response = trajectory.stroke, shape
    # A gain that depends on the amplitude settles within ten rescalings; chosen by judgement.
    for _ in range(10):
        response = np.asarray(respond(plant, span * shape))
        stroke = np.ptp(response)
        if not (np.isfinite(stroke) and stroke > 0):
            break
        span *= trajectory.stroke / stroke
    sign = 1.0 if (response - response.mean()) @ (shape - shape.mean()) >= 0 else -1.0
    return QuasiStaticForce(sign * trajectory.stroke / span).inverse()


def _refined(system: InvertedPlant, desired: np.ndarray, stroke: float) -> InvertedPlant:
    """The system on a grid fine enough for its response to the approximate inverse's drive.

    The grid is refined until halving it changes the response by at most 1e-5 of the stroke, or to 8
    steps per sample.  `desired` (N,) and `stroke` are in the response's unit.
    """
    drive = np.asarray(_inverse_drive(system, jnp.asarray(desired)))
    # The inverse of play operators has corners where it turns, at which a cubic would overshoot.
    smooth = system.inverse.linear and np.isfinite(drive).all()
    smooth = smooth and interpolate(drive, 2)[1] in _SMOOTH
    plant = replace(system.plant, smooth=bool(smooth))
    response = np.asarray(respond(plant, drive))
    while plant.oversampling < _FINEST:
        finer = replace(plant, oversampling=2 * plant.oversampling)
        coarse, response = response, np.asarray(respond(finer, drive))
        if not np.abs(response - coarse).max() > _GRID_TOLERANCE * stroke:
            break
        plant = finer
    return InvertedPlant(plant, system.inverse)


def _numerics(plant: Plant, solution: Solution, stroke: float) -> float:
    """The largest change of the response when the grid's step is halved, by the stroke."""
    finer = replace(plant, oversampling=2 * plant.oversampling)
    changed = np.asarray(respond(finer, solution.drive)) - solution.response
    return float(np.abs(changed).max() / stroke)


def _band(
    block: AbstractBlock,
    draws: Mapping[str, np.ndarray],
    plant: Plant,
    drive: np.ndarray,
    recording: Recording | None,
) -> np.ndarray:
    """The central 95 % (2, N) [response] of the responses at draws of the free parameters.

    With the recording that the draws were sampled for, each response is shifted so that the mean
    response to that recording is the same for all draws.
    """
    chosen = _chosen(block, draws, _DRAWS)
    responses = np.asarray(_responses(block, chosen, plant, drive))
    if recording is not None:
        recorded = replace(plant, step=np.asarray(recording.dt))
        means = np.asarray(_responses(block, chosen, recorded, recording.drive)).mean(axis=1)
        fitted = np.asarray(respond(recorded, recording.drive)).mean()
        responses = responses - (means - fitted)[:, None]
    return np.percentile(responses, [2.5, 97.5], axis=0)


def _chosen(block: AbstractBlock, draws: Mapping[str, np.ndarray], most: int) -> np.ndarray:
    """Values (D, d) of the free parameters, at most so many of the draws."""
    labels = layout_of(block).labels(block)
    placed = {path_of_name(name, block): draw for name, draw in draws.items()}
    for label in labels:
        if path_of_name(label, block) not in placed:
            raise InputError.at(
                "compensate, draws",
                f"values of {', '.join(labels)}",
                f"none of {label}",
                "give draws of this model's posterior",
            )
    values = np.stack([np.ravel(placed[path_of_name(label, block)]) for label in labels], axis=1)
    return values[np.linspace(0, len(values) - 1, min(most, len(values))).astype(int)]


def changes_by_draws(
    block: AbstractBlock, draws: Mapping[str, np.ndarray], drive: np.ndarray, step: float, most: int
) -> np.ndarray:
    """How the response to a drive (N,), whose first value was held before, changes with draws of
    the parameters, at most so many of them: (D, N) [response]."""
    with computing():
        plant = Plant(block, np.asarray(step), np.asarray(0.0), "constant", 1, False)
        drawn = _responses(block, _chosen(block, draws, most), plant, drive)
        return np.asarray(drawn - respond(plant, drive))


@compiled
def _responses(block: AbstractBlock, values: np.ndarray, plant: Plant, drive: np.ndarray) -> Array:
    """Responses (D, N) to one drive (N,) at values (D, d) of the free parameters."""
    layout = layout_of(block)

    def response(vector: Array) -> Array:
        drawn = set_values(block, values_by_name(block, layout.shapes + layout.gains, vector))
        undisturbed, _ = without_disturbances(drawn)
        return eqx.tree_at(lambda p: p.block, plant, undisturbed)(jnp.asarray(drive))

    return jax.lax.map(response, jnp.asarray(values), batch_size=_AT_ONCE)
