r"""Linear laws as combinations of themselves at a few chosen shapes.

The transfer functions of a law, its parameters θ anywhere within their bounds, are all but a space
of few dimensions where the drive has its power.  Shapes θ_1 … θ_J are chosen greedily so that

    G(ζ; θ) ≈ Σ_j c_j(θ) G(ζ; θ_j),     hence     G(θ) u ≈ Σ_j c_j(θ) G(θ_j) u :

the law's own responses at those shapes are a basis of its responses, and the coefficients are found
by least squares from the values of G at some eighty points ζ, whatever the recording's length.
Points are weighed by the power of what the law is driven by, on the circle |ζ| = r, r^M = e^-2: the
error there bounds that of the response in time, up to the factor e².

Of a law with one shape the coefficients are analytic in that.  Where its Chebyshev series ends
before degree 64, it takes the place of the values at ζ, whose complex powers cost far more.
Sources: Quarteroni, Manzoni & Negri, Reduced Basis Methods for Partial Differential Equations
(2016), ch. 6 and 7 (reduced bases and greedy choice); Trefethen, Approximation Theory and
Approximation Practice (2013), ch. 3 and 4.
"""

from __future__ import annotations

from operator import attrgetter
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy.fft
from jax import Array
from scipy.linalg import solve_triangular
from scipy.stats import qmc

from .._blocks import AbstractBlock
from .._operators import Grid, circle
from .._parameters import named_parameters, set_values
from .._prepare import Layout, layout_of
from ._chains import transfer

_POINTS = 80
_CANDIDATES = {0: 1, 1: 65, 2: 256}
_MOST_CANDIDATES = 512
_EXACT, _ROUGH = 1e-11, 1e-6
_LARGEST_RANK = 80
_STEP = 8
_ENDED = 1e-13
_BASE, _LARGEST_DEGREE = 8, 60
_LARGEST_TABLE = 2**20


def _forward(signals: np.ndarray, length: int) -> np.ndarray:
    """Transforms (d, F) of signals (M, d)."""
    return np.asarray(scipy.fft.rfft(signals.T, length, axis=1))


class Interpolation(eqx.Module):
    """Coordinates (J,) of a law among its transfer functions, from their values at ζ (F,).

    `real`, `imaginary` (F, J) project the values on an orthonormal basis, filled up with zeros.
    """

    zeta: np.ndarray | Array
    real: np.ndarray | Array
    imaginary: np.ndarray | Array

    def __call__(self, law: AbstractBlock, grid: Grid) -> Any:
        values = transfer(law, self.zeta, grid)
        return values.real @ self.real + values.imag @ self.imaginary


class ChebyshevSeries(eqx.Module):
    r"""The same of a law with one shape at most, by Chebyshev series in its place x between the
    bounds, from 1 to -1:

        Σ_r k_r exp(b_r x) T_l(r)(x) T_h(r)(T_8(x)) table_r,

    each term with a gain k, or with 1 where the law has a part without gain.  The exponentials hold
    the most of how the law's size changes with the shape, so that it is as exact where small.
    As T_h(T_8) = T_8h, the products span the polynomials below degree 64, and few steps make them.
    `part` (1 + g, R), `low` and `high` (8, R) say by ones which gain and polynomials: a product
    with them makes every number once, a choice by index would have XLA make it for each term anew.
    `growth` (1 + g,) are the b.
    """

    part: np.ndarray | Array
    low: np.ndarray | Array
    high: np.ndarray | Array
    growth: np.ndarray | Array
    table: np.ndarray | Array
    shape: str | None = eqx.field(static=True)
    gains: tuple[str, ...] = eqx.field(static=True)

    def __call__(self, law: AbstractBlock, grid: Grid) -> Any:
        values = [attrgetter(name)(law).value for name in self.gains]
        place: Any = 1.0
        if self.shape is not None:
            parameter = attrgetter(self.shape)(law)
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
    found = [x**0, x]
    while len(found) <= _BASE:
        found.append(2 * x * found[-1] - found[-2])
    return found


class Chosen(NamedTuple):
    """Laws (n) in one, each parameter an array (n, 1) of their values; the triangle (n, n) makes an
    orthonormal basis of their transfer functions: theirs = basis @ triangle."""

    coordinates: Interpolation | ChebyshevSeries
    laws: AbstractBlock
    triangle: np.ndarray

    @property
    def size(self) -> int:
        return len(self.triangle)

    def responses(self, drives: np.ndarray, grid: Grid) -> np.ndarray:
        """The laws' responses (M, d, n) to drives (M, d), but for what a held value adds.

        As `convolve` gives them, without anything to compile.
        """
        samples = len(drives)
        if grid.history == "periodic":
            zeta = np.exp(-2j * np.pi * np.arange(1, samples // 2 + 1) / samples)
            transform = _forward(drives, samples)[:, 1 : zeta.size + 1]
            length, damping = samples, np.ones(samples)
        else:
            length, radius = circle(samples)
            zeta = radius * np.exp(-2j * np.pi * np.arange(length // 2 + 1) / length)
            damping = radius ** np.arange(samples)
            moved = drives - (drives[0] if grid.history == "constant" else 0.0)
            transform = _forward((moved.T * damping).T, length)
        missing = np.zeros((drives.shape[1], int(grid.history == "periodic")))
        found = np.empty((*drives.shape, self.size))
        at_once = max(_LARGEST_TABLE // zeta.size, 1)
        for k in range(0, self.size, at_once):
            some = _some_of(self.laws, slice(k, k + at_once))
            for law, values in enumerate(np.atleast_2d(transfer(some, zeta, grid)), k):
                whole = np.concatenate([missing, values * transform], axis=1)
                response = np.asarray(scipy.fft.irfft(whole, length, axis=1))[:, :samples] / damping
                found[:, :, law] = response.T
        return found

    def in_coordinates(self, rows: np.ndarray) -> np.ndarray:
        """What coordinates (J,) are multiplied by, given the laws' (n), along the last axis."""
        flat = np.moveaxis(rows, -1, 0).reshape(self.size, int(np.prod(rows.shape[:-1])))
        flat = solve_triangular(self.triangle.T, flat, lower=True)
        solved = np.moveaxis(flat.reshape(self.size, *rows.shape[:-1]), 0, -1)
        return np.pad(solved, [(0, 0)] * (rows.ndim - 1) + [(0, -self.size % _STEP)])


def is_bounded(law: AbstractBlock) -> bool:
    """Whether all shapes of a law are single numbers with bounds, between which to choose."""
    parameters = named_parameters(law)
    return all(parameters[name].bounded and size == 1 for name, size in layout_of(law).shapes)


def shapes_at(block: AbstractBlock, layout: Layout, positions: np.ndarray) -> dict[str, np.ndarray]:
    """Values (K, 1) of the shapes at positions (K, n)."""
    parameters = named_parameters(block)
    return {
        name: np.asarray(parameters[name].from_share(share))[:, None]
        for (name, _), share in zip(layout.shapes, positions.T, strict=True)
    }


def unit_gains(layout: Layout) -> list[dict[str, float]]:
    """All gains zero, then each in turn one."""
    names = [name for name, _ in layout.gains]
    return [{name: float(name == one) for name in names} for one in ("", *names)]


def choose(law: AbstractBlock, driven_by: np.ndarray, grid: Grid) -> Chosen | None:
    """Shapes for a law with bounds, driven by signals (M, n); None where they would be too many."""
    zeta, weights = _points(driven_by, grid)
    layout = layout_of(law)
    count = len(layout.shapes)
    candidates = _CANDIDATES.get(count, _MOST_CANDIDATES)
    # Denser towards the bounds, as Chebyshev's nodes are; of one shape they are those.
    if count > 1:
        even = qmc.Sobol(count, scramble=False).random(candidates)
    else:
        even = np.linspace(0, 1, candidates)[:, None][:, :count]
    together = set_values(law, shapes_at(law, layout, (1 - np.cos(np.pi * even)) / 2))
    units = unit_gains(layout)
    values = np.zeros((len(units), candidates, zeta.size), complex)
    for at, gains in enumerate(units):
        values[at] = transfer(set_values(together, gains), zeta, grid)
    weighted = (values * weights).reshape(-1, zeta.size)
    columns = np.concatenate([np.real(weighted), np.imag(weighted)], axis=1)
    lengths = np.linalg.norm(columns, axis=1)
    usable = np.flatnonzero(lengths > 0)
    picked, basis, left = _greedy(columns[usable] / lengths[usable, None])
    if left > _ROUGH:
        return None
    picked = usable[picked]
    chosen = {
        name: np.broadcast_to(parameter.value, (candidates, 1))[picked % candidates]
        for name, parameter in named_parameters(together).items()
    }
    for name, _ in layout.gains:
        chosen[name] = np.array([units[at][name] for at in picked // candidates])[:, None]
    projector = np.pad(basis, ((0, -len(picked) % _STEP), (0, 0))).T
    found = None
    if count <= 1:
        found = _series(layout, (columns @ projector).reshape(len(units), candidates, -1))
    if found is None:
        real, imaginary = (half * weights[:, None] for half in np.split(projector, 2))
        found = Interpolation(zeta, real, imaginary)
    return Chosen(found, set_values(together, chosen), basis @ columns[picked].T)


def _series(layout: Layout, coordinates: np.ndarray) -> ChebyshevSeries | None:
    """The series of coordinates (1 + g, C, J) at Chebyshev's nodes, with gains of zero and each one
    in turn; None where it does not end."""
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
    if np.any(sizes[:, _LARGEST_DEGREE:] > _ENDED):
        return None
    level[sizes <= _ENDED] = 0.0
    # T_8h+l = 2 T_8h T_l - T_8h-l, from the highest on.
    for degree in range(min(_LARGEST_DEGREE, level.shape[1]) - 1, _BASE, -1):
        if degree % _BASE:
            level[:, degree - 2 * (degree % _BASE)] -= level[:, degree]
            level[:, degree] *= 2
    part, degree = np.nonzero(np.any(level, axis=2))
    padding = -len(part) % _STEP
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


def _some_of(laws: AbstractBlock, which: slice) -> AbstractBlock:
    return set_values(laws, {n: p.value[which] for n, p in named_parameters(laws).items()})


def _points(signals: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Points ζ (F,) and the root of the signals' power about each, that of all being 1."""
    samples = len(signals)
    if grid.history == "periodic":
        power = np.abs(_forward(signals, samples)[:, 1 : samples // 2 + 1]) ** 2
        at = _spread(power.shape[1])
        zeta = np.exp(-2j * np.pi * (at + 1) / samples)
    else:
        radius = np.exp(-2 / samples)
        moved = signals - (signals[0] if grid.history == "constant" else 0.0)
        damped = moved * (radius ** np.arange(samples))[:, None]
        power = np.abs(_forward(damped, 2 * samples)) ** 2
        at = _spread(power.shape[1])
        zeta = radius * np.exp(-1j * np.pi * at / samples)
    middles = (at[1:] + at[:-1] + 1) // 2
    # At rest every point is as good as another.
    spectrum = power.sum(axis=0) if power.any() else np.ones(power.shape[1])
    gathered = np.add.reduceat(spectrum, np.concatenate([[0], middles]))
    # Filled up to one size, for which one program is compiled.
    left = _POINTS - at.size
    zeta, gathered = np.pad(zeta, (0, left), mode="edge"), np.pad(gathered, (0, left))
    return zeta, np.sqrt(gathered / gathered.sum())


def _spread(count: int) -> np.ndarray:
    """Up to F numbers below `count`, evenly in their logarithm."""
    return np.unique(np.round(np.geomspace(1, count, _POINTS)).astype(int)) - 1


def _greedy(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Which rows (C, F) of unit length span the others, an orthonormal basis (J, F) of them, and
    the largest part of a row that lies outside."""
    outside, basis, picked = rows.copy(), np.zeros((0, rows.shape[1])), []
    while True:
        sizes = np.sqrt(np.einsum("cf,cf->c", outside, outside))
        largest = float(sizes.max(initial=0.0))
        if largest < _EXACT or len(picked) == _LARGEST_RANK:
            return np.array(picked, int), basis, largest
        picked.append(int(np.argmax(sizes)))
        # Once more, for rounding has left something along the others.
        following = outside[picked[-1]] - basis.T @ (basis @ outside[picked[-1]])
        following /= np.linalg.norm(following)
        basis = np.concatenate([basis, following[None]])
        outside -= np.outer(outside @ following, following)
