r"""Linear laws as combinations of themselves at a few chosen shapes.

The transfer functions of a law, its parameters θ anywhere within their bounds, are all but a space
of few dimensions where the drive has its power.  Shapes θ_1 … θ_J are chosen greedily so that

    G(ζ; θ) ≈ Σ_j c_j(θ) G(ζ; θ_j),     hence     G(θ) u ≈ Σ_j c_j(θ) G(θ_j) u :

the law's own responses at those shapes are a basis of its responses, and the coefficients are found
by least squares from the values of G at some eighty points ζ, whatever the recording's length.
Points are weighed by the power of what the law is driven by, on the circle |ζ| = r, r^M = e^-2: the
error there bounds that of the response in time, up to the factor e².
Source: Quarteroni, Manzoni & Negri, Reduced Basis Methods for Partial Differential Equations
(2016), ch. 6 and 7 (reduced bases and greedy choice).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
import scipy.fft
from jax import Array
from scipy.linalg import solve_triangular
from scipy.stats import qmc

from .._blocks import AbstractBlock
from .._operators import Grid
from .._operators._convolution_quadrature import circle
from .._parameters import Parameter, named_parameters, set_values
from ._chains import transfer
from ._layout import Layout, layout_of

_POINTS = 80
_CANDIDATES = {0: 1, 1: 64, 2: 256}
_MOST_CANDIDATES = 512
_EXACT, _ROUGH = 1e-11, 1e-6
_LARGEST_RANK = 80
_STEP = 8
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


class Chosen(NamedTuple):
    """Laws (n) in one, each parameter an array (n, 1) of their values; the triangle (n, n) makes an
    orthonormal basis of their transfer functions: theirs = basis @ triangle."""

    interpolation: Interpolation
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
            zeta = np.exp(-2j * np.pi * np.arange(1, (samples - 1) // 2 + 1) / samples)
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
        padding = self.interpolation.real.shape[1] - self.size
        return np.pad(solved, [(0, 0)] * (rows.ndim - 1) + [(0, padding)])


def is_bounded(law: AbstractBlock) -> bool:
    """Whether all shapes of a law are single numbers with bounds, between which to choose."""
    parameters = named_parameters(law)
    return all(parameters[name].bounded and size == 1 for name, size in layout_of(law).shapes)


def shapes_at(block: AbstractBlock, layout: Layout, positions: np.ndarray) -> dict[str, np.ndarray]:
    """Values (K, 1) of the shapes at positions (K, n)."""
    parameters = named_parameters(block)
    return {
        name: np.asarray(Parameter.from_share(parameters[name], share))[:, None]
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
    # Denser towards the bounds, as Chebyshev's nodes are.
    even = qmc.Sobol(max(count, 1), scramble=False).random(candidates)[:, :count]
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
    real, imaginary = (half * weights[:, None] for half in np.split(projector, 2))
    return Chosen(
        Interpolation(zeta, real, imaginary),
        set_values(together, chosen),
        basis @ columns[picked].T,
    )


def _some_of(laws: AbstractBlock, which: slice) -> AbstractBlock:
    return set_values(laws, {n: p.value[which] for n, p in named_parameters(laws).items()})


def _points(signals: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Points ζ (F,) and the root of the signals' power about each, that of all being 1."""
    samples = len(signals)
    if grid.history == "periodic":
        power = np.abs(_forward(signals, samples)[:, 1 : (samples - 1) // 2 + 1]) ** 2
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
    gathered = np.add.reduceat(power.sum(axis=0), np.concatenate([[0], middles]))
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
