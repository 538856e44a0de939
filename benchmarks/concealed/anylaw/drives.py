"""Drives of the third tier: what users play to an actuator, and the protocol made to tell.

Shapes are in samples and half ranges, as those of the second tier, of which some are taken.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..drives import Array, Piece, line, rest
from ..inexact.signals import Shape, pause, sine, staircase, steps

Rng = np.random.Generator
SHORTEST = 4  # samples of a straight leg
MEAN_FREE = 24  # samples of a random walk's typical leg, at least


def legs(corners: Array, spans: Array) -> list[Piece]:
    """Straight legs between corners, each of a number of samples."""
    ends = pairwise(corners.tolist())
    return [line(int(n), a, b) for n, (a, b) in zip(spans.tolist(), ends, strict=True)]


def timed(corners: Array, room: float, slope: bool = True) -> Array:
    """Samples of each leg in a room of samples: of one slope, or of one duration."""
    lengths = np.abs(np.diff(corners)) if slope else np.ones(len(corners) - 1)
    return np.maximum(SHORTEST, (lengths / lengths.sum() * room).astype(int))


def filled(body: list[Piece], n: int, level: float) -> list[Piece]:
    """The pieces, and a rest for what is left of n samples."""
    still = n - sum(int(d) for d, _ in body)
    return [*body, rest(still, level)] if still > 0 else body


def triangles(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Triangles of many amplitudes, up, down or mixed, each one to three times; a rest for some."""
    sizes = np.linspace(g.uniform(0.1, 0.3), 1.0, int(g.integers(4, 9)))
    sizes = {0: sizes, 1: sizes[::-1], 2: g.permutation(sizes)}[int(g.integers(3))]
    times, still = int(g.choice([1, 1, 2, 3])), pause(g, n, rate)
    corners = np.concatenate([[0.0], *(np.tile([a, -a], times) for a in sizes), [0.0]])
    body = legs(corners, timed(corners, n - 2 * still, bool(g.uniform() < 0.5)))
    return filled([rest(still, 0.0), *body] if still else body, n, 0.0), 1


def tones(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Two to five tones that share no period, after a soft start."""
    many = int(g.integers(2, 6))
    cycles = np.sort(np.exp(g.uniform(np.log(3), np.log(n / 30), many)))
    sizes = (cycles[0] / cycles) ** g.uniform(0, 0.8)
    phases, sizes = g.uniform(0, 2 * np.pi, many), 0.99 * sizes / sizes.sum()

    def signal(t: Array) -> Array:
        soft = np.sin(0.5 * np.pi * np.clip(t / (0.02 * n), 0, 1)) ** 2
        return soft * (sizes @ np.sin(2 * np.pi * np.outer(cycles / n, t) + phases[:, None]))

    return [(n, signal)], 1


def random_walk(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Straight legs between random levels, of one slope or of random durations."""
    many = int(g.integers(20, max(21, min(120, n // MEAN_FREE))))
    steps_ = np.cumsum(g.standard_normal(many) * g.uniform(0.4, 0.9))
    corners = np.concatenate([[0.0], 2 * np.abs((steps_ / 2 + 0.5) % 2 - 1) - 1])
    corners = np.clip(corners, -1, 1) / np.max(np.abs(corners))
    spans = timed(corners, n)
    if g.uniform() < 0.5:
        shares = g.exponential(size=many) + 0.15
        spans = np.maximum(SHORTEST, (shares / shares.sum() * n).astype(int))
    return filled(legs(corners, spans), n, float(corners[-1])), 1


def falling_sine(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """A sine whose size falls to a tenth, once, or down and up again; a rest for some."""
    cycles, still = int(g.integers(8, 25)), pause(g, n, rate)
    p, back = n - 2 * still, bool(g.uniform() < 0.4)

    def signal(t: Array) -> Array:
        s = t / p
        size = 10.0 ** -(1 - np.abs(1 - 2 * s) if back else s)
        return size * np.sin(2 * np.pi * cycles * s)

    body: list[Piece] = [(p, signal)]
    return ([rest(still, 0.0), *body, rest(still, 0.0)] if still else body), 1


def steps_and_holds(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Random levels both ways, held over two decades of time, on ramps of two to thirty samples."""
    many = int(g.integers(6, 14))
    levels = np.array([0.0, *g.uniform(-1, 1, many), 1.0, -1.0, 0.0])
    rises = np.maximum(2, g.choice([2, 6, 15, 30]) * np.ones(many + 3, int))
    holds = 10 ** g.uniform(0, 2, many + 3)
    holds = np.maximum(10, (holds / holds.sum() * (0.98 * n - rises.sum())).astype(int))
    body: list[Piece] = [rest(int(0.02 * n), 0.0)]
    for a, b, rise, hold in zip(levels, levels[1:], rises, holds, strict=False):
        body += [line(int(rise), a, b), rest(int(hold), b)]
    return filled(body, n, 0.0), 1


def protocol(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """The drive made to tell: the same path at rates that differ eightfold and more, holds.

    Rest; an amplitude ladder with minor loops, slow; the same fast, two or three times; holds both
    ways from the shortest ramp to a tenth of the recording; a small multisine; the ladder's first
    part again as slow; rest.
    """
    corners = [0.0]
    for a in [*np.sort(g.uniform(0.25, 1.0, int(g.integers(2, 4)))).tolist(), 1.0]:
        b = a * g.uniform(0.2, 0.7)
        corners += [a, -a, -a + b, -a + 0.3 * b, a] if g.uniform() < 0.7 else [a, -a, a]
    corners = np.array([*corners, 0.0])
    slow = timed(corners, g.uniform(0.26, 0.34) * n)
    body = [rest(int(0.04 * n), 0.0), *legs(corners, slow)]
    three = g.uniform() < 0.5
    for ratio in (g.uniform(8, 12), g.uniform(2.5, 4)) if three else (g.uniform(8, 16),):
        body += legs(corners, timed(corners, slow.sum() / ratio))
    for level, share in ((0.8, 0.1), (-0.6, 0.08), (0.4, 0.012), (0.9, 0.003), (-0.8, 0.03)):
        before = float(body[-1][1](np.array([float(body[-1][0])]))[0])
        body += [line(SHORTEST, before, level), rest(int(share * n), level)]
    body += [line(SHORTEST, -0.8, 0.0), _multisine(g, int(0.07 * n))]
    repeated = int(len(slow) * g.uniform(0.4, 1.0))
    body += legs(corners[: repeated + 1], slow[:repeated])
    last = float(corners[repeated])
    back = timed(np.array([last, 0.0]), 0.02 * n) if last else np.zeros(0, int)
    body += legs(np.array([last, 0.0]), back) if last else []
    return filled([*body, rest(int(0.03 * n), 0.0)], n, 0.0), 1


def _multisine(g: Rng, n: int) -> Piece:
    """A small multisine of lines up to a fifth of the sampling rate, soft at its ends."""
    lines = np.unique(np.geomspace(2, n / 5, 30).astype(int))
    phases = g.uniform(0, 2 * np.pi, len(lines))

    def raw(t: Array) -> Array:
        return np.sum(np.sin(2 * np.pi * np.outer(lines, t) / n + phases[:, None]), axis=0)

    peak = float(np.max(np.abs(raw(np.arange(n, dtype=float)))))
    size = g.uniform(0.04, 0.1) / peak

    def signal(t: Array) -> Array:
        soft = np.sin(0.5 * np.pi * np.clip(np.minimum(t, n - t) / (0.05 * n), 0, 1)) ** 2
        return size * soft * raw(t)

    return n, signal


ORDINARY: dict[str, Shape] = {
    f.__name__: f
    for f in (
        triangles, sine, tones, steps, steps_and_holds, random_walk, falling_sine, staircase,
    )
}  # fmt: skip
BOTTOM = ("steps", "staircase")
DRIVES = ORDINARY | {"protocol": protocol}


def others(name: str) -> list[str]:
    """Ordinary shapes that begin where the named one does."""
    return [k for k in ORDINARY if k != name and (k in BOTTOM) == (name in BOTTOM)]
