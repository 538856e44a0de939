r"""Problems whose size does not depend on how many samples there are.

Where a block is a sum of chains of linear laws (`_chains`), its response at any shapes and gains is

    y(θ) = F c(θ)

with a fixed matrix F (L, J), the laws' responses at chosen shapes, and coefficients c that take
microseconds (`_interpolation`).  With W the whitening and W [own, F, y] = Q R by one QR, all inner
products of whitened signals are those of the columns of R: the squared residual of any parameters
is

    ‖W (y - y(θ) - own a)‖² = ‖R_y - R_F c(θ) - R_own a‖²

to the error of the interpolation, which is measured against the full model at fresh shapes.  A
compressed problem answers what a `Problem` answers, in coordinates (m,) instead of samples (L,).
Sources: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413; `_interpolation`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import set_values
from .._prepare import AbstractProblem, Problem, layout_of
from ._chains import Chain, chains_of
from ._elimination import eliminated
from ._interpolation import ChebyshevSeries, Interpolation, shapes_at, unit_gains
from ._span import FRESH, Span, fresh_positions, span_of

_ROWS = 16
_NEGLIGIBLE = 1e-13
_FAR_BELOW = 0.01


class Part(eqx.Module):
    """One chain's share of a response: coefficients (J,) of its first law, times those of its last
    where there is one, times what they stand for (J, m)."""

    before: Interpolation | ChebyshevSeries
    after: Interpolation | ChebyshevSeries | None
    matrix: np.ndarray | Array

    def __call__(self, chain: Chain, grid: Grid) -> Any:
        coefficients = self.before(chain.before, grid)
        if self.after is not None and chain.after is not None:
            others = self.after(chain.after, grid)
            products = coefficients[..., :, None] * others[..., None, :]
            coefficients = products.reshape(*products.shape[:-2], -1)
        return coefficients @ self.matrix


class CompressedProblem(AbstractProblem):
    """A recording in coordinates (m,) that span all a block can answer to its drive.

    response (m,) and own (m, q) are the recording's; the first q coordinates are all that the own
    terms have.  `whitening` is the filter, all of whose taps can be exchanged where `lags`
    (taps, rows, m) say what each is applied to; else it can be scaled, `whitened` by its first tap.
    """

    parts: tuple[Part, ...]
    response: np.ndarray | Array
    own: np.ndarray | Array
    whitening: np.ndarray | Array
    whitened: np.ndarray | Array
    lags: np.ndarray | Array | None
    counted: np.ndarray | Array
    grid: Grid

    @property
    def count(self) -> Any:
        return self.counted

    def simulate(self, block: AbstractBlock) -> Any:
        """The block's response in coordinates (m,), but for a constant.

        Of a block whose parameters are NumPy arrays (K, 1), K responses (K, m), in NumPy.
        """
        chains = chains_of(block)
        assert chains is not None  # or the problem could not have been compressed
        pairs = zip(self.parts, chains, strict=True)
        return sum(part(chain, self.grid) for part, chain in pairs)

    def whiten(self, signals: Any) -> Array:
        """Coordinates (m, …) of signals through the whitening filter."""
        if self.lags is None:
            return signals * (self.whitening[0] / self.whitened)
        taps = jnp.asarray(self.whitening)[: len(self.lags)]
        return jnp.tensordot(taps, jnp.tensordot(self.lags, signals, 1), 1)


class Compressed(NamedTuple):
    """Compressed problems, and the largest error [noise standard deviations, over all samples
    together] that was found at fresh shapes against the full model, gains at their best."""

    problems: tuple[CompressedProblem, ...]
    error: float

    def serves(self, noise: float) -> bool:
        """Whether the error is far below noise of this standard deviation, in the problems' unit:
        χ² and log-densities about the optimum then err by less than a tenth."""
        return self.error <= _FAR_BELOW * noise


def compress(
    block: AbstractBlock, problems: tuple[Problem, ...], taps: int = 1
) -> Compressed | None:
    """Problems compressed for a block anywhere within its bounds.

    With `taps` 1 the filter is the problems' own and may only be scaled; with more, filters of that
    many taps can be exchanged.  None where the block is no sum of chains of linear laws, where a
    shape has no bounds, or where too many shapes would be needed.
    """
    spans = [span_of(block, problem) for problem in problems]
    made = [
        _compressed(block, problem, span, taps)
        for problem, span in zip(problems, spans, strict=True)
        if span is not None
    ]
    if len(made) < len(problems):
        return None
    compressed = tuple(problem for problem, _ in made)
    return Compressed(compressed, _error(block, compressed, [fresh for _, fresh in made]))


class _Fresh(NamedTuple):
    """What the full model answers at fresh positions, with gains of zero and by each gain, in rows
    (K, M, 1 + g) beside those of the response (M,); basis (M, k) of what compresses it."""

    rows: np.ndarray
    response: np.ndarray
    basis: np.ndarray


def _compressed(
    block: AbstractBlock, problem: Problem, span: Span, taps: int
) -> tuple[CompressedProblem, _Fresh]:
    pieces = [np.asarray(problem.own), span.signals, span.fresh]
    ends = np.cumsum([piece.shape[1] for piece in pieces])
    if taps == 1:
        orthonormal, rows = None, _rows_of(span, problem)
    else:
        signals = np.concatenate([*pieces, np.asarray(problem.response)[:, None]], axis=1)
        last = int(np.flatnonzero(problem.weights)[-1])
        orthonormal, rows = np.linalg.qr(signals[: last + 1])
    owned, spanning, tried, response = np.split(rows, ends, axis=1)
    held, response = ends[0], response[:, 0]
    # Signals may be all but dependent: only the directions in which they differ are kept.
    lengths = np.linalg.norm(spanning, axis=0) + 1e-300
    left, sizes, _ = np.linalg.svd(spanning[held:] / lengths, full_matrices=False)
    basis = left[:, sizes > _NEGLIGIBLE * sizes.max(initial=0.0)]
    beside = response[held:] - basis @ (basis.T @ response[held:])
    beside /= np.linalg.norm(beside) + 1e-300
    turned = np.zeros((len(rows), held + basis.shape[1] + 1))
    turned[:held, :held] = np.eye(held)
    turned[held:, held:] = np.column_stack([basis, beside])
    padding = -turned.shape[1] % _ROWS
    turned = np.pad(turned, ((0, 0), (0, padding)))
    compressed = CompressedProblem(
        parts=_parts(span, turned.T @ spanning),
        response=turned.T @ response,
        own=turned.T @ owned,
        whitening=np.asarray(problem.whitening),
        whitened=np.asarray(problem.whitening)[0],
        lags=None if orthonormal is None else _lags(orthonormal @ turned, problem, taps),
        counted=np.asarray(problem.count),
        grid=problem.grid,
    )
    tried = np.moveaxis(tried[held:].reshape(len(rows) - held, FRESH, -1), 1, 0)
    return compressed, _Fresh(tried, response[held:], basis)


def _rows_of(span: Span, problem: Problem) -> np.ndarray:
    """The triangle of whitened own terms, signals and response, by one QR; of recordings that share
    a drive and a whitening, by one QR for all of them and a projection each."""
    facts = (problem.weights, problem.whitening, problem.own)
    frame = _frame(span.key, b"".join(np.asarray(fact).tobytes() for fact in facts))
    response = problem.whiten(np.asarray(problem.response))
    if frame.triangle is None:
        signals = np.concatenate([np.asarray(problem.own), span.signals, span.fresh], axis=1)
        whitened = problem.whiten(signals)
        if not frame.asked:
            # Its basis would cost as much again, and most drives never come back.
            frame.asked = True
            return np.asarray(np.linalg.qr(np.column_stack([whitened, response]), mode="r"))
        frame.basis, frame.triangle = np.linalg.qr(whitened)
    along = frame.basis.T @ response
    beside = np.linalg.norm(response - frame.basis @ along)
    return np.block([[frame.triangle, along[:, None]], [np.zeros(frame.triangle.shape[1]), beside]])


@dataclass
class _Frame:
    """An orthonormal basis (L, K) of M whitened signals and their triangle (K, M), K the lesser of
    L and M, once they were asked for a second time."""

    asked: bool = False
    basis: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    triangle: np.ndarray | None = None


@lru_cache(maxsize=4)
def _frame(span: tuple, whitening: bytes) -> _Frame:
    return _Frame()


def _parts(span: Span, rows: np.ndarray) -> tuple[Part, ...]:
    """The chains' shares, from the signals' coordinates (m, n)."""
    found, at = [], 0
    for first, second in span.chosen:
        count = first.size * (1 if second is None else second.size)
        mine = rows[:, at : at + count]
        at += count
        if second is not None:
            mine = second.in_coordinates(mine.reshape(len(rows), first.size, -1))
            mine = np.moveaxis(first.in_coordinates(np.moveaxis(mine, 1, 2)), 2, 1)
        else:
            mine = first.in_coordinates(mine)
        after = None if second is None else second.coordinates
        found.append(Part(first.coordinates, after, mine.reshape(len(rows), -1).T))
    return tuple(found)


def _lags(basis: np.ndarray, problem: Problem, taps: int) -> np.ndarray:
    """What each tap of a filter is applied to (taps, rows, m), from signals (T, m) that are
    orthonormal: (shifted by one tap after the other, samples left out) = Q lags, by one QR."""
    shifted = np.stack([np.pad(basis, ((k, 0), (0, 0)))[: len(basis)] for k in range(taps)], axis=1)
    weighted = shifted * np.asarray(problem.weights)[: len(basis), None, None]
    _, sizes, right = np.linalg.svd(
        np.linalg.qr(weighted.reshape(len(basis), -1), mode="r"), full_matrices=False
    )
    rows = (sizes[:, None] * right)[sizes > _NEGLIGIBLE * sizes[0]]
    rows = np.pad(rows, ((0, -len(rows) % _ROWS), (0, 0)))
    return np.moveaxis(rows.reshape(len(rows), taps, -1), 1, 0)


def _error(
    block: AbstractBlock, compressed: tuple[CompressedProblem, ...], fresh: list[_Fresh]
) -> float:
    """The largest error at fresh positions, over all recordings together."""
    positions = fresh_positions(block)
    wanted = np.concatenate([full.rows for full in fresh], axis=1)
    found = np.concatenate(
        [
            np.einsum("mi,kgi->kmg", full.basis, _spanned(problem, full, block, positions))
            for problem, full in zip(compressed, fresh, strict=True)
        ],
        axis=1,
    )
    response = np.concatenate([full.response for full in fresh])
    largest = 0.0
    for exact, approximate in zip(wanted, found, strict=True):
        gains = np.append(1.0, eliminated(exact[:, 1:], response - exact[:, 0])[0])
        largest = max(largest, float(np.linalg.norm((exact - approximate) @ gains)))
    return largest


def _spanned(
    problem: CompressedProblem, full: _Fresh, block: AbstractBlock, positions: np.ndarray
) -> np.ndarray:
    held = problem.own.shape[1]
    return columns_at(block, problem, positions)[:, :, held : held + full.basis.shape[1]]


def columns_at(
    block: AbstractBlock, problem: CompressedProblem, positions: np.ndarray
) -> np.ndarray:
    """Compressed responses (K, 1 + g, m) at positions (K, n): with gains of zero, and the
    derivative by each gain; nothing is compiled."""
    layout = layout_of(block)
    units = unit_gains(layout)
    shapes = shapes_at(block, layout, np.repeat(positions, len(units), axis=0))
    gains = {n: np.tile([unit[n] for unit in units], len(positions))[:, None] for n in units[0]}
    found = problem.simulate(set_values(block, shapes | gains))
    shape = len(positions), len(units), problem.response.size
    columns = np.broadcast_to(found, (shape[0] * shape[1], shape[2])).reshape(shape).copy()
    columns[:, 1:] -= columns[:, :1]
    return columns
