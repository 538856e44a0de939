"""Triangular factors of a few columns, differentiable and without LAPACK where columns are few."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array
from jax.scipy.linalg import solve_triangular


def gram_schmidt(columns: Array, count: int) -> tuple[Array, Array]:
    """The first `count` rows of R (count, n) in the QR of columns (L, n), and the remainder.

    The remainder (L, n - count) of the other columns is orthogonal to the first `count` columns.
    Modified Gram–Schmidt is as accurate as Householder's method for both (Björck, BIT 7 (1967) 1),
    needs no call of LAPACK and is differentiable.
    """
    rows, remainder = [jnp.zeros((0, columns.shape[1]))], columns
    for k in range(count):
        length = jnp.sqrt(remainder[:, 0] @ remainder[:, 0])
        unit = remainder[:, 0] / length
        others = unit @ remainder[:, 1:]
        remainder = remainder[:, 1:] - unit[:, None] * others
        rows.append(jnp.concatenate([jnp.zeros(k), length[None], others])[None])
    return jnp.concatenate(rows), remainder


def triangular_factor(columns: Array, orthogonal: int) -> tuple[Array, Array, Array]:
    """R (g, g) of the first g of columns (L, g + 1), and the projection and remainder of the last.

    The projection (g,) is the orthonormal basis times the last column; of the remainder the squared
    length is returned.  The first `orthogonal` columns are factorised by Cholesky: they are too
    many for Gram–Schmidt, and nearly orthogonal, so they need it less.
    """
    size, rows, remainder = columns.shape[1] - 1, [], columns
    if orthogonal:
        first, remainder = columns[:, :orthogonal], columns[:, orthogonal:]
        factor = jnp.linalg.cholesky(first.T @ first)
        projection = solve_triangular(factor, first.T @ remainder, lower=True)
        remainder = remainder - first @ solve_triangular(factor, projection, lower=True, trans=1)
        rows = [jnp.concatenate([factor.T, projection], axis=1)]
    further, remainder = gram_schmidt(remainder, size - orthogonal)
    triangle = jnp.concatenate([*rows, jnp.pad(further, ((0, 0), (orthogonal, 0)))])
    return triangle[:, :size], triangle[:, size], remainder[:, 0] @ remainder[:, 0]
