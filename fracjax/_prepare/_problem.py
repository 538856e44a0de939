"""A recording prepared for fitting: fine grid, history, padding, weights, whitening."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._filters import moving_sum
from .._operators import Grid, History, ahead, refine
from .._recording import Recording, kept

_FILTER_TAPS = 13
"""Length of every whitening filter, for one compiled program: an autoregression of order 12."""
_LARGEST_KEPT = 2**15
"""Most samples of a finer drive that is kept, which limits memory.  Chosen by judgement."""
_DECAYS_PER_DECADE = 2
"""Exponentials per decade of decay times.  Chosen by judgement."""


class AbstractProblem(eqx.Module):
    """The data of a fit to one recording, in samples or in other rows with the same inner products.

    Attributes:
        response: (L,) in the response's unit.
        own: (L, q) terms that only this recording has.
        whitening: (taps,) the noise's whitening filter.
    """

    __getattribute__ = object.__getattribute__  # as in a block

    response: eqx.AbstractVar[np.ndarray | Array]
    own: eqx.AbstractVar[np.ndarray | Array]
    whitening: eqx.AbstractVar[np.ndarray | Array]

    @property
    @abc.abstractmethod
    def count(self) -> Any:
        """The number of samples that count."""

    @abc.abstractmethod
    def simulate(self, block: AbstractBlock) -> Any:
        """The block's response (L,)."""

    @abc.abstractmethod
    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) after the whitening filter, of unit variance where they count."""


class Problem(AbstractProblem):
    """One recording on the block's grid.

    Recordings are padded to a common length L, so that recordings of similar length share one
    compiled program.

    Attributes:
        drive: (M,) on the fine grid, in the drive's unit.
        response: (L,) at the recording's samples, in its unit.
        weights: (L,) factors of the whitened residual, 0 for a sample that does not count.
        whitening: (taps,) the noise's whitening filter, zero-padded.
        own: (L, q) terms that only this recording has: a constant, the effect of an unknown prior
            history, and steps where it may have jumped.
        grid: step [s] and history of the simulation.
        oversampling: steps per sample.
    """

    drive: np.ndarray | Array
    response: np.ndarray | Array
    weights: np.ndarray | Array
    whitening: np.ndarray | Array
    own: np.ndarray | Array
    grid: Grid
    oversampling: int = eqx.field(static=True)

    @property
    def count(self) -> Any:
        """The number of samples that count."""
        return self.weights.sum()

    def simulate(self, block: AbstractBlock) -> Array:
        """The block's response (L,) at the recording's samples."""
        return block(jnp.asarray(self.drive), self.grid)[:: self.oversampling]

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The response (L,) and its derivatives (L, Σ size) by the named parameters."""
        response, columns, _ = block.linearise(self._octave(), self.grid, names, ())
        pieces = [self._sampled(columns[name]) for name in names]
        response = self._sampled(response)
        return response, np.concatenate([np.zeros((response.size, 0)), *pieces], axis=1)

    def respond(self, block: AbstractBlock) -> np.ndarray:
        """The block's response (L,) at the recording's samples, by its compiled program."""
        return self._sampled(block.respond(self._octave(), self.grid))

    def _octave(self) -> np.ndarray:
        """The drive, extended to a power of two of samples, which steady cycles are not: all
        recordings of an octave have one program."""
        drive = np.asarray(self.drive)
        if self.grid.history == "periodic":
            return drive
        return _extended(drive, 2 ** (drive.size - 1).bit_length() - drive.size)

    def _sampled(self, signals: np.ndarray) -> np.ndarray:
        """Signals (M, …) on the finer grid and beyond the drive, at the recording's samples."""
        return signals[: np.size(self.drive) : self.oversampling]

    @property
    def size(self) -> float:
        """The norm of the whitened response about its mean."""
        return float(np.linalg.norm(self.whiten(self.response - self.response.mean())))

    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) after the whitening filter, of unit variance where the weight is 1."""
        if isinstance(signals, np.ndarray) and isinstance(self.weights, np.ndarray):
            taps = np.asarray(self.whitening)
            taps = taps[: 1 + np.flatnonzero(taps)[-1]]
            if taps.size == 1 or not signals.size:
                return (signals.T * (taps[0] * self.weights)).T
            return (moving_sum(taps, signals).T * self.weights).T
        length, others = signals.shape[0], [(0, 0)] * (signals.ndim - 1)
        padded = jnp.pad(jnp.asarray(signals), [(_FILTER_TAPS - 1, 0), *others])
        starts = range(_FILTER_TAPS - 1, -1, -1)
        delayed = [padded[start : start + length] for start in starts]
        filtered = jnp.asarray(sum(w * d for w, d in zip(self.whitening, delayed, strict=True)))
        return filtered * self.weights.reshape(-1, *([1] * (signals.ndim - 1)))


def padded_length(samples: int) -> int:
    """The smallest length of the form 2^k · {1, 1.25, 1.5, 1.75} that holds this many samples."""
    power = 2 ** int(np.floor(np.log2(samples)))
    return int(next(power * q // 4 for q in (4, 5, 6, 7, 8) if power * q // 4 >= samples))


def make_problem(
    recording: Recording,
    *,
    history: History,
    oversampling: int,
    used: np.ndarray,
    whitening: np.ndarray,
    prior_history: bool,
    weights: np.ndarray | None = None,
    jumps: Sequence[int] = (),
) -> Problem:
    """The problem of a recording.

    `used` (N,) is true where a sample counts, and `weights` (N,) multiply the whitened residual.
    With `prior_history` the effect of an unknown drive before t = 0 is fitted, and with `jumps` a
    step at each of these samples.
    """
    samples = len(recording)
    drive, response = recording.drive, recording.response
    length = samples if history == "periodic" else padded_length(samples)
    padded = np.empty(length)
    padded[:samples], padded[samples:] = response, response[-1]
    own = own_terms(length, samples if prior_history else 0)
    if len(jumps):
        steps = np.arange(length)[:, None] >= np.array(jumps, dtype=int)
        own = np.concatenate([own, steps], axis=1)
    refined = _kept_refined if 1 < oversampling <= _LARGEST_KEPT / samples else _refined
    return _problem_of(
        drive=refined(drive, length - samples, oversampling, history),
        response=padded,
        own=own,
        grid=_grid(recording.dt / oversampling, history),
        oversampling=oversampling,
        **_weighting(length, used, whitening, weights),
    )


def with_weighting(
    problem: Problem, used: np.ndarray, whitening: np.ndarray, weights: np.ndarray | None
) -> Problem:
    """The problem of the same recording on the same grid with another whitening, as `make_problem`
    makes it."""
    weighting = _weighting(len(problem.response), used, whitening, weights)
    return _problem_of(**(vars(problem) | weighting))


def _weighting(
    length: int, used: np.ndarray, whitening: np.ndarray, weights: np.ndarray | None
) -> dict[str, np.ndarray]:
    """The weights and the whitening filter of a problem of a padded length."""
    samples = used.size
    taps = np.zeros(_FILTER_TAPS)
    taps[: whitening.size] = whitening
    # A whitened sample mixes its predecessors: it counts only if all of them do.
    counted = np.zeros(length)
    counted[:samples] = used
    if whitening.size > 1 and not used.all():
        uncounted = moving_sum(np.ones(whitening.size), 1.0 - counted[:samples])
        counted[:samples] = uncounted < 0.5
    counted[: whitening.size - 1] = 0.0
    if weights is not None:
        counted[:samples] *= weights
    return {"weights": counted, "whitening": taps}


def _problem_of(**fields: Any) -> Problem:
    """A problem, made as unflattening a tree makes one: equinox's checks take as long as the rest
    of it."""
    problem = object.__new__(Problem)
    for name, value in fields.items():
        object.__setattr__(problem, name, value)
    return problem


@lru_cache(maxsize=16)
def _grid(step: float, history: History) -> Grid:
    """A grid with a step [s], which all recordings alike share."""
    return Grid(np.asarray(step), history)


def _refined(drive: np.ndarray, padding: int, oversampling: int, history: History) -> np.ndarray:
    """A drive (N,) on the finer grid, with `padding` more samples, which steady cycles have not."""
    return _extended(refine(drive, oversampling, history), padding * oversampling)


_kept_refined = kept(_refined)


def _extended(drive: np.ndarray, count: int) -> np.ndarray:
    """A drive (M,) with `count` more samples.

    The first two are chosen so that the rate at the drive's last sample is the same as without
    them.
    """
    if not count:
        return drive
    longer = np.concatenate([drive, ahead(drive)])[: drive.size + count]
    count -= longer.size - drive.size
    return np.concatenate([longer, 2 * longer[-1] - longer[-2 : -count - 2 : -1]])


def own_terms(length: int, remembered: int) -> np.ndarray:
    """Columns (length, q): a constant, and exponentials that decay over 1 … `remembered` samples.

    The effect of a drive before t = 0 on the response of a block with its singularities on the
    negative real axis (powers, lags, creep) is ∫ e^(-λt) dμ(λ), whatever that drive was: a few λ
    per decade span it.  A mode that still oscillates is not among them, nor a memory multiplied by
    the rate (FOH's k_p).

    Source: diffusive representation, Montseny, ESAIM Proc. 5 (1998) 159.
    """
    constant = np.ones((length, 1))
    if not remembered:
        return constant
    rates = np.logspace(0, -np.log10(remembered), round(_DECAYS_PER_DECADE * np.log10(remembered)))
    return np.concatenate([constant, np.exp(-rates * np.arange(length)[:, None])], axis=1)
