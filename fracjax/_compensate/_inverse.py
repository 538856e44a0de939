r"""Inverses of blocks by their structure: exact if there is one, else of their linear part.

A sum of play operators y = w_0 u + Σ_i w_i p_i(u, r_i) whose slopes s_j = w_0 + Σ_{i≤j} w_i are
all positive (or all negative) has an inverse of the same form:

    u = y/w_0 + Σ_i w'_i p_i(y, r'_i),    r'_i = Σ_{j≤i} s_{j-1} (r_j - r_{j-1}),
    w'_i = 1/s_i - 1/s_{i-1}

Plays of a curve of the drive are inverted likewise, and then the curve.  In parallel with a dynamic
block, the plays are inverted with that block's gain at one frequency.
Source: Krejci & Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import (
    FOH,
    AbstractBlock,
    AbstractLinearBlock,
    AmplitudeDependence,
    BoucWen,
    CubicNonlinearity,
    Delay,
    DriveMemory,
    Electrostriction,
    MainsInterference,
    MinorLoopMemory,
    Parallel,
    PrandtlIshlinskii,
    QuasiStaticForce,
    Saturation,
    SensorNonlinearity,
    Series,
    ThermalDrift,
)
from .._blocks.minor_loop_memory import play_after_history
from .._operators import Grid


class Inversion(NamedTuple):
    """A block from response to drive, and whether it is the exact inverse, up to discretisation."""

    block: AbstractBlock
    exact: bool


class InversePlaySum(AbstractBlock):
    """The inverse of w_0 u + Σ w_i play(u, r_i), which has the same form.

    `first` [drive/response] is the gain of the response itself, `weights` (R,) [drive/response] and
    `radii` (R,) [response] are those of the plays.  `exercised` (dimensionless, -1 to 1) is where
    the plays start, as in `AmplitudeDependence`: the inverse is exact for 0, with `constant`
    history also for 1 and -1, and otherwise once the drive has moved far.
    """

    first: float
    weights: np.ndarray
    radii: np.ndarray
    exercised: float = 0.0

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        plays = play_after_history(drive, jnp.asarray(self.radii), grid, self.exercised)
        return self.first * drive + plays @ jnp.asarray(self.weights)


def inverse_of(block: AbstractBlock, frequency: float) -> Inversion | None:
    """The inverse of a block, else an approximate one; None where there is no rule for the block.

    An approximate inverse uses dynamic parts at their gain at `frequency` [Hz], or is that of the
    block's linear part alone.
    """
    if isinstance(block, AbstractLinearBlock):
        return Inversion(block.inverse(), True)
    if isinstance(block, Series):
        last, first = inverse_of(block.second, frequency), inverse_of(block.first, frequency)
        if last is None or first is None:
            return None
        return Inversion(last.block >> first.block, last.exact and first.exact)
    if isinstance(block, AmplitudeDependence | DriveMemory | PrandtlIshlinskii | Parallel):
        plays = _inverse_play_sum(block, frequency)
        if plays is not None:
            return plays
    part = _linear_part(block)
    return None if part is None else Inversion(part.inverse(), False)


def obstacles_to_inversion(block: AbstractBlock) -> tuple[str, ...]:
    """Why a part of a block has no inverse in closed form although its kind has one, in sentences
    of a report."""
    if isinstance(block, Series | Parallel):
        return obstacles_to_inversion(block.first) + obstacles_to_inversion(block.second)
    if not isinstance(block, PrandtlIshlinskii):
        return ()
    low, high = np.min(block.slopes), np.max(block.slopes)
    if low * high > 0:
        return ()
    return (
        "The Prandtl-Ishlinskii model has no inverse in closed form, for which its slopes after a "
        f"turn must have one sign: they run from {low:.3g} to {high:.3g} (response per drive). "
        "The drive was found by iteration.",
    )


def _linear_part(block: AbstractBlock) -> AbstractLinearBlock | None:
    """The part of a block that obeys superposition, or its steepest gain; None without either."""
    match block:
        case AbstractLinearBlock():
            return block
        case FOH():
            return block.linear_part
        case Electrostriction() | CubicNonlinearity() | AmplitudeDependence() | DriveMemory():
            return QuasiStaticForce(1.0)
        case SensorNonlinearity() | Saturation() | Delay():
            return QuasiStaticForce(1.0)
        case MinorLoopMemory() | PrandtlIshlinskii():
            return QuasiStaticForce(float(np.sum(block.weights.value)))
        case BoucWen():
            steepest = np.maximum(0.0, block.rho.value * block.k_h.value)
            return QuasiStaticForce(float(block.k_u.value + steepest))
        case Series():
            first, second = _linear_part(block.first), _linear_part(block.second)
            return None if first is None or second is None else _linear(first >> second)
        case Parallel():
            parts = [_linear_part(side) for side in (block.first, block.second)]
            linear = [part for part in parts if part is not None]
            return _linear(linear[0] + linear[1]) if len(linear) == 2 else next(iter(linear), None)
    return None


def _linear(block: AbstractBlock) -> AbstractLinearBlock:
    """The same block under its narrower type."""
    assert isinstance(block, AbstractLinearBlock)  # linear blocks in series or parallel are linear
    return block


def _inverse_play_sum(
    block: AmplitudeDependence | DriveMemory | PrandtlIshlinskii | Parallel, frequency: float
) -> Inversion | None:
    """The inverse of plays in parallel with another block, or with the drive itself.

    None where the slopes change sign; exact where the other block is a gain.  `frequency` [Hz]: at
    which a dynamic block's gain is taken.
    """
    if isinstance(block, AmplitudeDependence):
        radii = np.ravel(block.radii)
        weights = np.full(radii.size, 4 * float(block.alpha.value) / radii.size)
        return _play_sum_inverse(1.0, weights, radii, True, float(block.exercised.value))
    if isinstance(block, DriveMemory):
        shares = np.asarray(block.shares.value)
        return _play_sum_inverse(1 - float(shares.sum()), shares, np.asarray(block.radii), True)
    if isinstance(block, PrandtlIshlinskii):
        first, *weights = np.asarray(block.weights.value)
        plays = _play_sum_inverse(first, np.array(weights), np.asarray(block.radii.value)[1:], True)
        return plays and plays._replace(block=plays.block >> block.curve.inverse())
    sides = (block.first, block.second)
    memory = next((side for side in sides if isinstance(side, MinorLoopMemory)), None)
    parallel = next((_linear_part(side) for side in sides if side is not memory), None)
    if memory is None or parallel is None:
        return None
    gain = float(np.real(np.asarray(parallel.symbol(jnp.array([2j * np.pi * frequency])))[0]))
    exact = any(isinstance(side, QuasiStaticForce) for side in sides)
    weights = np.asarray(memory.weights.value)
    return _play_sum_inverse(gain, weights, np.asarray(memory.radii), exact)


def _play_sum_inverse(
    first: float, weights: np.ndarray, radii: np.ndarray, exact: bool, exercised: float = 0.0
) -> Inversion | None:
    """The inverse of first · u + Σ w_i play(u, r_i); None where its slopes change sign.

    `first`, `weights` (R,) [response/drive], `radii` (R,) [drive].
    """
    slopes = first + np.concatenate([[0.0], np.cumsum(weights)])
    if not (np.all(slopes > 0) or np.all(slopes < 0)):
        return None
    steps = np.diff(radii, prepend=0.0)
    inverse_radii = np.cumsum(np.abs(slopes[:-1]) * steps)
    plays = InversePlaySum(1 / first, np.diff(1 / slopes), inverse_radii, exercised)
    return Inversion(plays, exact)


def without_disturbances(block: AbstractBlock) -> tuple[AbstractBlock | None, tuple[str, ...]]:
    """The block without its disturbances of the recorded run, and their class names.

    A thermal drift or a mains line does not depend on the drive and will have another phase in the
    next run.  The block is None where nothing that responds to the drive remains.
    """
    if isinstance(block, ThermalDrift | MainsInterference):
        return None, (type(block).__name__,)
    if not isinstance(block, Series | Parallel):
        return block, ()
    (first, named), (second, others) = map(without_disturbances, (block.first, block.second))
    if isinstance(block, Series):
        # A block in series with a disturbance alone does not respond to the drive.
        remaining = None if first is None or second is None else first >> second
    else:
        remaining = second if first is None else first if second is None else first + second
    return remaining, (*named, *others)
