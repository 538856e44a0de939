r"""What a model leaves out, as a random function of the drive's state.

A model that is not right leaves more than noise, and intervals from noise alone are then too
narrow, however long the recording: a mismatch that repeats in every cycle does not average out.
Hence

    y = y(θ) + δ(u, u̇, t) + e,     δ ~ τ · GP(0, exp(-|x - x'|²/2)),     x = (u/l, u̇/l, t/l_t)

u and u̇ in standard deviations: the same state meets the same mismatch (Kennedy & O'Hagan, J. R.
Stat. Soc. B 63 (2001) 425).  The lengths are those of largest evidence for what the fit left, out
of a few; the size τ is sampled.  δ is a sum of a few columns with normal coefficients, by a pivoted
Cholesky factor of the kernel, and integrated out with the gains.

Data cannot tell the part of δ that moving parameters could produce from parameters moved (Plumlee,
J. Am. Stat. Assoc. 112 (2017) 1274).  With J the Jacobian at the fit, δ is split into J c and what
is orthogonal to J and to the recordings' own terms, by the noise's inner product, and both are
taken as independent: the part beside J, which data do show, tells τ and to first order moves no
parameter; that along J only widens intervals, by what a mismatch of that size could have done.
It is as good as its prior: a mismatch far smoother, or larger along J, than what the residual shows
beside it is not covered (Brynjarsdóttir & O'Hagan, Inverse Problems 30 (2014) 114007).
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

_STATE_LENGTHS = 0.3, 1.0, 3.0
_TIME_LENGTHS = 0.3, np.inf
_COLUMNS = 24
_RATE_WINDOW = 9
_LEAST = 1e-6
_DEPENDENT = 1e-9
_DECADES = 100.0
# Recordings are this many lengths of themselves apart in time.
_APART = 10.0


class Discrepancy(NamedTuple):
    """Columns (L, K) of each recording, whose coefficients are common to all and normal of standard
    deviation τ [response]; τ as a `term`."""

    columns: tuple[np.ndarray, ...]
    term: Term


class _Seen(NamedTuple):
    """What the choice of lengths looks at, all recordings stacked: features (ΣL, 3), Jacobian (ΣL,
    d + own) as it is and whitened, and the whitened residual (ΣL,)."""

    features: np.ndarray
    used: np.ndarray
    raw: np.ndarray
    white: np.ndarray
    residual: np.ndarray


def discrepancy_of(fit: Fit) -> Discrepancy:
    """The discrepancy that what a fit left speaks for."""
    problems = fit.preparation.problems()
    raw, white = jacobian(fit.model.block, problems)
    takes = fit.preparation.takes
    lengths = [np.asarray(p.response).size for p in problems]
    padded = [np.pad(r, (0, n - r.size)) for r, n in zip(fit.residuals, lengths, strict=True)]
    seen = _Seen(
        np.concatenate([_state(t.recording.drive, n, at) for at, (t, n) in
                        enumerate(zip(takes, lengths, strict=True))]),
        np.concatenate([np.asarray(p.weights) > 0 for p in problems]),
        raw,
        white,
        np.concatenate([p.whiten(r) for p, r in zip(problems, padded, strict=True)]),
    )  # fmt: skip
    ends = np.cumsum(lengths)[:-1]

    def whiten(columns: np.ndarray) -> np.ndarray:
        pieces = zip(problems, np.split(columns, ends), strict=True)
        return np.concatenate([p.whiten(piece) for p, piece in pieces])

    best, found, size = -np.inf, np.zeros((0, 0)), 1.0
    for state, time in product(_STATE_LENGTHS, _TIME_LENGTHS):
        basis = _factor(seen.features / [state, state, time], seen.used)
        columns, evidence, tau = _split(
            basis, whiten(basis), seen, len(layout_of(fit.model.block).labels)
        )
        if evidence > best:
            best, found, size = evidence, columns, tau
    unit = takes[0].recording.response_unit
    term = Term("discrepancy.size", unit, within_a_factor(size, _DECADES), size)
    return Discrepancy(tuple(np.split(found, ends)), term)


def _state(drive: np.ndarray, length: int, at: int) -> np.ndarray:
    """Drive, its rate and time (length, 3), each of the size of one; rows beyond the drive are
    nothing that counts."""
    rate = np.asarray(savgol_filter(drive, _RATE_WINDOW, 2, deriv=1))
    time = np.arange(drive.size) / drive.size + _APART * at
    state = np.stack([drive / drive.std(), rate / rate.std(), time], axis=1)
    return np.pad(state, ((0, length - drive.size), (0, 0)))


def _factor(points: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Columns B (n, K) with B Bᵀ all but the kernel at points (n, 3), by pivoted Cholesky."""
    left, columns = used.astype(float), np.zeros((len(points), _COLUMNS))
    for k in range(_COLUMNS):
        pivot = int(np.argmax(left))
        if left[pivot] < _LEAST:
            break
        distances = np.sum((points - points[pivot]) ** 2, axis=1)
        column = np.exp(-distances / 2) - columns @ columns[pivot]
        columns[:, k] = used * column / np.sqrt(left[pivot])
        left = np.maximum(left - columns[:, k] ** 2, 0.0)
    return columns


def _split(
    basis: np.ndarray, white: np.ndarray, seen: _Seen, count: int
) -> tuple[np.ndarray, float, float]:
    """Columns beside the Jacobian and along its first `count`, the logarithm of their evidence, and
    the τ of which it is the largest."""
    lengths = np.linalg.norm(seen.white, axis=0) + 1e-300
    along = np.linalg.lstsq(seen.white / lengths, white, rcond=_DEPENDENT)[0] / lengths[:, None]
    left, sizes, right = np.linalg.svd(white - seen.white @ along, full_matrices=False)
    shown = sizes > _LEAST * np.linalg.norm(white)
    # Turned so that they are orthogonal to each other too.
    beside = ((basis - seen.raw @ along) @ right.T)[:, shown]
    turned, spread, _ = np.linalg.svd(along[:count] * lengths[:count, None], full_matrices=False)
    within = (seen.raw[:, :count] / lengths[:count]) @ (turned * spread)
    held, sizes = left[:, shown].T @ seen.residual, sizes[shown]
    samples = seen.used.sum()
    rest = seen.residual @ seen.residual - held @ held
    noise = max(1.0, rest / samples)
    taus = np.geomspace(1e-3, 1e3, 121) * np.sqrt(samples * noise) / np.linalg.norm(white)
    variances = noise + np.square(taus[:, None] * sizes)
    heights = -np.sum(held**2 / variances + np.log(variances / noise), axis=1) / 2
    evidence = heights.max() - (samples * np.log(noise) + rest / noise) / 2
    return np.concatenate([beside, within], axis=1), evidence, float(taus[np.argmax(heights)])
