"""Elimination of gains and own terms, which enter linearly, by one QR.

    c = argmin ‖y - Φ c‖² + ρ² ‖diag(‖Φ_k‖) c‖²

Source: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import solve_triangular as jax_solve_triangular
from scipy.linalg import solve_triangular

_RIDGE = 1e-9
"""ρ: far below any noise, so that columns that coincide still have a solution."""
_DEPENDENT = 1e-9
"""Singular values below this share of the largest are rounding."""


def eliminate(columns: Any, target: Any, xp: Any = np) -> tuple[Any, Any, Any]:
    """The least-squares coefficients of columns, the residual, and an orthonormal basis of them.

    `columns` are (…, m, g) and `target` is (…, m).  The coefficients are (…, g), the residual (…,
    m) and the basis of the columns (…, m, g).  `xp` is numpy or jax.numpy.
    """
    count = columns.shape[-1]
    lengths = xp.linalg.norm(columns, axis=-2) + 1e-300
    ridge = xp.broadcast_to(_RIDGE * xp.eye(count), (*columns.shape[:-2], count, count))
    scaled = xp.concatenate([columns / lengths[..., None, :], ridge], axis=-2)
    few = xp is np and (columns.ndim > 2 or count == 1)
    q, r = _orthonormal(scaled) if few else xp.linalg.qr(scaled)
    basis = q[..., : target.shape[-1], :]
    along = xp.swapaxes(basis, -1, -2) @ target[..., None]
    coefficients = _solve_triangle(r, along, xp)[..., 0] / lengths
    return coefficients, target - (columns @ coefficients[..., None])[..., 0], basis


def _orthonormal(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The QR of a stack of columns (…, m, g), g small, by Gram and Schmidt's method, twice.

    LAPACK is called once per matrix, which takes ten times as long.

    Source: Giraud, Langou, Rozložník & van den Eshof, Numer. Math. 101 (2005) 87.
    """
    rows = np.ascontiguousarray(np.swapaxes(columns, -1, -2))
    count = rows.shape[-2]
    triangle = np.zeros((*rows.shape[:-2], count, count))
    for k in range(count):
        row = rows[..., k, :]
        for _ in range(2 if k else 0):
            along = (rows[..., :k, :] @ row[..., None])[..., 0]
            row -= (along[..., None, :] @ rows[..., :k, :])[..., 0, :]
            triangle[..., :k, k] += along
        triangle[..., k, k] = np.linalg.norm(row, axis=-1)
        row /= triangle[..., k, k, None]
    return np.swapaxes(rows, -1, -2), triangle


def _solve_triangle(triangle: Any, right: Any, xp: Any) -> Any:
    """The solution x (…, g, 1) of R x = right; NumPy solves a stack of R as general matrices."""
    if xp is jnp:
        return jax_solve_triangular(triangle, right)
    if triangle.ndim > 2:
        return np.linalg.solve(triangle, right)
    return solve_triangular(triangle, right, check_finite=False)


def orthonormal_basis(jacobian: np.ndarray) -> np.ndarray:
    """An orthonormal basis (N, r) of the columns of a Jacobian (N, p): what the fit can absorb."""
    lengths = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian[:, lengths > 0] / lengths[lengths > 0]
    basis, triangle = np.linalg.qr(scaled)
    directions, singular, _ = np.linalg.svd(triangle, full_matrices=False)
    return basis @ directions[:, singular > _DEPENDENT * singular.max(initial=0.0)]
