r"""Laplace's approximation: a normal density at the posterior's mode, of its curvature.

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
# With the point itself sixteen, the rows that the chain's compiled program takes.
_LENGTHS = np.array([0.0, *2.0 ** -np.arange(15)])
_EXACT, _ENOUGH = 1e-9, 1e-3


@dataclass(frozen=True)
class Laplace:
    """Mode (D,) and factor (D, D) with factor factorᵀ = H⁻¹, in standard coordinates."""

    mode: np.ndarray
    factor: np.ndarray
    converged: bool

    def at(self, coordinates: np.ndarray) -> np.ndarray:
        """Standard coordinates (K, D) where the approximation is standard normal in (K, D)."""
        return self.mode + coordinates @ self.factor.T


@compiled
def _derivatives(target: Density, standard: Array) -> tuple[Array, Array]:
    """Gradient (D,) and Hessian (D, D), both by tangents: no transposition is to be compiled."""

    def gradient(point: Array) -> tuple[Array, Array]:
        found = jax.jacfwd(target.log_posterior)(point)
        return found, found

    hessian, found = jax.jacfwd(gradient, has_aux=True)(standard)
    return found, hessian


def _newton(target: Density, mode: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Factor (D, D) of H⁻¹, gradient (D,) and Newton's step (D,) at a point."""
    gradient, hessian = (np.asarray(d) for d in _derivatives(target, jnp.asarray(mode)))
    curvatures, axes = np.linalg.eigh(-(hessian + hessian.T) / 2)
    # Where the density curves upwards the step is as long as if it curved downwards.
    step = axes @ (axes.T @ gradient / np.maximum(np.abs(curvatures), 1.0))
    return axes / np.sqrt(np.maximum(curvatures, 1.0)), gradient, step


def laplace(target: Density, start: np.ndarray) -> Laplace:
    """Newton's method from `start` (D,), each step the best of fifteen lengths.

    No direction is taken to be wider than its prior: a likelihood that does not curve, or curves
    the other way, tells nothing there.
    """
    mode, log_posteriors = np.asarray(start, float), log_posteriors_of(target)
    for _ in range(_ROUNDS):
        factor, gradient, step = _newton(target, mode)
        trials = mode + _LENGTHS[:, None] * step
        heights = log_posteriors(trials)
        best = int(np.argmax(heights))
        if step @ gradient < _EXACT or best == 0:
            break
        mode = trials[best]
    factor, gradient, step = _newton(target, mode)
    # Triangular: of all factors the one that does not turn with the rounding of an eigenvector.
    _, triangle = np.linalg.qr(factor.T)
    triangle *= np.sign(np.diag(triangle))[:, None]
    return Laplace(mode, triangle.T, bool(step @ gradient < _ENOUGH))
