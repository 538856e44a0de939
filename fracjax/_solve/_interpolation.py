"""Linear blocks as combinations of themselves at a few chosen shapes.

The transfer functions of a linear block, its parameters θ anywhere within their bounds, nearly span
a space of few dimensions at the frequencies where the drive has its power.  Shapes θ_1 … θ_J are
chosen greedily so that

    G(ζ; θ) ≈ Σ_j c_j(θ) G(ζ; θ_j),     hence     G(θ) u ≈ Σ_j c_j(θ) G(θ_j) u :

the block's responses at those shapes are a basis of its responses.  The coefficients are computed
by least squares from the values of G at some eighty points ζ, whatever the recording's length.  The
points are weighted by the power of the block's drive and lie on the circle |ζ| = r, r^M = e^-2: the
error there bounds that of the response in time, up to the factor e².

If the block has one shape, the coefficients are analytic functions of it.  Where their Chebyshev
series ends before degree 64, it replaces the values at ζ, whose complex powers take far longer.

Sources: Quarteroni, Manzoni & Negri, Reduced Basis Methods for Partial Differential Equations
    (2016), ch. 6 and 7 (reduced bases and greedy choice); Trefethen, Approximation Theory and
    Approximation Practice (2013), ch. 3 and 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.fft
from jax import Array
from scipy.linalg import solve_triangular

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import named_parameters, set_values
from .._prepare import Layout, layout_of
from ._chains import transfer
from ._transformed import Transformed

_CANDIDATES = {0: 1, 1: 65, 2: 256}
"""Candidates by the number of shapes; 65 are the nodes of a series of degree 64."""
_MOST_CANDIDATES = 512
"""Candidates for three shapes and more.  Chosen by judgement."""
SPANNED = 1e-11
"""The choice ends when no unit row has a larger part outside the span: near rounding."""
_ROUGH = 1e-6
"""With a larger part outside, the block has no compressed form.  Chosen by judgement."""
_LARGEST_RANK = 80
"""At most so many shapes, above which compression does not pay.  Chosen by judgement."""
_MULTIPLE = 8
"""Sizes are padded to a multiple of this, so that few programs are compiled."""
_NEGLIGIBLE = 1e-13
"""Coefficients below this share of the largest are rounding."""
_BASE, _LARGEST_DEGREE = 8, 60
"""T_8 is the inner polynomial of a series, whose coefficients from degree 60 on must vanish."""
_SOBOL = (
    (0, 0, (1,)),
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
)
"""By dimension: degree and inner coefficients of the primitive polynomial, first odd numbers."""
_LARGEST_TABLE = 2**21
"""At most so many transfer function values at once, which limits memory."""


class Interpolation(eqx.Module):
    """Coordinates (J,) of a block among chosen transfer functions, from its values at ζ (F,).

    Attributes:
        zeta: (F,) points, dimensionless.
        real: (F, J) projects the real parts on an orthonormal basis, padded with zeros.
        imaginary: (F, J) projects the imaginary parts.
    """

    __getattribute__ = object.__getattribute__  # as in a block

    zeta: np.ndarray | Array
    real: np.ndarray | Array
    imaginary: np.ndarray | Array

    def __call__(self, block: AbstractBlock, grid: Grid) -> Any:
        values = transfer(block, self.zeta, grid)
        return values.real @ self.real + values.imag @ self.imaginary


class ChebyshevSeries(eqx.Module):
    """Coordinates (J,) of a block with at most one shape, by Chebyshev series.

    The argument x is the shape's position between its bounds, mapped to 1 … -1:

        Σ_r k_r exp(b_r x) T_l(r)(x) T_h(r)(T_8(x)) table_r,

    each term with a gain k, or with 1 where the block has a part without gain.  The exponentials
    describe most of the change of the block's magnitude with the shape, so that the series is
    equally accurate where it is small.  Because T_h(T_8) = T_8h, the products span the polynomials
    below degree 64 in few operations.  Selection matrices replace an index, for which XLA would
    recompute every number for each term.

    Attributes:
        part: (1 + g, R) selects each term's gain by ones.
        low: (8, R) selects each term's T_l by ones.
        high: (8, R) selects each term's T_h by ones.
        growth: (1 + g,) the b.
        table: (R, J) coefficients.
        shape: the shape's name, None where there is none.
        gains: the gains' names.
    """

    __getattribute__ = object.__getattribute__  # as in a block

    part: np.ndarray | Array
    low: np.ndarray | Array
    high: np.ndarray | Array
    growth: np.ndarray | Array
    table: np.ndarray | Array
    shape: str | None = eqx.field(static=True)
    gains: tuple[str, ...] = eqx.field(static=True)

    def __call__(self, block: AbstractBlock, grid: Grid) -> Any:
        values = [attrgetter(name)(block).value for name in self.gains]
        place: Any = 1.0
        if self.shape is not None:
            parameter = attrgetter(self.shape)(block)
            place = 1 - 2 * parameter.to_share(parameter.value)
            if isinstance(parameter.value, np.ndarray):
                place = np.asarray(place)
        every: Any = jnp if any(isinstance(v, Array) for v in (place, *values)) else np
        one, x, *gains = every.broadcast_arrays(np.ones(1), place, *values)
        sizes = every.concatenate([one, *gains], axis=-1) * every.exp(self.growth * x)
        *low, eighth = _polynomials(x)
        *high, _ = _polynomials(eighth)
        low, high = every.concatenate(low, axis=-1), every.concatenate(high, axis=-1)
        return ((sizes @ self.part) * (low @ self.low) * (high @ self.high)) @ self.table


def _polynomials(x: Any) -> list[Any]:
    """Chebyshev's T_0 … T_8 of x."""
    polynomials = [x**0, x]
    while len(polynomials) <= _BASE:
        polynomials.append(2 * x * polynomials[-1] - polynomials[-2])
    return polynomials


class ChosenShapes(NamedTuple):
    """A linear block at n chosen shapes.

    Attributes:
        coordinates: computes the coordinates (J,) of the block at any shapes.
        blocks: the block, each parameter an array (n, 1) of its chosen values.
        triangle: (n, n), which gives an orthonormal basis of the transfer functions: theirs = basis
            @ triangle.
    """

    coordinates: Interpolation | ChebyshevSeries
    blocks: AbstractBlock
    triangle: np.ndarray

    @property
    def size(self) -> int:
        """The number n of chosen shapes."""
        return len(self.triangle)

    def tables(self, zeta: np.ndarray, grid: Grid) -> Iterator[tuple[int, np.ndarray]]:
        """The blocks' transfer functions (≤ n, F) at ζ, in parts that limit memory.

        Each comes with the place of its first.
        """
        chunk = max(_LARGEST_TABLE // zeta.size, 1)
        for first in range(0, self.size, chunk):
            part = _select(self.blocks, slice(first, first + chunk))
            yield first, np.atleast_2d(transfer(part, zeta, grid))

    def in_coordinates(self, rows: np.ndarray) -> np.ndarray:
        """Factors of the coordinates (J,) from those of the blocks (n,), along the last axis."""
        flat = np.moveaxis(rows, -1, 0).reshape(self.size, int(np.prod(rows.shape[:-1])))
        flat = solve_triangular(self.triangle.T, flat, lower=True)
        solved = np.moveaxis(flat.reshape(self.size, *rows.shape[:-1]), 0, -1)
        return np.pad(solved, [(0, 0)] * (rows.ndim - 1) + [(0, -self.size % _MULTIPLE)])


def is_bounded(block: AbstractBlock) -> bool:
    """Whether all shapes of a block are single numbers with bounds."""
    parameters = named_parameters(block)
    return all(parameters[name].bounded and size == 1 for name, size in layout_of(block).shapes)


def shapes_at(block: AbstractBlock, layout: Layout, positions: np.ndarray) -> dict[str, np.ndarray]:
    """Values (K, 1) of the shapes at positions (K, n)."""
    parameters = named_parameters(block)
    return {
        name: np.asarray(parameters[name].from_share(share))[:, None]
        for (name, _), share in zip(layout.shapes, positions.T, strict=True)
    }


def unit_gains(layout: Layout) -> list[dict[str, float]]:
    """The gains by name: all zero, then each in turn one."""
    names = [name for name, _ in layout.gains]
    return [{name: float(name == one) for name in names} for one in ("", *names)]


def _spread(count: int, dimensions: int) -> np.ndarray:
    """The first points (K, d) of Sobol's sequence, which fill the unit cube evenly; those of
    `scipy.stats.qmc`, which takes longer to import than a fit takes.

    Source: Joe & Kuo, SIAM J. Sci. Comput. 30 (2008) 2635.
    """
    bits = int(count - 1).bit_length()
    order = np.arange(count)
    gray = order ^ (order >> 1)
    columns = []
    for degree, inner, numbers in _SOBOL[:dimensions]:
        odd = list(numbers) if degree else [1] * bits
        for k in range(len(odd), bits):
            new = odd[k - degree] ^ (odd[k - degree] << degree)
            for j in range(1, degree):
                new ^= ((inner >> (degree - 1 - j)) & 1) * (odd[k - j] << j)
            odd.append(new)
        point = np.zeros(count, int)
        for k in range(bits):
            point ^= ((gray >> k) & 1) * (odd[k] << (bits - 1 - k))
        columns.append(point / 2**bits)
    return np.stack(columns, axis=1)


def choose_shapes(
    block: AbstractBlock, driven_by: Transformed, grid: Grid, spanned: float = SPANNED
) -> ChosenShapes | None:
    """Shapes of a bounded block that signals drive; None where too many would be needed.

    The choice ends where all other shapes are in the span to `spanned`, as a share of their size.
    """
    zeta, weights = driven_by.points
    layout = layout_of(block)
    count = len(layout.shapes)
    candidates = _CANDIDATES.get(count, _MOST_CANDIDATES)
    # Denser towards the bounds, as Chebyshev's nodes are; for one shape they are these nodes.
    if count > 1:
        uniform = _spread(candidates, count)
    else:
        uniform = np.linspace(0, 1, candidates)[:, None][:, :count]
    all_blocks = set_values(block, shapes_at(block, layout, (1 - np.cos(np.pi * uniform)) / 2))
    units = unit_gains(layout)
    values = np.zeros((len(units), candidates, zeta.size), complex)
    for at, gains in enumerate(units):
        values[at] = transfer(set_values(all_blocks, gains), zeta, grid)
    weighted = (values * weights).reshape(-1, zeta.size)
    columns = np.concatenate([np.real(weighted), np.imag(weighted)], axis=1)
    lengths = np.linalg.norm(columns, axis=1)
    usable = np.flatnonzero(lengths > 0)
    selected, basis, remainder = _greedy(columns[usable] / lengths[usable, None], spanned)
    if remainder > _ROUGH:
        return None
    selected = usable[selected]
    chosen = {
        name: np.broadcast_to(parameter.value, (candidates, 1))[selected % candidates]
        for name, parameter in named_parameters(all_blocks).items()
    }
    for name, _ in layout.gains:
        chosen[name] = np.array([units[at][name] for at in selected // candidates])[:, None]
    projector = np.pad(basis, ((0, -len(selected) % _MULTIPLE), (0, 0))).T
    coordinates = None
    if count <= 1:
        coordinates = _series(layout, (columns @ projector).reshape(len(units), candidates, -1))
    if coordinates is None:
        real, imaginary = (half * weights[:, None] for half in np.split(projector, 2))
        coordinates = Interpolation(zeta, real, imaginary)
    return ChosenShapes(coordinates, set_values(all_blocks, chosen), basis @ columns[selected].T)


def _series(layout: Layout, coordinates: np.ndarray) -> ChebyshevSeries | None:
    """The series of coordinates (1 + g, C, J) at Chebyshev's nodes, None where it does not end.

    The coordinates are with gains of zero, and with each in turn one.
    """
    parts = coordinates - coordinates[:1] * (np.arange(len(coordinates)) > 0)[:, None, None]
    nodes = np.cos(np.linspace(0, np.pi, parts.shape[1]))
    ends = np.linalg.norm(parts, axis=2)[:, [0, -1]]
    grows = len(nodes) > 1 and ends.all(axis=1)
    growth = np.where(grows, np.log(np.where(ends > 0, ends, 1.0)) @ [0.5, -0.5], 0.0)
    level = parts * np.exp(-growth[:, None] * nodes)[:, :, None]
    if len(nodes) > 1:
        level = np.asarray(scipy.fft.dct(level, type=1, axis=1)) / (len(nodes) - 1)
        level[:, [0, -1]] /= 2
    sizes = np.abs(level).max(axis=2, initial=0.0)
    sizes = sizes / np.maximum(sizes.max(axis=1, keepdims=True), 1e-300)
    if np.any(sizes[:, _LARGEST_DEGREE:] > _NEGLIGIBLE):
        return None
    level[sizes <= _NEGLIGIBLE] = 0.0
    # T_8h+l = 2 T_8h T_l - T_8h-l, from the highest degree down.
    for degree in range(min(_LARGEST_DEGREE, level.shape[1]) - 1, _BASE, -1):
        if degree % _BASE:
            level[:, degree - 2 * (degree % _BASE)] -= level[:, degree]
            level[:, degree] *= 2
    part, degree = np.nonzero(np.any(level, axis=2))
    padding = -len(part) % _MULTIPLE
    part, degree = np.pad(part, (0, padding)), np.pad(degree, (0, padding))
    table = level[part, degree]
    table[len(part) - padding :] = 0.0
    return ChebyshevSeries(
        np.eye(len(parts))[:, part],
        np.eye(_BASE)[:, degree % _BASE],
        np.eye(_BASE)[:, degree // _BASE],
        growth,
        table,
        shape=layout.shapes[0][0] if layout.shapes else None,
        gains=tuple(name for name, _ in layout.gains),
    )


def _select(blocks: AbstractBlock, which: slice) -> AbstractBlock:
    """The block at some of the chosen values of its parameters."""
    return set_values(blocks, {n: p.value[which] for n, p in named_parameters(blocks).items()})


def _greedy(rows: np.ndarray, spanned: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Rows (C, F) of unit length that span the others, to `spanned`.

    Returned are their indices, an orthonormal basis (J, F) of them, and the largest part of a row
    that lies outside their span.
    """
    outside, basis, selected = rows.copy(), np.zeros((0, rows.shape[1])), []
    while True:
        lengths = np.sqrt(np.einsum("cf,cf->c", outside, outside))
        largest = float(lengths.max(initial=0.0))
        if largest < spanned or len(selected) == _LARGEST_RANK:
            return np.array(selected, int), basis, largest
        selected.append(int(np.argmax(lengths)))
        # Orthogonalised a second time, because of rounding.
        following = outside[selected[-1]] - basis.T @ (basis @ outside[selected[-1]])
        following /= np.linalg.norm(following)
        basis = np.concatenate([basis, following[None]])
        outside -= np.outer(outside @ following, following)
