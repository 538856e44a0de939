"""A base's columns at the recorded samples for many shape parameters, quickly: modes are stored."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .drives import Array
from .truth import BASES, Path

Columns = Callable[[Sequence[float]], list[Array]]
_NODES = 12  # Chebyshev nodes in beta: D^beta u is analytic in beta, the error is under 1e-9


def columns_of(base: str, u: Array, h: float, keep: int) -> Columns:
    """Function of the shapes for one drive on a fine grid; every `keep`th sample is recorded."""
    if base == "coupled":
        return _coupled(u, h, keep)
    path, law = Path(u, h, keep, cache=True), BASES[base].columns
    return lambda shape: law(path, *shape)


def _coupled(u: Array, h: float, keep: int) -> Columns:
    """The third column, D^-mu (|du/dt| D^beta u), interpolates in beta between stored paths."""
    low, high = BASES["coupled"].shapes["beta"]
    angle = (np.arange(_NODES) + 0.5) * np.pi / _NODES
    beta = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    share = (-1.0) ** np.arange(_NODES) * np.sin(angle)
    fine, thin = Path(u, h), Path(u, h, keep, cache=True)
    products = [fine.speed * x for x in fine.derivatives(beta.tolist())]
    paths = [Path(p, h, keep, cache=True) for p in products]

    def columns(shape: Sequence[float]) -> list[Array]:
        alpha, b, mu = shape
        gap = b - beta
        gap[gap == 0] = 1e-300
        w = share / gap / np.sum(share / gap)
        slow = sum(c * p.derivative(-mu) for c, p in zip(w, paths, strict=True))
        return [*thin.derivatives([-mu, alpha - mu]), slow]

    return columns
