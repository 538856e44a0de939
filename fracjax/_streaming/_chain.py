"""A model as a chain of stages, each of which has an inverse; what has none is refused."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock, AbstractLinearBlock, Delay, LinearSeries, Series
from .._recording import InputError
from .._systems import rational
from ._sections import LEAD, Linear, Sampling, Section, lead, section_of, static_gain
from ._stages import Filtered, Solved, Stage

_SWINGS, _SAMPLES = (1.0, 0.8, 0.6, 0.4, 0.25, 0.12), 200
"""The drive of the test for an inverse: swings of these shares of the range, and the samples
between two turns; chosen by judgement."""
_SLIGHT = 1e-3
"""A slope of this order of s is rounding; chosen by judgement."""
WIDER = 0.25
"""Within the chain, a stage's drive may leave the range of the test by so many spans, as creep may
ask; further away a curve that was fitted within it may turn.  Chosen by judgement."""


class Chain(NamedTuple):
    """The stages in the order in which the drive passes them.

    `ranges` (K, 2) are the brackets of their drives; `steady` is how far the gains of each may
    change, as shares of themselves, before a slope could lose its sign.
    """

    stages: tuple[Stage, ...]
    ranges: np.ndarray
    steady: tuple[float, ...]

    def start(self, drive: Array) -> tuple[Array, tuple]:
        """The response at rest at a drive, and the states."""
        states = []
        for stage in self.stages:
            drive, state = stage.start(drive)
            states.append(state)
        return drive, tuple(states)


def chain_of(block: AbstractBlock, sampling: Sampling) -> Chain:
    """The stages of a block.

    Raises InputError where a law has no section, or its slope changes sign, so that one response
    would have several drives.
    """
    drive = np.concatenate([[0.5], *(_swing(share) for share in _SWINGS)])
    drive = sampling.low + (sampling.high - sampling.low) * drive
    stages, ranges, steady = [], [(sampling.low, sampling.high)], []
    for part in _parts(block):
        span = ranges[-1][1] - ranges[-1][0]
        if isinstance(part, Delay):
            delay = float(part.delay.value)
            ahead = Linear(
                lead(delay), 1.0, sampling.step, "delay", lambda s, t=delay: jnp.exp(t * s), LEAD
            )
            stages.append(Filtered(ahead, span))
            steady.append(0.0)
        elif isinstance(part, AbstractLinearBlock):
            inverse, static = part.inverse(), static_gain(part)
            system = rational(inverse, sampling.band)
            static = 1 / static if static else 0.0
            name = f"inverse of {type(part).__name__}"
            ahead = Linear(
                system, static, sampling.step, name, inverse.symbol, _derivatives(inverse)
            )
            stages.append(Filtered(ahead, span))
            drive = static_gain(part) * drive
            steady.append(0.0)
        else:
            section = section_of(part, sampling)
            slow = _rest_slope(section, drive.min(), drive.max())
            drive, slopes = _swept(section, drive)
            total = slopes @ section.gains
            if not (np.all(total > 0) or np.all(total < 0)) or total[0] * slow < 0:
                raise InputError.at(
                    "streaming inverse",
                    "a model whose response moves the same way as its drive, fast and slowly",
                    f"{type(part).__name__} with slopes from {total.min():.3g} to "
                    f"{total.max():.3g}, and {slow:.3g} at rest (response per drive)",
                    "fit another model, or use compensate for a motion that is known ahead",
                )
            stages.append(Solved(section, bool(total[0] > 0), span))
            steady.append(float(np.min(np.abs(total) / (np.abs(slopes) @ np.abs(section.gains)))))
        middle, half = (drive.max() + drive.min()) / 2, (0.5 + WIDER) * np.ptp(drive)
        ranges.append((middle - half, middle + half))
    return Chain(tuple(stages), np.array(ranges), tuple(steady))


def _parts(block: AbstractBlock) -> list[AbstractBlock]:
    """The blocks in series, adjacent linear ones as one."""
    if not isinstance(block, Series):
        return [block]
    first, second = _parts(block.first), _parts(block.second)
    one, two = first[-1], second[0]
    if isinstance(one, AbstractLinearBlock) and isinstance(two, AbstractLinearBlock):
        return [*first[:-1], LinearSeries(one, two), *second[1:]]
    return first + second


def _derivatives(inverse: AbstractLinearBlock) -> int:
    """The highest derivative of its drive that an inverse responds to."""
    s = 1j * np.array([1e9, 1e10])
    with jax.enable_x64(True):
        first, second = np.abs(np.asarray(inverse.symbol(jnp.asarray(s))))
    return max(int(np.ceil(np.log10(second / first) - _SLIGHT)), 0)


def _swing(share: float) -> np.ndarray:
    """From the middle down, up and back, as shares of the range."""
    down, up = (1 - share) / 2, (1 + share) / 2
    levels = np.interp(
        np.arange(4 * _SAMPLES), _SAMPLES * np.array([0, 1, 3, 4]), [0.5, down, up, 0.5]
    )
    return levels[1:]


def _rest_slope(section: Section, low: float, high: float) -> float:
    """The slope of the response at rest between two drives; a law that responds faster the other
    way has an inverse that grows without bound."""
    with jax.enable_x64(True):
        drives = [jnp.asarray(end) for end in (low, high)]
        rests = [section.response(section.start(drive))(drive)[0] for drive in drives]
    return (float(rests[1]) - float(rests[0])) / (high - low)


def _swept(section: Section, drive: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Responses (N,) along a drive (N,), and the slopes (N, g) of the features at each sample."""

    def one(state, level: Array):
        respond = section.begin(state)
        features, slopes, after = jax.jvp(respond, (level,), (jnp.ones_like(level),), has_aux=True)
        return after, (jnp.sum(section.gains * features), slopes)

    with jax.enable_x64(True):
        levels = jnp.asarray(drive)
        start = section.start(levels[0])
        responses, slopes = jax.jit(lambda s, x: jax.lax.scan(one, s, x))(start, levels)[1]
        return np.asarray(responses), np.asarray(slopes)[1:]
