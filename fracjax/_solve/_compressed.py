"""Problems whose size does not depend on the number of samples.

If a block is a sum of chains of linear blocks (`_chains`), its response at any shapes and gains is

    y(θ) = F c(θ)

with a fixed matrix F (L, J), the linear blocks' responses at chosen shapes, and coefficients c that
take microseconds to compute (`_interpolation`).  With W the whitening and W [own, F, y] = Q R by
one QR, all inner products of whitened signals are those of the columns of R.  The squared residual
of any parameters is

    ‖W (y - y(θ) - own a)‖² = ‖R_y - R_F c(θ) - R_own a‖²

up to the error of the interpolation, which is measured by comparison with the full model at fresh
shapes.  A compressed problem has the methods of a `Problem`, in coordinates (m,) instead of samples
(L,).

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
from ._elimination import eliminate
from ._interpolation import ChebyshevSeries, Interpolation, shapes_at, unit_gains
from ._span import FRESH, Chosen, Span, fresh_positions, span_of

_ROWS = 16
"""Rows are padded to a multiple of this, so that few programs are compiled."""
_NEGLIGIBLE = 1e-13
"""Singular values below this share of the largest are rounding."""
_SHARE_OF_NOISE = 0.01
"""Largest error of a compressed problem, as a share of the noise.  Chosen by judgement, so that χ²
has an error of less than a tenth."""


class Part(eqx.Module):
    """One chain's share of a response.

    Attributes:
        before: coefficients (J,) of its first block.
        after: coefficients (K,) of its last block, None where there is none.
        matrix: (J, m) or (J K, m), the responses in coordinates that the (products of) coefficients
            multiply.
    """

    __getattribute__ = object.__getattribute__  # as in a block

    before: Interpolation | ChebyshevSeries
    after: Interpolation | ChebyshevSeries | None
    matrix: np.ndarray | Array

    def __call__(self, chain: Chain, grid: Grid) -> Any:
        return self.coefficients(chain, grid) @ self.matrix

    def coefficients(self, chain: Chain, grid: Grid) -> Any:
        """The (products of) coefficients (J,) or (J K,) of a chain."""
        coefficients = self.before(chain.before, grid)
        if self.after is not None and chain.after is not None:
            others = self.after(chain.after, grid)
            products = coefficients[..., :, None] * others[..., None, :]
            coefficients = products.reshape(*products.shape[:-2], -1)
        return coefficients


class CompressedProblem(AbstractProblem):
    """A recording in coordinates (m,) that span all responses of a block to its drive.

    The first q coordinates are the only ones in which the own terms are not zero.

    Attributes:
        parts: the chains' shares of the response.
        response: (m,) in the response's unit.
        own: (m, q) terms that only this recording has.
        whitening: (taps,) the noise's whitening filter.
        whitened_by: the first tap of the filter that has already been applied, where `lags` is
            None.
        lags: (taps, rows, m) the matrix of each tap, so that the filter can be exchanged; None
            where it can only be scaled.
        samples: the number of samples that count.
        grid: step [s] and history of the simulation.
    """

    parts: tuple[Part, ...]
    response: np.ndarray | Array
    own: np.ndarray | Array
    whitening: np.ndarray | Array
    whitened_by: np.ndarray | Array
    lags: np.ndarray | Array | None
    samples: np.ndarray | Array
    grid: Grid

    @property
    def count(self) -> Any:
        """The number of samples that count."""
        return self.samples

    def simulate(self, block: AbstractBlock) -> Any:
        """The block's response in coordinates (m,), up to a constant.

        If the block's parameters are NumPy arrays (K, 1), it is K responses (K, m) in NumPy.
        """
        chains = chains_of(block)
        assert chains is not None  # a compressed problem's block is a sum of chains
        pairs = zip(self.parts, chains, strict=True)
        return sum(part(chain, self.grid) for part, chain in pairs)

    def whiten(self, signals: Any) -> Array:
        """Coordinates (m, …) of signals after the whitening filter."""
        if self.lags is None:
            return signals * (self.whitening[0] / self.whitened_by)
        taps = jnp.asarray(self.whitening)[: len(self.lags)]
        return jnp.tensordot(taps, jnp.tensordot(self.lags, signals, 1), 1)


class Compressed(NamedTuple):
    """Compressed problems with their accuracy.

    Attributes:
        problems: one per recording.
        error: the largest error [noise standard deviations, over all samples together] compared
            with the full model at fresh shapes, gains at their optimum.
    """

    problems: tuple[CompressedProblem, ...]
    error: float

    def is_accurate_for(self, noise: float) -> bool:
        """Whether the error is far below noise of this standard deviation, in the problems' unit.

        χ² and log-densities near the optimum then have an error of less than a tenth.
        """
        return self.error <= _SHARE_OF_NOISE * noise


def compress(
    block: AbstractBlock, problems: tuple[Problem, ...], taps: int = 1
) -> Compressed | None:
    """Problems compressed for a block anywhere within its bounds.

    With `taps` = 1 the filter is the problems' own and can only be scaled; with more, filters of
    that many taps can be exchanged.  None where the block is no sum of chains of linear blocks,
    where a shape has no bounds, or where too many shapes would be needed.
    """
    spans = [span_of(block, problem) for problem in problems]
    made = [
        _compress_problem(block, problem, span, taps)
        for problem, span in zip(problems, spans, strict=True)
        if span is not None
    ]
    if len(made) < len(problems):
        return None
    compressed = tuple(problem for problem, _ in made)
    return Compressed(compressed, _error(block, compressed, [fresh for _, fresh in made]))


class _FullModel(NamedTuple):
    """The full model's responses at fresh positions, in rows.

    Attributes:
        rows: (K, M, 1 + g), with gains of zero, and by each gain.
        response: (M,), the recording's.
        basis: (M, k), the coordinates of the compressed problem.
    """

    rows: np.ndarray
    response: np.ndarray
    basis: np.ndarray


def _compress_problem(
    block: AbstractBlock, problem: Problem, span: Span, taps: int
) -> tuple[CompressedProblem, _FullModel]:
    """The compressed problem of a recording, and the full model to compare it with."""
    pieces = [np.asarray(problem.own), span.signals, span.fresh]
    ends = np.cumsum([piece.shape[1] for piece in pieces])
    if taps == 1:
        samples_basis, rows = None, _rows_of(span, problem)
    else:
        signals = np.concatenate([*pieces, np.asarray(problem.response)[:, None]], axis=1)
        last = int(np.flatnonzero(problem.weights)[-1])
        samples_basis, rows = np.linalg.qr(signals[: last + 1])
    own_rows, span_rows, fresh_rows, response = np.split(rows, ends, axis=1)
    own_count, response = ends[0], response[:, 0]
    # Signals may be nearly dependent: only the directions in which they differ are kept.
    lengths = np.linalg.norm(span_rows, axis=0) + 1e-300
    directions, sizes, _ = np.linalg.svd(span_rows[own_count:] / lengths, full_matrices=False)
    basis = directions[:, sizes > _NEGLIGIBLE * sizes.max(initial=0.0)]
    outside = response[own_count:] - basis @ (basis.T @ response[own_count:])
    outside /= np.linalg.norm(outside) + 1e-300
    turned = np.zeros((len(rows), own_count + basis.shape[1] + 1))
    turned[:own_count, :own_count] = np.eye(own_count)
    turned[own_count:, own_count:] = np.column_stack([basis, outside])
    padding = -turned.shape[1] % _ROWS
    turned = np.pad(turned, ((0, 0), (0, padding)))
    compressed = CompressedProblem(
        parts=parts_of(span.chosen, turned.T @ span_rows),
        response=turned.T @ response,
        own=turned.T @ own_rows,
        whitening=np.asarray(problem.whitening),
        whitened_by=np.asarray(problem.whitening)[0],
        lags=None if samples_basis is None else _lags(samples_basis @ turned, problem, taps),
        samples=np.asarray(problem.count),
        grid=problem.grid,
    )
    fresh_rows = np.moveaxis(fresh_rows[own_count:].reshape(len(rows) - own_count, FRESH, -1), 1, 0)
    return compressed, _FullModel(fresh_rows, response[own_count:], basis)


def _rows_of(span: Span, problem: Problem) -> np.ndarray:
    """The triangle of whitened own terms, signals and response, by one QR.

    Recordings that share a drive and a whitening share one QR, followed by a projection each.
    """
    inputs = (problem.weights, problem.whitening, problem.own)
    frame = _frame(span.key, b"".join(np.asarray(array).tobytes() for array in inputs))
    response = problem.whiten(np.asarray(problem.response))
    if frame.triangle is None:
        signals = np.concatenate([np.asarray(problem.own), span.signals, span.fresh], axis=1)
        whitened = problem.whiten(signals)
        if not frame.requested:
            # Computing its basis would double the time, and most drives are requested only once.
            frame.requested = True
            return np.asarray(np.linalg.qr(np.column_stack([whitened, response]), mode="r"))
        frame.basis, frame.triangle = np.linalg.qr(whitened)
    along = frame.basis.T @ response
    outside = np.linalg.norm(response - frame.basis @ along)
    return np.block(
        [[frame.triangle, along[:, None]], [np.zeros(frame.triangle.shape[1]), outside]]
    )


@dataclass
class _Frame:
    """A basis of whitened signals, kept from the second request on.

    Attributes:
        requested: whether the signals were requested before.
        basis: (L, K) orthonormal, K the smaller of L and M.
        triangle: (K, M) of the M signals, None before the second request.
    """

    requested: bool = False
    basis: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    triangle: np.ndarray | None = None


@lru_cache(maxsize=4)
def _frame(span: tuple, whitening: bytes) -> _Frame:
    """The frame of a span and a whitening, the same object for the same arguments."""
    return _Frame()


def parts_of(chosen: Chosen, rows: np.ndarray) -> tuple[Part, ...]:
    """The chains' shares, from the signals' coordinates (m, n)."""
    parts, at = [], 0
    for first, second in chosen:
        count = first.size * (1 if second is None else second.size)
        chain_rows = rows[:, at : at + count]
        at += count
        if second is not None:
            chain_rows = second.in_coordinates(chain_rows.reshape(len(rows), first.size, -1))
            chain_rows = np.moveaxis(first.in_coordinates(np.moveaxis(chain_rows, 1, 2)), 2, 1)
        else:
            chain_rows = first.in_coordinates(chain_rows)
        after = None if second is None else second.coordinates
        parts.append(Part(first.coordinates, after, chain_rows.reshape(len(rows), -1).T))
    return tuple(parts)


def _lags(basis: np.ndarray, problem: Problem, taps: int) -> np.ndarray:
    """The matrix of each tap of a filter (taps, rows, m), for orthonormal signals (T, m).

    One QR gives (signals shifted by each tap, uncounted samples zero) = Q lags.
    """
    shifted = np.stack([np.pad(basis, ((k, 0), (0, 0)))[: len(basis)] for k in range(taps)], axis=1)
    weighted = shifted * np.asarray(problem.weights)[: len(basis), None, None]
    _, sizes, right = np.linalg.svd(
        np.linalg.qr(weighted.reshape(len(basis), -1), mode="r"), full_matrices=False
    )
    rows = (sizes[:, None] * right)[sizes > _NEGLIGIBLE * sizes[0]]
    rows = np.pad(rows, ((0, -len(rows) % _ROWS), (0, 0)))
    return np.moveaxis(rows.reshape(len(rows), taps, -1), 1, 0)


def _error(
    block: AbstractBlock, compressed: tuple[CompressedProblem, ...], fresh: list[_FullModel]
) -> float:
    """The largest error at fresh positions, gains at their optimum [noise standard deviations]."""
    positions = fresh_positions(block)
    exact_columns = np.concatenate([full.rows for full in fresh], axis=1)
    approximate_columns = np.concatenate(
        [
            np.einsum("mi,kgi->kmg", full.basis, _span_columns(problem, full, block, positions))
            for problem, full in zip(compressed, fresh, strict=True)
        ],
        axis=1,
    )
    response = np.concatenate([full.response for full in fresh])
    largest = 0.0
    for exact, approximate in zip(exact_columns, approximate_columns, strict=True):
        gains = np.append(1.0, eliminate(exact[:, 1:], response - exact[:, 0])[0])
        largest = max(largest, float(np.linalg.norm((exact - approximate) @ gains)))
    return largest


def _span_columns(
    problem: CompressedProblem, full: _FullModel, block: AbstractBlock, positions: np.ndarray
) -> np.ndarray:
    """The columns of `columns_at` in the coordinates after the own terms."""
    own_count = problem.own.shape[1]
    return columns_at(block, problem, positions)[:, :, own_count : own_count + full.basis.shape[1]]


def columns_at(
    block: AbstractBlock, problem: CompressedProblem, positions: np.ndarray
) -> np.ndarray:
    """Compressed responses (K, 1 + g, m) at positions (K, n): with gains of zero, and by each gain.

    Nothing is compiled.
    """
    layout = layout_of(block)
    units = unit_gains(layout)
    shapes = shapes_at(block, layout, np.repeat(positions, len(units), axis=0))
    gains = {n: np.tile([unit[n] for unit in units], len(positions))[:, None] for n in units[0]}
    responses = problem.simulate(set_values(block, shapes | gains))
    shape = len(positions), len(units), problem.response.size
    columns = np.broadcast_to(responses, (shape[0] * shape[1], shape[2])).reshape(shape).copy()
    columns[:, 1:] -= columns[:, :1]
    return columns
