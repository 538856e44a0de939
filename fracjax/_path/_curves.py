r"""Free curves of the drive, one for each branch of the path: cubic splines with a prior.

On branch b the response is x = Σ_j c_bj B_j(u), with cubic B-splines B_j on knots that all branches
share.  The coefficients are normal about 0: their second differences have the standard deviation
`roughness` and they themselves that of the response's range, so that the prior is proper and its
evidence can be compared with that of a law.

Source: Eilers & Marx, Stat. Sci. 11 (1996) 89 (penalised B-splines); de Boor, A Practical Guide to
Splines (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from ._memory import branches_of

KNOTS = 100
"""Intervals between knots over the drive's span: minor loops of twice `SAME` still have a curve."""


class Curves(NamedTuple):
    """The basis of the curves of all branches.

    Attributes:
        basis: sparse (N, M), the value of each spline at each sample, dimensionless.
        slope: sparse (N, M), its derivative by the drive [1/drive unit].
        bends: sparse (P, M), the second differences of coefficients on one branch.
        branches: how many branches there are.
        met_again: the share of samples on branches that are met more than once.
        at: for other values (N,) of the drive, on each sample's branch, the basis (N, M); beyond
            what a branch has met its end is taken.
    """

    basis: sp.csr_array
    slope: sp.csr_array
    bends: sp.csr_array
    branches: int
    met_again: float
    at: Callable[[np.ndarray], sp.csr_array]


def curves_of(drives: Sequence[np.ndarray], error: float = 0.0) -> Curves:
    """The curves of recordings of one actuator.

    Args:
        drives: one (N,) per recording, in the drive's unit.
        error: the rms error of the drives, in their unit.

    Returns:
        The basis, a row for each sample of all recordings.
    """
    branch, branches = branches_of(drives, error)
    visits = np.zeros(branches)
    for own in branch:
        np.add.at(visits, own[np.concatenate([[True], own[1:] != own[:-1]])], 1)
    drive, branch = np.concatenate(drives), np.concatenate(branch)
    met_again = float(np.mean(visits[branch] > 1))
    low, width = drive.min(), (drive.max() - drive.min()) / KNOTS
    knot = np.minimum(((drive - low) / width).astype(int), KNOTS - 1)
    # A branch has all splines between the first and the last that it meets.
    first, last = np.full(branches, KNOTS + 3), np.full(branches, -1)
    np.minimum.at(first, branch, knot)
    np.maximum.at(last, branch, knot + 3)
    sizes = np.maximum(last - first + 1, 0)
    starts = np.concatenate([[0], np.cumsum(sizes)])
    rows = np.repeat(np.arange(drive.size), 4)
    shape = (drive.size, int(starts[-1]))

    def splines(values: np.ndarray, *, slopes: bool = False) -> sp.csr_array:
        place = (values - low) / width
        ends = first[branch].astype(float), last[branch] - 2.0
        place = np.clip(place, ends[0], np.maximum(ends[1] - 1e-9, ends[0]))
        own = np.clip(place.astype(int), first[branch], last[branch] - 3)
        x = place - own
        parts = (
            [-3 * (1 - x) ** 2, 9 * x**2 - 12 * x, -9 * x**2 + 6 * x + 3, 3 * x**2]
            if slopes
            else [(1 - x) ** 3, 3 * x**3 - 6 * x**2 + 4, -3 * x**3 + 3 * x**2 + 3 * x + 1, x**3]
        )
        column = (starts[branch] + own - first[branch])[:, None] + np.arange(4)
        weights = np.stack(parts, axis=1).ravel() / (6 * width if slopes else 6)
        return sp.csr_array((weights, (rows, column.ravel())), shape=shape)

    inner = np.concatenate([np.arange(s, s + n - 2) for s, n in zip(starts, sizes, strict=False)])
    count = np.arange(inner.size)
    bends = sp.csr_array(
        (
            np.tile([1.0, -2.0, 1.0], inner.size),
            (np.repeat(count, 3), (inner[:, None] + np.arange(3)).ravel()),
        ),
        shape=(inner.size, shape[1]),
    )
    return Curves(splines(drive), splines(drive, slopes=True), bends, branches, met_again, splines)
