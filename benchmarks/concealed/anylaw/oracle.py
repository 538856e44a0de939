"""What a recording shows of an effect to one who knows no law of hysteresis.

    detectability² = min over f |W (d - f)|²

d is what the effect changes, f any smooth function of the path state: on each branch linear
between nodes (NODES of the drive's span apart, nearer behind a turning point), and one value where
branches meet.  To one who does not know either how the memory fades, f has columns of fading memory
too, and of loops that change with the path travelled.  W whitens the noise, and weighs samples down
by what straight lines between the recorded voltages may be wrong by, |u''|/8 times the gain: the
drive within an edge is not known.  The columns of memory have a prior, without which a column that
paths nearly take up could pass for anything, many strokes large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import lfilter
from scipy.sparse import csc_matrix, csr_matrix, diags, hstack, vstack
from scipy.sparse.linalg import splu

from ..drives import Array
from ..inexact.laws.recursion import linear
from ..inexact.noises import Noise
from ..truth import play
from .paths import Key, States, states

NODES = 0.0125
NEAR = (0.0, 0.002, 0.006, 0.014)  # of the span, nodes behind a turning point
JOINED, SMOOTH = 1e3, 1e-3  # noise floors: how firmly branches meet, and are straight unseen
STROKES = 0.3  # of memory's columns: how large they may well be, a priori
LENGTHS = np.geomspace(0.1, 12.8, 8)  # half spans over which memory fades
POWERS = 4


def nodes_of(reach: float) -> Array:
    """Distances of a branch's nodes from its turning point, in spans."""
    many = max(int(np.ceil(reach / NODES)), 1)
    inner = np.linspace(0, max(reach, 1e-4), many + 1)
    near = np.array([x for x in NEAR if x < 0.6 * inner[1]])
    return np.union1d(near, inner) if reach > NODES else inner


def hats(x: Array, nodes: Array) -> tuple[np.ndarray, Array]:
    """Node before each x, and how far x is on the way to the next."""
    k = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, len(nodes) - 2)
    return k, (x - nodes[k]) / (nodes[k + 1] - nodes[k])


def path_columns(u: Array, met: States) -> tuple[csr_matrix, csr_matrix, csr_matrix]:
    """Columns of functions of the path state: at the samples, where branches meet, and curvatures.

    Args:
        u: Drive of all recordings in V, one after the other.
        met: Their path states.
    """
    width, first = float(np.ptp(u)), 0
    joints = sorted(met.joints, key=str)
    joined: dict[Key, list[float]] = {key: [] for key in met.branches}
    for *pair, drive in joints:
        for key in pair:
            joined[key].append(drive)
    place: dict[Key, tuple[int, float, Array]] = {}
    values, bends = [], []

    def entries(row: Array, key: Key, drive: Array, sign: float = 1.0) -> list[Array]:
        """Rows, columns and values of a branch's function at some drives."""
        begin, start, nodes = place[key]
        k, part = hats(np.abs(drive - start) / width, nodes)
        return [np.tile(row, 2), begin + np.append(k, k + 1), sign * np.append(1 - part, part)]

    for key, samples in met.branches.items():
        at, way = np.concatenate(samples), float(key[0])
        ends = np.append(u[at], joined[key])
        start = way * float((way * ends).min())
        nodes = nodes_of(float(np.abs(ends - start).max()) / width)
        place[key] = (first, start, nodes)
        values.append(entries(at, key, u[at]))
        bends += range(first, first + len(nodes) - 2)
        first += len(nodes)
    meet = [
        entries(np.array([row]), key, np.array([drive]), sign)
        for row, (one, other, drive) in enumerate(joints)
        for key, sign in ((one, 1.0), (other, -1.0))
    ]
    at = np.array(bends, int)
    curved = [
        [np.arange(len(at)), at + step, np.full(len(at), value)]
        for step, value in ((0, 1.0), (1, -2.0), (2, 1.0))
    ]
    sizes = (len(u), len(joints), len(at))
    parts = zip((values, meet, curved), sizes, strict=True)
    columns, together, bent = (_sparse(part, (size, first)) for part, size in parts)
    return columns, together, bent


def _sparse(entries: Sequence[Sequence[Array]], shape: tuple[int, int]) -> csr_matrix:
    """From (rows, columns, values), however many."""
    if not entries:
        return csr_matrix(shape)
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return csr_matrix((values, (rows, columns)), shape)


def fading_columns(u: Array, keep: int) -> Array:
    """Memory that fades along the path, linear in curves of the drive, at every `keep`th sample.

        c' = g(x) x' - c |x'|/length,  and the same fed by g(x) |x'|

    with g the Chebyshev polynomials of the drive x in -1..1.
    """
    x = 2 * (u - u.min()) / np.ptp(u) - 1
    dx = np.diff(x)
    curves = np.polynomial.chebyshev.chebvander(x, POWERS)
    middle = 0.5 * (curves[1:] + curves[:-1])
    moved = middle[:, :POWERS].T
    fed = np.vstack([moved * dx, moved * np.abs(dx)])
    out = []
    for length in LENGTHS:
        spent = np.abs(dx) / length
        keeps = np.broadcast_to(np.exp(-spent), fed.shape)
        share = np.where(spent > 1e-8, -np.expm1(-spent) / np.maximum(spent, 1e-8), 1.0)
        out.append(linear(keeps, share * fed, np.zeros(len(fed))))
    return np.vstack([np.zeros((1, POWERS * 2 * len(LENGTHS))), np.vstack(out).T])[::keep]


def travelled_columns(u: Array, keep: int) -> Array:
    """Curves and plays that change with the path travelled, at every `keep`th sample."""
    x = 2 * (u - u.min()) / np.ptp(u) - 1
    s = np.append(0.0, np.cumsum(np.abs(np.diff(x))))
    s = s / s[-1]
    loops = [np.zeros_like(x) + x]
    for r in (0.05, 0.12, 0.25, 0.45, 0.7):
        loops.append(play(x, r) - x)
    curves = np.array([*np.polynomial.chebyshev.chebvander(x, 4)[:, 1:].T, *loops[1:]])
    ages = (s, -np.expm1(-s / 0.2))
    return np.column_stack([c * a for c in curves for a in ages])[::keep]


def weights(u: Array, gain: float, noise: float) -> Array:
    """Weight of each sample, 1 where the drive between samples is known.

    Args:
        u: Drive at the samples of one recording, in V.
        gain: Stroke over span, in um/V.
        noise: Standard deviation of the noise in um.
    """
    bend = np.abs(np.diff(u, 2)) / 8
    bend = np.concatenate([bend[:1], bend, bend[-1:]])
    near = np.maximum(bend, np.maximum(np.append(bend[1:], 0), np.append(0, bend[:-1])))
    return 1 / np.sqrt(1 + (gain * near / noise) ** 2)


class LawFree:
    """Projection off all that hysteresis could be, for changes at the samples of all recordings.

    Args:
        drives: Each recording's drive in V on its fine grid.
        keep: Fine steps to a sample.
        noise: The noise of the response.
        gain: Stroke over span, in um/V.
        dense: Further columns at the samples, in um, as large as they may well be.
    """

    def __init__(self, drives: Sequence[Array], keep: int, noise: Noise, gain: float,
                 dense: Array | None) -> None:  # fmt: skip
        self.lengths = [len(u[::keep]) for u in drives]
        self.noise = noise
        self.weights = np.concatenate([weights(u[::keep], gain, noise.total) for u in drives])
        met = states(drives)
        sampled = np.concatenate([np.arange(len(u)) % keep == 0 for u in drives])
        number = np.cumsum(sampled) - 1
        for key, samples in met.branches.items():
            at = np.concatenate(samples)
            met.branches[key] = [number[at[sampled[at]]]]
        u = np.concatenate(drives)[sampled]
        columns, joints, curved = path_columns(u, met)
        offsets = csr_matrix(np.repeat(np.eye(len(drives)), self.lengths, axis=0)[:, 1:])
        blank = csr_matrix((joints.shape[0] + curved.shape[0], offsets.shape[1]))
        firm = vstack([JOINED * joints, SMOOTH * curved]).tocsr()
        self.columns = hstack([columns, offsets]).tocsr()
        self._white = self._whiten_sparse(self.columns)
        full = vstack([self._white, hstack([firm, blank])]).tocsc()
        normal = (full.T @ full).tocsc() + 1e-10 * diags(np.ones(full.shape[1]))
        self._solve = splu(csc_matrix(normal))
        self.basis, self.taken = np.zeros((sum(self.lengths), 0)), np.zeros(0)
        if dense is not None:
            beside = self._off_paths(self.whiten(dense))
            self.basis, size, _ = np.linalg.svd(beside, full_matrices=False)
            self.taken = 1 - 1 / np.sqrt(1 + size**2)

    def whiten(self, x: Array) -> Array:
        """Weighted changes in um, along the first axis, in units in which the noise is white."""
        ends = np.cumsum(self.lengths)[:-1]
        white = np.concatenate([self.noise.whiten(part) for part in np.split(x, ends)])
        return white * self.weights[:, None]

    def _whiten_sparse(self, x: csr_matrix) -> csr_matrix:
        """The same for sparse columns; noise of order one or none."""
        noise = self.noise
        weighted = diags(self.weights)
        if noise.colour != "ar":
            return (weighted @ x).tocsr() / noise.total
        starts = np.cumsum([0, *self.lengths[:-1]])
        before = np.ones(x.shape[0] - 1)
        before[starts[1:] - 1] = 0
        step = diags([np.ones(x.shape[0]), -noise.order * before], [0, -1])
        return (weighted @ step @ x).tocsr() / (noise.sd * np.sqrt(1 - noise.order**2))

    def _off_paths(self, x: Array) -> Array:
        return x - self._white @ self._solve.solve(np.asarray(self._white.T @ x))

    def residual(self, x: Array) -> Array:
        """What is left of one change, in um, weighed."""
        white, noise = self.off(x[:, None])[:, 0], self.noise
        if noise.colour != "ar":
            return white * noise.total
        gain, ends = noise.sd * np.sqrt(1 - noise.order**2), np.cumsum(self.lengths)[:-1]
        parts = [lfilter([gain], [1, -noise.order], part) for part in np.split(white, ends)]
        return np.concatenate(parts)

    def off(self, x: Array) -> Array:
        """What is left of changes in um, in units in which the noise is white."""
        beyond = self._off_paths(self.whiten(x))
        return beyond - self.basis @ (self.taken[:, None] * (self.basis.T @ beyond))
