"""Resonances that may ring in a residual: a lightly damped one is only visible near its frequency.

Frequencies are scanned as densely as their dampings need, and those that explain most of the fit's
residual become columns.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import find_peaks, lfilter

from .._blocks import EFFECTS, Resonance
from ._columns import Group
from ._fitted import Fitted

# Chosen by judgement.
_DAMPINGS = (0.01, 0.03, 0.1)
"""Damping ratios ζ that are tried, at frequencies that are half the width of a peak apart, ζ f."""
_LOWEST, _HIGHEST = 10.0, 0.9
"""The lowest frequency [Hz], and the highest over Nyquist's."""
_MOST = 8
"""Peaks of a scan that become columns, of each damping."""
_SHAPES = (0.0, 0.03)
"""Sizes of loop shapes, over the response's span, beside which the scan is made."""


def modes_of(fitted: Fitted, shapes: np.ndarray) -> list[Group]:
    """The groups of resonances that explain most of a fit's residual beside loop shapes (ΣL, S)."""
    step, problems = fitted.preparation.setting.step, fitted.problems
    highest = _HIGHEST * 0.5 / step
    if highest <= _LOWEST:
        return []
    pairs = zip(fitted.solved.blocks, problems, strict=True)
    responses = [b.respond(np.asarray(p.drive), p.grid)[:: p.oversampling] for b, p in pairs]
    residual, free = fitted.whitened(fitted.error), fitted.whitened(fitted.free_directions)
    white = fitted.whitened(shapes)
    others = [np.concatenate([free, tau * white], axis=1) if tau else free for tau in _SHAPES]
    normals = [np.eye(beside.shape[1]) + beside.T @ beside for beside in others]
    groups = []
    for damping in _DAMPINGS:
        count = 1 + int(np.log(highest / _LOWEST) / damping)
        frequencies = np.geomspace(_LOWEST, highest, count)
        columns = np.stack([_rung(responses, f * step, damping) for f in frequencies], axis=1)
        own, chosen = fitted.whitened(columns), set()
        for beside, normal in zip(others, normals, strict=True):
            falls = _falls(own, residual, beside, normal)
            peaks = find_peaks(np.pad(falls, 1))[0] - 1
            chosen |= set(peaks[np.argsort(-falls[peaks])[:_MOST]].tolist())
        groups += [
            Group(
                EFFECTS["resonance"], (Resonance(float(frequencies[k]), damping),), columns[:, [k]]
            )
            for k in sorted(chosen)
        ]
    return groups


def _falls(
    columns: np.ndarray, residual: np.ndarray, beside: np.ndarray, normal: np.ndarray
) -> np.ndarray:
    """The reduction of the square of a residual (L,) by each column (L, K) alone, beside others
    (L, S) of unit prior sd, whose normal matrix is (S, S); all are whitened."""
    across, toward = beside.T @ columns, beside.T @ residual
    kept = np.linalg.solve(normal, across)
    along = columns.T @ residual - kept.T @ toward
    squares = np.sum(columns**2, axis=0) - np.sum(across * kept, axis=0)
    return along**2 / np.maximum(squares, 1e-300)


def _rung(responses: Sequence[np.ndarray], frequency: float, damping: float) -> np.ndarray:
    """The change (ΣL,) of responses by a resonance at a frequency [1/sample]."""
    return np.concatenate([_resonated(y, frequency, damping) - y for y in responses])


def _resonated(signal: np.ndarray, frequency: float, damping: float) -> np.ndarray:
    """A signal (N,) through a resonance at a frequency [1/sample], by the prewarped bilinear
    transform."""
    w = 2 * np.pi * frequency
    k = w / np.tan(w / 2)
    first = k * k + 2 * damping * w * k + w * w
    squares = w * w / first
    poles = [1.0, (2 * w * w - 2 * k * k) / first, (k * k - 2 * damping * w * k + w * w) / first]
    moved = signal - signal[0]
    return np.asarray(lfilter(squares * np.array([1.0, 2.0, 1.0]), poles, moved)) + signal[0]
