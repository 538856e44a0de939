"""A recording made ready for fitting: fine grid, history, padding, weights, whitening."""

from __future__ import annotations

import abc
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.signal import lfilter

from .._blocks import AbstractBlock
from .._operators import Grid, History, ahead, refine
from .._recording import Recording

_FILTER_TAPS = 13
_DECAYS_PER_DECADE = 2


class AbstractProblem(eqx.Module):
    """What a recording asks of a block, in samples or in other rows whose inner products tell as
    much: response (L,), own terms (L, q), and the noise's whitening filter (taps,)."""

    __getattribute__ = object.__getattribute__  # as in a block

    response: eqx.AbstractVar[np.ndarray | Array]
    own: eqx.AbstractVar[np.ndarray | Array]
    whitening: eqx.AbstractVar[np.ndarray | Array]

    @property
    @abc.abstractmethod
    def count(self) -> Any:
        """How many samples count."""

    @abc.abstractmethod
    def simulate(self, block: AbstractBlock) -> Any:
        """The block's response (L,)."""

    @abc.abstractmethod
    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) through the whitening filter, unit variance where they count."""


class Problem(AbstractProblem):
    """One recording on the block's grid.

    drive (M,) on the fine grid, response (L,) and weights (L,) on the recording's own, padded to
    a common length L so that recordings of similar length share one compiled program; whitening
    (taps,) the noise's whitening filter, zero-padded.  Weight 0 leaves a sample out.  `own` (L, q)
    are the terms that only this recording has: a constant, what an unknown past still adds, and
    steps where it may have jumped.
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
        return self.weights.sum()

    def simulate(self, block: AbstractBlock) -> Array:
        """The block's response (L,) at the recording's samples."""
        return block(jnp.asarray(self.drive), self.grid)[:: self.oversampling]

    def linearised(
        self, block: AbstractBlock, names: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Response (L,) and its derivatives (L, Σ size) with respect to the named parameters."""
        response, columns, _ = block.linearise(np.asarray(self.drive), self.grid, names, ())
        pieces = [columns[name][:: self.oversampling] for name in names]
        response = response[:: self.oversampling]
        return response, np.concatenate([np.zeros((response.size, 0)), *pieces], axis=1)

    @property
    def size(self) -> float:
        """Length of the whitened response about its mean."""
        return float(np.linalg.norm(self.whiten(self.response - self.response.mean())))

    def whiten(self, signals: Any) -> Any:
        """Signals (L, …) through the whitening filter, unit variance where the weight is 1."""
        if isinstance(signals, np.ndarray) and isinstance(self.weights, np.ndarray):
            taps = np.asarray(self.whitening)
            taps = taps[: 1 + np.flatnonzero(taps)[-1]]
            coloured = taps.size > 1 and signals.size > 0
            filtered = lfilter(taps, 1.0, signals, axis=0) if coloured else taps[0] * signals
            return (np.transpose(np.asarray(filtered)) * self.weights).T
        length, others = signals.shape[0], [(0, 0)] * (signals.ndim - 1)
        padded = jnp.pad(jnp.asarray(signals), [(_FILTER_TAPS - 1, 0), *others])
        starts = range(_FILTER_TAPS - 1, -1, -1)
        delayed = [padded[start : start + length] for start in starts]
        filtered = jnp.asarray(sum(w * d for w, d in zip(self.whitening, delayed, strict=True)))
        return filtered * self.weights.reshape(-1, *([1] * (signals.ndim - 1)))


def bucket(samples: int) -> int:
    """The next of the lengths 2^k · {1, 1.25, 1.5, 1.75}."""
    power = 2 ** int(np.floor(np.log2(samples)))
    return int(next(power * q // 4 for q in (4, 5, 6, 7, 8) if power * q // 4 >= samples))


def make_problem(
    recording: Recording,
    *,
    history: History,
    oversampling: int,
    used: np.ndarray,
    whitening: np.ndarray,
    past: bool,
    weights: np.ndarray | None = None,
    jumps: Sequence[int] = (),
) -> Problem:
    """Assemble a problem; `used` (N,) is true where a sample counts, `past` fits a prehistory and
    `jumps` a step at each of these samples; `weights` (N,) multiply the whitened residual."""
    samples = len(recording)
    drive, response = recording.drive, recording.response
    taps = np.zeros(_FILTER_TAPS)
    taps[: whitening.size] = whitening
    # A whitened sample mixes its predecessors: it counts only if all of them do.
    support = np.ones(whitening.size)
    left_out = np.asarray(lfilter(support, 1.0, np.where(used, 0.0, 1.0)))
    counts = (left_out < 0.5).astype(float)
    counts[: whitening.size - 1] = 0.0
    weights = counts if weights is None else counts * weights
    length = samples if history == "periodic" else bucket(samples)
    fine = refine(drive, oversampling, history)
    if history != "periodic":
        fine = _padded(fine, (length - samples) * oversampling)
    padding = (0, length - samples)
    steps = np.arange(length)[:, None] >= np.array(jumps, dtype=int)
    return Problem(
        drive=fine,
        response=np.pad(response, padding, mode="edge"),
        weights=np.pad(weights, padding),
        whitening=taps,
        own=np.concatenate([own_terms(length, samples if past else 0), steps], axis=1),
        grid=Grid(np.asarray(recording.dt / oversampling), history),
        oversampling=oversampling,
    )


def _padded(drive: np.ndarray, count: int) -> np.ndarray:
    """A drive and `count` samples more, the first two such that the rate at the drive's last sample
    is what it would be without them."""
    if not count:
        return drive
    longer = np.concatenate([drive, ahead(drive)])[: drive.size + count]
    left = (0, drive.size + count - longer.size)
    return np.pad(longer, left, mode="reflect", reflect_type="odd")


def own_terms(length: int, remembered: int) -> np.ndarray:
    """Columns (length, q): a constant, and exponentials that decay over 1 … `remembered` samples.

    What a drive before t = 0 still adds to the response of a law with its singularities on the
    negative real axis (powers, lags, creep) is ∫ e^(-λt) dμ(λ), whatever that drive was (the
    diffusive representation, Montseny, ESAIM Proc. 5 (1998) 159): a few λ per decade span it.
    A mode that still rings is not among them, nor a memory multiplied by the rate (FOH's k_p).
    """
    decades = np.log10(max(remembered, 1))
    rates = np.logspace(0, -decades, round(_DECAYS_PER_DECADE * decades))
    times = np.arange(length)[:, None]
    return np.concatenate([np.ones((length, 1)), np.exp(-rates * times)], axis=1)
