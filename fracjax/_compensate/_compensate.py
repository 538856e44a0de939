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
from .._fit import Progress, layout_of, silent, split
from .._models import Model, understood
from .._operators import interpolate
from .._operators._grid import HISTORIES, History
from .._parameters import set_values
from .._recording import InputError, Recording, require_kind, unit
from ._bounded import Bounds, best_within
from ._inverse import inverse_of, without_disturbances
from ._plant import Plant
from ._result import Compensation
from ._trajectory import Trajectory
from ._unbounded import Inverted, Reached, follow, respond

_FINE, _FINEST = 1e-5, 8
_DRAWS = 200
_SMOOTH = ("akima", "cubic")
_inverted = compiled(Inverted.drive)


def compensate(
    model: Model | str,
    trajectory: Trajectory,
    *,
    limits: tuple[float, float] | None = None,
    slew: float | None = None,
    regularisation: float = 0.0,
    history: History = "constant",
    offset: float = 0.0,
    drive_unit: str = "V",
    response_unit: str | None = None,
    draws: Mapping[str, np.ndarray] | None = None,
    identified_by: Recording | None = None,
    progress: Progress = silent,
) -> Compensation:
    """The drive u with model(u) + offset = trajectory [L 10, 12], at the trajectory's samples.

    The law's own inverse is asked first, or that of its linear part, then again for what was
    missed; where this does not contract, Levenberg–Marquardt goes on, by products with the
    Jacobian alone.  It ends at 1e-6 of the stroke.  Where limits stand in the way, the drive of
    least squared error within them is found (`_bounded`).  Thermal drift and mains lines of the
    recorded run are left out: they will stand elsewhere in the next.

    **Arguments:** `limits`, lowest and highest drive, and `slew`, its fastest change per second
    [drive, drive/s]; `regularisation`, a time τ [s]: detail of the drive faster than it is damped,
    by adding (τ² g ü)² to the squared error, g = stroke/drive span; `history`, what the drive did
    before the first sample; `offset`, what the sensor reads where the model says zero [response];
    `response_unit`, that of the model's response, to which the trajectory is converted: by default
    that of `identified_by`, else the trajectory's;
    `draws`, values (D,) of the model's free parameters by name, such as `Posterior.samples`, for
    the band of the predicted response; `identified_by`, the recording they were drawn for, whose
    zero goes with them: each draw then has the offset that leaves the recording's mean as it is.

    **Returns:** the drive with its predicted response; a trajectory that cannot be followed is no
    error, the result says where and by how much it is missed.

    **Raises:** `InputError` for limits out of order, an unknown history or unit, draws that lack a
    parameter, or a model that does not respond to its drive.
    """
    model = understood(model)
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
    unit(drive_unit, "compensate, drive_unit")
    block, left_out = without_disturbances(model.block)
    if block is None:
        raise InputError.at(
            "compensate", "a model with a drive", f"{model.name}", "compensate another"
        )
    with computing():
        step = np.asarray(trajectory.dt)
        plant = Plant(block, step, np.asarray(float(offset)), history, 1, False)
        desired, stroke = trajectory.response, trajectory.stroke
        progress(f"inverting {model.name}")
        system = _on_fine_grid(Inverted(plant, _inverse(plant, trajectory)), desired, stroke)
        reached = follow(system, desired, stroke, progress)
        if not np.isfinite(reached.response).all() or np.ptp(reached.drive) == 0:
            raise InputError.at(
                "compensate",
                "a model whose response follows its drive",
                f"no finite drive for {model.name}",
                "check the parameters, or the trajectory's unit and offset",
            )
        if regularisation or not bounds.admits(reached.drive, history):
            smoothing = regularisation / trajectory.dt
            reached = best_within(
                system.plant, reached, desired, stroke, bounds, smoothing, progress
            )
        band = None
        if draws is not None:
            progress("predicting for draws of the parameters")
            band = _band(model.block, draws, system.plant, reached.drive, identified_by)
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
            drive=reached.drive,
            predicted=reached.response,
            band=band,
            method=reached.method,
            iterations=reached.iterations,
            converged=reached.converged,
            numerics=_numerics(system.plant, reached, stroke),
        )


def _refusal(name: str, expected: str, found: str) -> InputError:
    return InputError.at(f"compensate, {name}", expected, found, "correct it")


def _bounds(limits: tuple[float, float] | None, slew: float | None, step: float) -> Bounds:
    """The limits per sample [drive]."""
    low, high = (-np.inf, np.inf) if limits is None else limits
    if not low < high:
        raise _refusal("limits", "the lower limit, then the upper", f"{low} and {high}")
    if slew is not None and not slew > 0:
        raise _refusal("slew", "a rate above 0", f"{slew}")
    return Bounds(float(low), float(high), np.inf if slew is None else slew * step)


def _inverse(plant: Plant, trajectory: Trajectory) -> AbstractBlock:
    """The block's inverse, or one near it; else the gain at which the strokes agree."""
    shape = (trajectory.response - trajectory.response[0]) / trajectory.stroke
    # The frequency of a sine that moves as fast for its height.
    frequency = np.std(np.diff(shape)) / (2 * np.pi * trajectory.dt * np.std(shape))
    known = inverse_of(plant.block, float(frequency))
    if known is not None:
        return known.block
    span, response = trajectory.stroke, shape
    for _ in range(10):
        response = np.asarray(respond(plant, span * shape))
        found = np.ptp(response)
        if not (np.isfinite(found) and found > 0):
            break
        span *= trajectory.stroke / found
    sign = 1.0 if (response - response.mean()) @ (shape - shape.mean()) >= 0 else -1.0
    return QuasiStaticForce(sign * trajectory.stroke / span).inverse()


def _on_fine_grid(system: Inverted, desired: np.ndarray, stroke: float) -> Inverted:
    """The system on a grid refined until halving it no longer matters for the inverse's drive.

    Until 1e-5 of the stroke, or 8 steps per sample.
    """
    drive = np.asarray(_inverted(system, jnp.asarray(desired)))
    # Behind plays the drive bends sharply where it turns, and a cubic would swing over.
    smooth = system.inverse.linear and np.isfinite(drive).all()
    smooth = smooth and interpolate(drive, 2)[1] in _SMOOTH
    plant = replace(system.plant, smooth=bool(smooth))
    response = np.asarray(respond(plant, drive))
    while plant.oversampling < _FINEST:
        finer = replace(plant, oversampling=2 * plant.oversampling)
        coarse, response = response, np.asarray(respond(finer, drive))
        if not np.abs(response - coarse).max() > _FINE * stroke:
            break
        plant = finer
    return Inverted(plant, system.inverse)


def _numerics(plant: Plant, reached: Reached, stroke: float) -> float:
    """What halving the grid's step changes of the response, as a share of the stroke."""
    finer = replace(plant, oversampling=2 * plant.oversampling)
    changed = np.asarray(respond(finer, reached.drive)) - reached.response
    return float(np.abs(changed).max() / stroke)


def _band(
    block: AbstractBlock,
    draws: Mapping[str, np.ndarray],
    plant: Plant,
    drive: np.ndarray,
    recording: Recording | None,
) -> np.ndarray:
    """The central 95 % (2, N) of the responses at draws of the free parameters."""
    layout = layout_of(block)
    for label in layout.labels:
        if label not in draws:
            raise InputError.at(
                "compensate, draws",
                f"values of {', '.join(layout.labels)}",
                f"none of {label}",
                "give draws of this model's posterior",
            )
    values = np.stack([np.ravel(draws[label]) for label in layout.labels], axis=1)
    chosen = values[np.linspace(0, len(values) - 1, min(_DRAWS, len(values))).astype(int)]
    responses = np.asarray(_responses(block, chosen, plant, drive))
    if recording is not None:
        recorded = replace(plant, step=np.asarray(recording.dt))
        means = np.asarray(_responses(block, chosen, recorded, recording.drive)).mean(axis=1)
        fitted = np.asarray(respond(recorded, recording.drive)).mean()
        responses = responses - (means - fitted)[:, None]
    return np.percentile(responses, [2.5, 97.5], axis=0)


@compiled
def _responses(block: AbstractBlock, values: np.ndarray, plant: Plant, drive: np.ndarray) -> Array:
    """Responses (D, N) to one drive (N,) at values (D, d) of the free parameters."""
    layout = layout_of(block)

    def one(vector: Array) -> Array:
        moved = set_values(block, split(block, layout.shapes + layout.gains, vector))
        left, _ = without_disturbances(moved)
        return eqx.tree_at(lambda p: p.block, plant, left)(jnp.asarray(drive))

    return jax.lax.map(one, jnp.asarray(values))
