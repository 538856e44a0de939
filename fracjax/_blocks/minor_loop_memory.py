"""Memory of turning points: a sum of play operators (Prandtl–Ishlinskii)."""

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
"""Radii as shares of the drive's span, denser where plays differ more; chosen by judgement."""
_STRETCH = 128
"""Samples of a stretch that runs in parallel with the others; chosen by judgement."""


@jax.custom_jvp
def play(drive: Array, radii: Array, before: ArrayLike) -> Array:
    """Play operators (N, R) with radii (R,): p_n = min(max(p_{n-1}, u_n - r), u_n + r).

    Each step clips the state to an interval, and a sequence of clips is a clip.  All stretches of
    the drive therefore run in parallel, each from an unbounded interval, and are joined by the
    state at the end of each.  All values are in drive units.
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
def _play_jvp(at: tuple, along: tuple) -> tuple[Array, Array]:
    """The plays (N, R) and their change, which is that of the drive where it last pushed each play,
    with that of the radius by the side of the push.

    Differentiating the clips of the intervals would take four times as long, and twice as long to
    compile.
    """
    drive, _, before = at
    drive_change, radii_change, before_change = along
    plays = play(*at)
    start = jnp.broadcast_to(before, plays.shape[1:])
    pushed = jnp.sign(jnp.diff(plays, axis=0, prepend=start[None]))
    samples = jnp.arange(drive.shape[0])[:, None]
    last = jax.lax.cummax(jnp.where(pushed == 0, -1, samples), axis=0)
    way = jnp.take_along_axis(pushed, last, axis=0)
    return plays, jnp.where(last < 0, before_change, drive_change[last] - way * radii_change)


def play_after_history(drive: Array, radii: Array, grid: Grid, exercised: ArrayLike = 0.0) -> Array:
    """Play operators (N, R) of a drive (N,), in its unit, with radii (R,).

    They start from the value that the grid's history gives the drive before the first sample, plus
    `exercised` times the radius; with `periodic` history they are steady.
    """
    plays = play(drive, radii, grid.before(drive) + exercised * radii)
    return play(drive, radii, plays[-1]) if grid.history == "periodic" else plays


def _thresholds(weights: np.ndarray, span: float) -> np.ndarray:
    """The radii (R,) [drive] for as many weights, from the drive's span."""
    for shares in (_FINE, _COARSE):
        if np.shape(weights) == shares.shape:
            return shares * span
    raise InputError.at(
        "memory of minor loops",
        f"{_FINE.size} or {_COARSE.size} weights, one for each threshold",
        f"an array of shape {np.shape(weights)}",
        "give as many, with 0 for unused thresholds",
    )


class MinorLoopMemory(AbstractBlock):
    r"""Domains that follow the drive only beyond their own thresholds, in parallel:

        y = Σ_i w_i p_i,    p_i the play of the drive with radius r_i

    There are twelve radii r_i of 2–48 % of the drive's span, or six of 3–46 % if that is enough.
    The weights have either sign, since the hysteresis of the base model may have absorbed too much.
    A loop depends on the turning points of the drive's prior history (return-point memory, wiping
    out).

    Args:
        weights: initial w_i (12,) or (6,).
        span: peak to peak of the recording's drive [drive].

    Attributes:
        weights: w_i (R,) [response/drive].
        radii: r_i (R,) [drive].

    Raises:
        InputError: if there are neither 12 nor 6 weights.

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
    r"""The same domains acting on the drive, before the rest of the model:

        v = u + Σ_i w_i (p_i - u),    p_i the play of the drive with radius r_i

    A share w_i of the drive reaches the following block only beyond r_i.  If that block is a gain,
    this one is equivalent to `MinorLoopMemory`; if it has hysteresis or depends on the rate, the
    loops of the two differ.

    Args:
        shares: initial w_i (12,) or (6,).
        span: peak to peak of the recording's drive [drive].

    Attributes:
        shares: w_i (R,), dimensionless.
        radii: r_i (R,) [drive], those of `MinorLoopMemory`.

    Raises:
        InputError: if there are neither 12 nor 6 shares.

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
    trials = []
    for shares in (_FINE, _COARSE):
        none, thinned = np.zeros(shares.size), _FINE.size / shares.size
        single = 0.03 * thinned * (np.eye(shares.size) + 0.02)
        spread = 0.01 * thinned * np.exp(-shares / np.array([[0.1], [1.0]]))
        weights = [*spread, *single]
        parallel, before = MinorLoopMemory(none, span=span), DriveMemory(none, span=span)
        trials += at_values(parallel, [{"weights": slope * w} for w in weights])
        trials += at_values(before, [{"shares": w} for w in weights])
    return trials


EFFECT = Effect(
    name="minor_loop_memory",
    site="additive",
    sentence="domains switch at different thresholds, so that the response depends on the past "
    "turning points of the drive and inner loops are flatter",
    equation="sum_i w_i play(u, r_i), or u + sum_i w_i (play(u, r_i) - u)",
    source="Brokate & Sprekels, Hysteresis and Phase Transitions (1996), chapter 2",
    trials=_trials,
    elsewhere={DriveMemory: "drive"},
    separated_by={
        "creep": "first-order reversal curves at two speeds",
        "drive_lag": "the same amplitude at two frequencies: a loop of memory keeps its width",
        "electrostriction": "first-order reversal curves",
    },
    concealed_by="the hysteresis, if the drive covers only one major loop",
    axes=("reversal", "level", "phase", "harmonics"),
    rate_independent=True,
)
