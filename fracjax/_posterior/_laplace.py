"""Laplace's approximation: a normal density at the posterior's mode, with its curvature.

    p(v | data) ≈ N(v*, H⁻¹),     H = -∂² ln p(v | data) / ∂v²  at  v*

Source: MacKay, Information Theory, Inference, and Learning Algorithms (2003), ch. 27.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._computing import compiled
from ._likelihood import Density, log_posteriors_of

_ROUNDS = 60
"""Most Newton steps; chosen by judgement."""
_LENGTHS = np.array([0.0, *2.0 ** -np.arange(15)])
"""Step lengths that are compared: sixteen, the batch size of the chain's compiled program."""
_CONVERGED, _ACCEPTABLE = 1e-9, 1e-3
"""Squared Newton decrement at which the search ends, and below which the result counts as
converged; chosen by judgement."""


@dataclass(frozen=True)
class Laplace:
    """A normal density in standard coordinates.

    `mode` (D,) is its centre; `factor` (D, D) satisfies factor factorᵀ = H⁻¹; `converged` says
    whether the mode was reached.
    """

    mode: np.ndarray
    factor: np.ndarray
    converged: bool

    def at(self, coordinates: np.ndarray) -> np.ndarray:
        """Standard coordinates (K, D) of points (K, D) that are standard normal here."""
        return self.mode + coordinates @ self.factor.T


@compiled
def _derivatives(target: Density, standard: Array) -> tuple[Array, Array]:
    """Gradient (D,) and Hessian (D, D), both in forward mode, which compiles faster."""

    def gradient(point: Array) -> tuple[Array, Array]:
        slope = jax.jacfwd(target.log_posterior)(point)
        return slope, slope

    hessian, slope = jax.jacfwd(gradient, has_aux=True)(standard)
    return slope, hessian


def _newton(target: Density, mode: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factor (D, D) of H⁻¹, gradient (D,) and Newton step (D,) at a point (D,)."""
    gradient, hessian = (np.asarray(d) for d in _derivatives(target, jnp.asarray(mode)))
    curvatures, axes = np.linalg.eigh(-(hessian + hessian.T) / 2)
    # Where the log density is convex, the step is as long as if it were concave.
    step = axes @ (axes.T @ gradient / np.maximum(np.abs(curvatures), 1.0))
    return axes / np.sqrt(np.maximum(curvatures, 1.0)), gradient, step


def laplace(target: Density, start: np.ndarray) -> Laplace:
    """Newton's method from `start` (D,), with the best of fifteen lengths for each step.

    No direction is wider than its prior: where the likelihood is flat or convex, the prior decides.
    """
    mode, log_posteriors = np.asarray(start, float), log_posteriors_of(target)
    for _ in range(_ROUNDS):
        factor, gradient, step = _newton(target, mode)
        candidates = mode + _LENGTHS[:, None] * step
        values = log_posteriors(candidates)
        best = int(np.argmax(values))
        if step @ gradient < _CONVERGED or best == 0:
            break
        mode = candidates[best]
    factor, gradient, step = _newton(target, mode)
    # The triangular factor is the one that does not depend on the rounding of eigenvectors.
    _, triangle = np.linalg.qr(factor.T)
    triangle *= np.sign(np.diag(triangle))[:, None]
    return Laplace(mode, triangle.T, bool(step @ gradient < _ACCEPTABLE))
