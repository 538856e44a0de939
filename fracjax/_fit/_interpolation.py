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

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.stats import qmc

from .._blocks import AbstractBlock
from .._operators import Grid
from .._parameters import named_parameters
from ._chains import transfer
from ._layout import layout_of, placed, with_gains

_POINTS = 80
_CANDIDATES = {0: 1, 1: 64, 2: 256}
_MOST_CANDIDATES = 512
_EXACT = 1e-11
_LARGEST_RANK = 80
_STEP = 16


class Interpolation(eqx.Module):
    """Coordinates (J,) of a law among its transfer functions: projector (2F, J) on values at ζ (F,).

    The coordinates refer to an orthonormal basis, and those behind the last one are zero.
    """

    zeta: np.ndarray | Array
    projector: np.ndarray | Array

    def __call__(self, law: AbstractBlock, grid: Grid) -> Array:
        values = transfer(law, self.zeta, grid)
        return jnp.concatenate([values.real, values.imag]) @ self.projector


class Chosen(NamedTuple):
    """The laws (n) at the chosen shapes, and the triangle (n, n) that makes an orthonormal basis of
    their transfer functions: theirs = basis @ triangle."""

    interpolation: Interpolation
    laws: list[AbstractBlock]
    triangle: np.ndarray

    def in_coordinates(self, rows: np.ndarray) -> np.ndarray:
        """What coordinates (J,) are multiplied by, from what the laws (n) are, along the last axis."""
        solved = np.linalg.solve(self.triangle.T, np.moveaxis(rows, -1, 0).reshape(len(self.laws), -1))
        solved = np.moveaxis(solved.reshape(len(self.laws), *rows.shape[:-1]), 0, -1)
        padding = self.interpolation.projector.shape[1] - len(self.laws)
        return np.pad(solved, [(0, 0)] * (rows.ndim - 1) + [(0, padding)])


def is_bounded(law: AbstractBlock) -> bool:
    """Whether all shapes of a law have bounds, between which they can be chosen."""
    parameters = named_parameters(law)
    return all(parameters[name].bounded for name, _ in layout_of(law).shapes)


def choose(law: AbstractBlock, driven_by: np.ndarray, grid: Grid) -> Chosen | None:
    """Shapes for a law with bounds driven by signals (M, n); None where too many would be needed."""
    zeta, weights = _points(driven_by, grid)
    layout = layout_of(law)
    count = sum(size for _, size in layout.shapes)
    candidates = _CANDIDATES.get(count, _MOST_CANDIDATES)
    # Denser towards the bounds, as Chebyshev's nodes are.
    even = qmc.Sobol(max(count, 1), scramble=False).random(candidates)[:, :count]
    positions = (1 - np.cos(np.pi * even)) / 2
    gains = np.eye(sum(size for _, size in layout.gains) + 1)[:, 1:]
    values = np.asarray(_values(law, positions, gains, zeta, grid)).reshape(-1, zeta.size) * weights
    columns = np.concatenate([values.real, values.imag], axis=1)
    lengths = np.linalg.norm(columns, axis=1)
    usable = np.flatnonzero(lengths > 0)
    picked, basis = _greedy(columns[usable] / lengths[usable, None])
    if len(picked) == _LARGEST_RANK:
        return None
    picked = usable[picked]
    laws = [
        with_gains(placed(law, positions[k // len(gains)]), gains[k % len(gains)]) for k in picked
    ]
    laws = [jax.tree_util.tree_map(np.asarray, chosen) for chosen in laws]
    padded = np.pad(basis, ((0, -len(picked) % _STEP), (0, 0)))
    projector = padded.T * np.tile(weights, 2)[:, None]
    return Chosen(Interpolation(zeta, projector), laws, basis @ columns[picked].T)


@eqx.filter_jit
def _values(
    law: AbstractBlock, positions: np.ndarray, gains: np.ndarray, zeta: np.ndarray, grid: Grid
) -> Array:
    """Transfer functions (C, G, F) at positions (C, n) of the shapes and gains (G, g)."""

    def at(position: Array, gain: Array) -> Array:
        return transfer(with_gains(placed(law, position), gain), zeta, grid)

    return jax.vmap(lambda p: jax.vmap(lambda g: at(p, g))(jnp.asarray(gains)))(
        jnp.asarray(positions)
    )


def _points(signals: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Points ζ (F,) and the root of the signals' power about each, that of all being 1."""
    samples = len(signals)
    if grid.history == "periodic":
        power = np.sum(np.abs(np.fft.rfft(signals, axis=0)[1 : samples // 2]) ** 2, axis=1)
        at = _spread(power.size)
        zeta = np.exp(-2j * np.pi * (at + 1) / samples)
    else:
        radius = np.exp(-2 / samples)
        moved = signals - (signals[0] if grid.history == "constant" else 0.0)
        damped = moved * (radius ** np.arange(samples))[:, None]
        power = np.sum(np.abs(np.fft.rfft(damped, 2 * samples, axis=0)) ** 2, axis=1)
        at = _spread(power.size)
        zeta = radius * np.exp(-1j * np.pi * at / samples)
    middles = (at[1:] + at[:-1] + 1) // 2
    gathered = np.add.reduceat(power, np.concatenate([[0], middles]))
    # Filled up to one size, for which one program is compiled.
    left = _POINTS - at.size
    zeta, gathered = np.pad(zeta, (0, left), mode="edge"), np.pad(gathered, (0, left))
    return zeta, np.sqrt(gathered / gathered.sum())


def _spread(count: int) -> np.ndarray:
    """Up to F numbers below `count`, evenly in their logarithm."""
    return np.unique(np.round(np.geomspace(1, count, _POINTS)).astype(int)) - 1


def _greedy(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which rows (C, F) of unit length span the others, and an orthonormal basis (J, F) of them."""
    left, basis, picked = rows.copy(), np.zeros((0, rows.shape[1])), []
    while len(picked) < _LARGEST_RANK:
        sizes = np.einsum("cf,cf->c", left, left)
        if not sizes.size or np.sqrt(sizes.max()) < _EXACT:
            break
        picked.append(int(np.argmax(sizes)))
        # Once more, for rounding has left something along the others.
        following = left[picked[-1]] - basis.T @ (basis @ left[picked[-1]])
        following /= np.linalg.norm(following)
        basis = np.concatenate([basis, following[None]])
        left -= np.outer(left @ following, following)
    return np.array(picked, int), basis
