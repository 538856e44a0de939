"""Drives of the second tier: what laboratories play to a stage, with corners and unresolved edges.

A shape is drawn in samples and half ranges (-1..1), and then fitted to a rate and to volts.  Half
of the shapes begin at the middle and half at the bottom; a held-out drive begins where the
recording did, so that both have one zero.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np

from ..drives import Array, Drive, Piece, compose, edge, line, rest

Rng = np.random.Generator
Shape = Callable[[Rng, int, float], tuple[list[Piece], int]]  # rng, samples, rate in Hz; repeats
FASTEST = 22  # samples of the shortest cycle
BEYOND = 16.0  # samples that a drive goes on after its end, for clocks that run ahead


def pause(g: Rng, n: int, rate: float) -> int:
    """Samples of a rest, .4 s where there is room; none for two in five."""
    return int(g.uniform() < 0.6) * int(min(0.4 * rate, 0.1 * n))


def cycles(periods: int, size: float, period: int) -> Piece:
    """Whole periods of a sine from its middle."""
    return periods * period, lambda t: size * np.sin(2 * np.pi * t / period)


def sine(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """A steady sine of about 1 Hz, or of three to six cycles where the record is short or long."""
    m = round(n / rate) if 3 <= n / rate <= 12 else int(g.integers(3, 7))
    return [cycles(1, 1.0, n // m)], m


def triangle(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """A steady triangle with sharp corners, three to eight cycles."""
    m = int(g.choice([3, 4, 6, 8]))
    half = n // m // 2
    return [line(half, -1, 1), line(half, 1, -1)], m


def decaying_triangle(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Legs of one slope between peaks that shrink, with a rest: nested minor loops."""
    shrink = g.uniform(0.72, 0.9)
    peaks = (-shrink) ** np.arange(int(g.integers(8, 15)))
    corners = [0.0, *peaks, 0.0]
    repeats = int(g.choice([1, 2]))
    room = n // repeats - pause(g, n, rate)
    lengths = np.abs(np.diff(corners))
    spans = np.maximum(FASTEST // 2, (lengths / lengths.sum() * room).astype(int))
    legs = [line(int(d), a, b) for d, (a, b) in zip(spans, pairwise(corners), strict=True)]
    still = n // repeats - int(spans.sum())
    return ([*legs, rest(still, 0.0)] if still > 0 else legs), repeats


def amplitudes(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Sines of one frequency and four to six sizes, two or three cycles each; rests for some."""
    sizes = g.permutation(np.linspace(0.15, 1.0, int(g.integers(4, 7))))
    many, repeats = int(g.integers(2, 4)), int(g.choice([1, 2]))
    still = pause(g, n, rate)
    period = (n // repeats - still) // (many * len(sizes))
    body = [cycles(many, size, period) for size in sizes]
    return ([rest(still, 0.0), *body] if still else body), repeats


def edges(g: Rng, levels: Array, holds: np.ndarray, still: int) -> list[Piece]:
    """A rest, then edges to levels and holds there.

    Some edges are soft; others are ramps of one to three samples that begin between samples.
    """
    soft = g.uniform() < 0.55
    rise = float(g.integers(15, 25) if soft else g.uniform(1.0, 3.0))
    late = 0.0 if soft else float(g.uniform())
    body = [rest(still + late, levels[0])]
    holds = holds - np.append(np.zeros(len(holds) - 1), late)
    for (a, b), hold in zip(pairwise(levels.tolist()), holds.tolist(), strict=True):
        ramp = edge(rise, a, b, rise) if soft else line(rise, a, b)
        body += [ramp, rest(hold - rise, b)]
    return body


def steps(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Random levels both ways, holds over a decade."""
    many, still = int(g.integers(5, 12)), int(min(0.4 * rate, 0.1 * n))
    levels = np.array([-1.0, 1.0, *g.uniform(-1, 1, many - 2), -1.0])
    holds = np.exp(g.uniform(0, np.log(10), len(levels) - 1))
    holds = np.maximum(40, (holds / holds.sum() * (n - still)).astype(int))
    return edges(g, levels, holds, still), 1


def staircase(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Equal steps up and down again with equal holds, once or twice."""
    many, repeats = int(g.integers(3, 8)), int(g.choice([1, 2]))
    up = np.linspace(-1, 1, many + 1)
    levels = np.concatenate([up, up[-2::-1]])
    hold = int(0.95 * (n // repeats)) // (len(levels) - 1)
    still = n // repeats - hold * (len(levels) - 1)
    return edges(g, levels, np.full(len(levels) - 1, hold), still), repeats


def sweep(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """A logarithmic sweep up to FASTEST, its size falling with the frequency for some."""
    repeats, falls = int(g.choice([1, 2])), float(g.choice([0.0, 0.5, 1.5]))
    still = pause(g, n, rate)
    p = n // repeats - still
    first, last = g.uniform(2, 5) / p, 1 / g.uniform(FASTEST, 2 * FASTEST)
    growth = np.log(last / first) / p

    def signal(t: Array) -> Array:
        soft = np.sin(0.5 * np.pi * np.clip(np.minimum(t, p - t) / (0.03 * p), 0, 1)) ** 2
        wave = np.sin(2 * np.pi * first * np.expm1(growth * t) / growth)
        return soft * wave / (1 + falls * t / p)

    return ([rest(still, 0.0), (p, signal)] if still else [(p, signal)]), repeats


def multisine(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """Up to 24 lines of random phase, falling with the frequency, three to five periods."""
    m = int(g.choice([3, 4, 5]))
    p = n // m
    k = np.unique(np.geomspace(1, max(4, p // (2 * FASTEST)), 24).astype(int))
    size = 1 / (1 + k / g.uniform(2, 8))
    phases = g.uniform(0, 2 * np.pi, len(k))

    def raw(t: Array) -> Array:
        return size @ np.sin(2 * np.pi * np.outer(k, t) / p + phases[:, None])

    start, peak = raw(np.zeros(1))[0], np.max(np.abs(raw(np.arange(0.0, p))))
    scale = 1 / (peak + abs(start))  # begins at the middle
    return [(p, lambda t: scale * (raw(t) - start))], m


def two_sines(g: Rng, n: int, rate: float) -> tuple[list[Piece], int]:
    """A slow sine and one that is two and a third to twelve times as fast, three to six periods."""
    m, slow = int(g.choice([3, 4, 6])), 3
    p = n // m
    fast = int(g.choice([k for k in (7, 10, 14, 20, 36) if k <= p / FASTEST]))
    share, phase = g.uniform(0.15, 0.5), 2 * np.pi / p

    def signal(t: Array) -> Array:
        return (1 - share) * np.sin(slow * phase * t) + share * np.sin(fast * phase * t)

    return [(p, signal)], m


MIDDLE: dict[str, Shape] = {
    f.__name__: f for f in (sine, decaying_triangle, amplitudes, sweep, multisine, two_sines)
}
BOTTOM: dict[str, Shape] = {f.__name__: f for f in (triangle, steps, staircase)}
SHAPES = MIDDLE | BOTTOM


def others(name: str) -> list[str]:
    """Shapes that begin where the named one does."""
    return [k for k in (MIDDLE if name in MIDDLE else BOTTOM) if k != name]


def make_drive(name: str, seed: int, rate: float, samples: int, volts: tuple[float, float],
               shapes: Mapping[str, Shape] = SHAPES) -> Drive:  # fmt: skip
    """A drive of a shape, about `samples` long at `rate` in Hz, over the range `volts` in V."""
    g = np.random.default_rng([seed, 3])
    pieces, repeats = shapes[name](g, samples, rate)
    unit = compose(name, pieces, repeats, 1.0)
    n, whole = round(unit.duration), unit.duration / repeats
    half, middle = 0.5 * (volts[1] - volts[0]), 0.5 * (volts[1] + volts[0])

    def signal(t: Array) -> Array:
        s = np.minimum(t * rate, n + BEYOND)
        again = np.where(s > n - 1e-9, s - whole, s) if repeats > 1 else s
        return middle + half * unit.signal(again)

    whole_samples = [(math.ceil(a), math.floor(b)) for a, b in unit.rests]
    rests = tuple((a / rate, b / rate) for a, b in whole_samples if b - a >= 10)
    period = whole / rate if repeats > 1 else None
    return Drive(name, signal, n / rate, rate, rests, period, BEYOND / rate)
