r"""Gains and own terms, which enter linearly, eliminated by one QR.

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
"""ρ: far below any noise, so that columns which coincide still have a solution."""
_DEPENDENT = 1e-9
"""Of the largest singular value: what is smaller than this share is rounding."""


def eliminated(columns: Any, target: Any, xp: Any = np) -> tuple[Any, Any, Any]:
    """The least-squares coefficients (…, g) of columns (…, m, g) for a target (…, m), what they
    leave (…, m), and an orthonormal basis (…, m, g) of the columns.  `xp`: numpy or jax.numpy."""
    count = columns.shape[-1]
    lengths = xp.linalg.norm(columns, axis=-2) + 1e-300
    ridge = xp.broadcast_to(_RIDGE * xp.eye(count), (*columns.shape[:-2], count, count))
    q, r = xp.linalg.qr(xp.concatenate([columns / lengths[..., None, :], ridge], axis=-2))
    basis = q[..., : target.shape[-1], :]
    along = xp.swapaxes(basis, -1, -2) @ target[..., None]
    coefficients = _solved_triangle(r, along, xp)[..., 0] / lengths
    return coefficients, target - (columns @ coefficients[..., None])[..., 0], basis


def _solved_triangle(triangle: Any, right: Any, xp: Any) -> Any:
    """x (…, g, 1) of R x = right; NumPy solves a stack of triangles as general matrices."""
    if xp is jnp:
        return jax_solve_triangular(triangle, right)
    if triangle.ndim > 2:
        return np.linalg.solve(triangle, right)
    return solve_triangular(triangle, right, check_finite=False)


def orthonormal(jacobian: np.ndarray) -> np.ndarray:
    """An orthonormal basis (N, r) of what the fitted parameters can produce to first order."""
    lengths = np.linalg.norm(jacobian, axis=0)
    scaled = jacobian[:, lengths > 0] / lengths[lengths > 0]
    left, singular, _ = np.linalg.svd(scaled, full_matrices=False)
    return left[:, singular > _DEPENDENT * singular.max(initial=0.0)]
