"""Recursions over time, in blocks: as many steps in Python as the square root of the samples.

Within a block the map from its first to its last state is composed for all blocks at once; then
the blocks' first states follow one after the other, and at last all states.
"""

from __future__ import annotations

import numpy as np

from ...drives import Array


def linear(keep: Array, enter: Array, start: Array) -> Array:
    """z_k = keep_k · z_(k-1) + enter_k, after each step.

    Args:
        keep: (rows, steps).
        enter: (rows, steps).
        start: (rows,), the states before the first step.

    Returns:
        States of shape (rows, steps).
    """
    steps = keep.shape[1]
    a, b = _blocks(keep, 1.0), _blocks(enter, 0.0)
    whole, fed = np.ones_like(a[0]), np.zeros_like(a[0])
    for x, y in zip(a, b, strict=True):
        fed = x * fed + y
        whole = x * whole
    z, states = start, []
    for block in range(whole.shape[1]):
        states.append(z)
        z = whole[:, block] * z + fed[:, block]
    z, out = np.array(states).T, np.empty_like(a)
    for k in range(len(a)):
        z = a[k] * z + b[k]
        out[k] = z
    return _rows(out, steps)


def clamped(low: Array, high: Array, start: Array) -> Array:
    """p_k = max(low_k, min(high_k, p_(k-1))), after each step; shapes as in `linear`."""
    steps = low.shape[1]
    a, b = _blocks(low, -np.inf), _blocks(high, np.inf)
    least, most = np.full_like(a[0], -np.inf), np.full_like(a[0], np.inf)
    for x, y in zip(a, b, strict=True):
        least, most = np.maximum(x, np.minimum(y, least)), np.maximum(x, np.minimum(y, most))
    p, states = start, []
    for block in range(least.shape[1]):
        states.append(p)
        p = np.maximum(least[:, block], np.minimum(most[:, block], p))
    p, out = np.array(states).T, np.empty_like(a)
    for k in range(len(a)):
        p = np.maximum(a[k], np.minimum(b[k], p))
        out[k] = p
    return _rows(out, steps)


def _blocks(x: Array, blank: float) -> Array:
    """(rows, steps) as (steps of a block, rows, blocks), filled up with `blank`."""
    rows, steps = x.shape
    size = int(np.ceil(np.sqrt(steps)))
    many = -(-steps // size)
    full = np.full((rows, many * size), blank)
    full[:, :steps] = x
    return np.ascontiguousarray(full.reshape(rows, many, size).transpose(2, 0, 1))


def _rows(x: Array, steps: int) -> Array:
    """The inverse of `_blocks`."""
    return x.transpose(1, 2, 0).reshape(x.shape[1], -1)[:, :steps]
