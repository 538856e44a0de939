"""Memory of turning points: a sum of plays (Prandtl–Ishlinskii)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._operators import Grid
from .._parameters import Parameter
from .._recording import InputError
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values

_FINE = np.array([2, 3.5, 5.5, 8, 11, 14.5, 18.5, 23, 28, 34, 41, 48]) / 100
_COARSE = np.array([3, 7, 13, 21, 32, 46]) / 100
_STRETCH = 128


@jax.custom_jvp
def play(drive: Array, radii: Array, before: ArrayLike) -> Array:
    """Play operators (N, R) with radii (R,): p_n = min(max(p_{n-1}, u_n - r), u_n + r).

    Each step clips the state to an interval, and clips compose to clips.  So all stretches of the
    drive run side by side, each from an open interval, and are joined by the state that each finds.
    """
    samples = drive.shape[0]
    stretches = -(-samples // _STRETCH)
    padded = jnp.pad(drive, (0, stretches * _STRETCH - samples), mode="edge")

    def follow(interval, level):
        low, high = (jnp.clip(end, level - radii, level + radii) for end in interval)
        return (low, high), (low, high)

    def enter(state, interval):
        return jnp.clip(state, *interval), state

    everything = jnp.full((stretches, radii.size), jnp.inf)
    levels = padded.reshape(stretches, _STRETCH).T[:, :, None]
    ends, inside = jax.lax.scan(follow, (-everything, everything), levels)
    _, entered = jax.lax.scan(enter, jnp.full(radii.shape, before), ends)
    plays = jnp.clip(entered, *inside)
    return plays.swapaxes(0, 1).reshape(-1, radii.size)[:samples]


@play.defjvp
def _moved(at: tuple, along: tuple) -> tuple[Array, Array]:
    """The plays, and what moves them: where the drive last pushed each, and from which side.

    Through the intervals, direction by direction, it would take four times as long, and twice as
    long to compile.
    """
    drive, _, before = at
    of_drive, of_radii, of_before = along
    plays = play(*at)
    start = jnp.broadcast_to(before, plays.shape[1:])
    pushed = jnp.sign(jnp.diff(plays, axis=0, prepend=start[None]))
    samples = jnp.arange(drive.shape[0])[:, None]
    last = jax.lax.cummax(jnp.where(pushed == 0, -1, samples), axis=0)
    way = jnp.take_along_axis(pushed, last, axis=0)
    return plays, jnp.where(last < 0, of_before, of_drive[last] - way * of_radii)


def play_after_history(drive: Array, radii: Array, grid: Grid, exercised: ArrayLike = 0.0) -> Array:
    """Play operators (N, R) of a drive on a grid, whose history says where they start: on the
    drive, or by a share `exercised` of their radius above it."""
    plays = play(drive, radii, grid.before(drive) + exercised * radii)
    return play(drive, radii, plays[-1]) if grid.history == "periodic" else plays


def _thresholds(weights: np.ndarray, span: float) -> np.ndarray:
    """The radii (R,) that as many weights belong to."""
    for shares in (_FINE, _COARSE):
        if np.shape(weights) == shares.shape:
            return shares * span
    raise InputError.at(
        "memory of minor loops",
        f"{_FINE.size} or {_COARSE.size} weights, one for each threshold",
        f"an array of shape {np.shape(weights)}",
        "give as many, 0 for thresholds that nothing has",
    )


class MinorLoopMemory(AbstractBlock):
    r"""Domains that follow the drive only beyond their own thresholds, side by side:

        y = Σ_i w_i p_i,    p_i the play of the drive with radius r_i

    Twelve radii r_i = 2–48 % of the drive's span, or six of 3–46 % where so many would say no more;
    the weights w_i [response/drive] enter linearly and are of either sign, since the hysteresis
    beside them may have taken up too much.  A loop then depends on the turning points the drive has
    left (return-point memory, wiping out).
    Source: Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2.
    """

    weights: Parameter
    radii: Array | np.ndarray

    def __init__(self, weights: np.ndarray, *, span: float):
        self.weights = Parameter(weights, "response/drive", gain=True)
        self.radii = _thresholds(weights, span)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return play_after_history(drive, jnp.asarray(self.radii), grid) @ self.weights.value


class DriveMemory(AbstractBlock):
    r"""The same domains where the field acts on them, ahead of what the rest of the actuator adds:

        v = u + Σ_i w_i (p_i - u),    p_i the play of the drive with radius r_i

    A share w_i of the drive, dimensionless, reaches the law after it only beyond r_i, the radii
    those of `MinorLoopMemory`.  Where that law is a gain the two are one; where it is a hysteresis
    of its own, or depends on the rate, their loops differ.
    Source: Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2.
    """

    shares: Parameter
    radii: Array | np.ndarray

    def __init__(self, shares: np.ndarray, *, span: float):
        self.shares = Parameter(shares, plausible=(-0.3, 0.3), gain=True)
        self.radii = _thresholds(shares, span)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        plays = play_after_history(drive, jnp.asarray(self.radii), grid)
        return drive + (plays - drive[:, None]) @ self.shares.value


def _trials(setting: Setting) -> list:
    span, slope = setting.drive_span, setting.response_span / setting.drive_span
    found = []
    for shares in (_FINE, _COARSE):
        none, thinned = np.zeros(shares.size), _FINE.size / shares.size
        single = 0.03 * thinned * (np.eye(shares.size) + 0.02)
        spread = 0.01 * thinned * np.exp(-shares / np.array([[0.1], [1.0]]))
        weights = [*spread, *single]
        beside, ahead = MinorLoopMemory(none, span=span), DriveMemory(none, span=span)
        found += at_values(beside, [{"weights": slope * w} for w in weights])
        found += at_values(ahead, [{"shares": w} for w in weights])
    return found


EFFECT = Effect(
    name="minor_loop_memory",
    site="additive",
    sentence="domains switch at their own thresholds, so that the response remembers the turning "
    "points of the drive and inner loops are flatter",
    equation="sum_i w_i play(u, r_i), or u + sum_i w_i (play(u, r_i) - u)",
    source="Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2",
    trials=_trials,
    elsewhere={DriveMemory: "drive"},
    separated_by={
        "creep": "first-order reversal curves at two speeds",
        "drive_lag": "the same amplitude at two frequencies: memory's loop keeps its width",
        "electrostriction": "first-order reversal curves",
    },
    concealed_by="the hysteresis, while only one major loop is driven",
    axes=("reversal", "level", "phase", "harmonics"),
)
