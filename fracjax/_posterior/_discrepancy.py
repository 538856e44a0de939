"""The discrepancy between model and actuator, as a random function of the drive's state.

A wrong model leaves a residual that is more than noise.  Intervals from noise alone are then too
narrow, however long the recording, because a mismatch that repeats in every cycle does not average
out.  Hence

    y = y(θ) + δ(u, u̇, t) + e,     δ ~ τ · GP(0, exp(-|x - x'|²/2)),     x = (u/l, u̇/l, t/l_t)

with u and u̇ in standard deviations: the same state has the same mismatch (Kennedy & O'Hagan, J. R.
Stat. Soc. B 63 (2001) 425).  The lengths l and l_t, out of a few values, are those with the largest
evidence for the residual of the fit; the size τ is sampled.  δ is a sum of a few columns with
normal coefficients, by a pivoted Cholesky factor of the kernel, and is integrated out with the
gains.

Data cannot distinguish the part of δ that a change of the parameters could produce from such a
change (Plumlee, J. Am. Stat. Assoc. 112 (2017) 1274).  With J the Jacobian at the fit, δ is split
into J c and a part orthogonal to J and to the recordings' own terms, in the noise's inner product,
and the two are taken as independent.  The orthogonal part is visible in the data: it determines τ
and to first order changes no parameter.  The part along J only widens the intervals, by what a
mismatch of that size could have changed.  This is only as good as its prior: a mismatch that is far
smoother, or larger along J, than the orthogonal part in the residual is not covered
(Brynjarsdóttir & O'Hagan, Inverse Problems 30 (2014) 114007).
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.signal import savgol_filter

from .._fit import Fit
from .._prepare import layout_of
from .._solve import jacobian
from ._noise_models import Term
from ._prior import within_a_factor

# The sizes below were chosen by judgement.
_STATE_LENGTHS = 0.3, 1.0, 3.0
"""Length scales l of drive and rate that are compared, in their standard deviations."""
_TIME_LENGTHS = 0.3, np.inf
"""Length scales l_t of time that are compared, in durations of the recording."""
_COLUMNS = 24
"""Most columns of the Cholesky factor."""
_RATE_WINDOW = 9
"""Samples of the Savitzky–Golay filter that differentiates the drive."""
_NEGLIGIBLE = 1e-6
"""Remaining variance at which the factor ends, and relative size of columns that are omitted."""
_DEPENDENT = 1e-9
"""Relative singular value below which columns of the Jacobian are linearly dependent."""
_SIZE_FACTOR = 100.0
"""Factor within which τ lies around its estimate with 95 % prior probability."""
_RECORDING_SPACING = 10.0
"""Distance in time between recordings, in their durations, so that they are independent in t."""


class Discrepancy(NamedTuple):
    """The columns of a discrepancy, and its size τ [response] as a sampled parameter `term`.

    `columns` holds (L, K) for each recording.  Their coefficients are common to all recordings and
    normal with standard deviation τ.
    """

    columns: tuple[np.ndarray, ...]
    term: Term


class _FitData(NamedTuple):
    """What the lengths are chosen from, all recordings stacked.

    `features` (ΣL, 3) are the drive's states, `used` (ΣL,) the samples that count, `raw` and
    `white` (ΣL, d + own) the Jacobian before and after whitening, `residual` (ΣL,) the whitened
    residual.
    """

    features: np.ndarray
    used: np.ndarray
    raw: np.ndarray
    white: np.ndarray
    residual: np.ndarray


def discrepancy_of(fit: Fit) -> Discrepancy:
    """The discrepancy with the largest evidence for the residual of a fit."""
    problems = fit.preparation.problems()
    raw, white = jacobian(fit.model.block, problems)
    takes = fit.preparation.takes
    lengths = [np.asarray(p.response).size for p in problems]
    padded = [np.pad(r, (0, n - r.size)) for r, n in zip(fit.residuals, lengths, strict=True)]
    data = _FitData(
        np.concatenate([_state(t.recording.drive, n, at) for at, (t, n) in
                        enumerate(zip(takes, lengths, strict=True))]),
        np.concatenate([np.asarray(p.weights) > 0 for p in problems]),
        raw,
        white,
        np.concatenate([p.whiten(r) for p, r in zip(problems, padded, strict=True)]),
    )  # fmt: skip
    ends = np.cumsum(lengths)[:-1]

    def whiten(columns: np.ndarray) -> np.ndarray:
        """Columns (ΣL, K) whitened recording by recording."""
        pieces = zip(problems, np.split(columns, ends), strict=True)
        return np.concatenate([p.whiten(piece) for p, piece in pieces])

    block = fit.model.block
    free = len(layout_of(block).labels(block))
    best_evidence, best_columns, best_size = -np.inf, np.zeros((0, 0)), 1.0
    for state, time in product(_STATE_LENGTHS, _TIME_LENGTHS):
        kernel_columns = _kernel_factor(data.features / [state, state, time], data.used)
        columns, evidence, tau = _split_by_jacobian(
            kernel_columns, whiten(kernel_columns), data, free
        )
        if evidence > best_evidence:
            best_evidence, best_columns, best_size = evidence, columns, tau
    unit = takes[0].recording.response_unit
    term = Term("discrepancy.size", unit, within_a_factor(best_size, _SIZE_FACTOR), best_size)
    return Discrepancy(tuple(np.split(best_columns, ends)), term)


def _state(drive: np.ndarray, length: int, at: int) -> np.ndarray:
    """Drive, its rate and time (length, 3), each scaled to a size of about 1.

    Rows beyond the drive's end are zero and do not count.
    """
    rate = np.asarray(savgol_filter(drive, _RATE_WINDOW, 2, deriv=1))
    time = np.arange(drive.size) / drive.size + _RECORDING_SPACING * at
    state = np.stack([drive / drive.std(), rate / rate.std(), time], axis=1)
    return np.pad(state, ((0, length - drive.size), (0, 0)))


def _kernel_factor(points: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Columns B (n, K) with B Bᵀ close to the kernel at points (n, 3), by pivoted Cholesky."""
    remaining, columns = used.astype(float), np.zeros((len(points), _COLUMNS))
    for k in range(_COLUMNS):
        pivot = int(np.argmax(remaining))
        if remaining[pivot] < _NEGLIGIBLE:
            break
        distances = np.sum((points - points[pivot]) ** 2, axis=1)
        column = np.exp(-distances / 2) - columns @ columns[pivot]
        columns[:, k] = used * column / np.sqrt(remaining[pivot])
        remaining = np.maximum(remaining - columns[:, k] ** 2, 0.0)
    return columns


def _split_by_jacobian(
    basis: np.ndarray, white: np.ndarray, data: _FitData, count: int
) -> tuple[np.ndarray, float, float]:
    """Columns (ΣL, K') orthogonal to and along the Jacobian, their log evidence, and the best τ.

    The latter are along its first `count` columns only.  `basis` and `white` (ΣL, K) are the
    columns before and after whitening.
    """
    lengths = np.linalg.norm(data.white, axis=0) + 1e-300
    coefficients = (
        np.linalg.lstsq(data.white / lengths, white, rcond=_DEPENDENT)[0] / lengths[:, None]
    )
    left_vectors, sizes, right_vectors = np.linalg.svd(
        white - data.white @ coefficients, full_matrices=False
    )
    resolved = sizes > _NEGLIGIBLE * np.linalg.norm(white)
    # Rotated so that they are orthogonal to each other as well.
    orthogonal = ((basis - data.raw @ coefficients) @ right_vectors.T)[:, resolved]
    rotation, spread, _ = np.linalg.svd(
        coefficients[:count] * lengths[:count, None], full_matrices=False
    )
    along_jacobian = (data.raw[:, :count] / lengths[:count]) @ (rotation * spread)
    projections, sizes = left_vectors[:, resolved].T @ data.residual, sizes[resolved]
    samples = data.used.sum()
    remainder = data.residual @ data.residual - projections @ projections
    noise = max(1.0, remainder / samples)
    # 20 sizes per decade, three decades around the size that the residual suggests; by judgement.
    taus = np.geomspace(1e-3, 1e3, 121) * np.sqrt(samples * noise) / np.linalg.norm(white)
    variances = noise + np.square(taus[:, None] * sizes)
    log_likelihoods = -np.sum(projections**2 / variances + np.log(variances / noise), axis=1) / 2
    evidence = log_likelihoods.max() - (samples * np.log(noise) + remainder / noise) / 2
    return (
        np.concatenate([orthogonal, along_jacobian], axis=1),
        evidence,
        float(taus[np.argmax(log_likelihoods)]),
    )
