"""The exam's drives: one shape each, fitted to a number of samples, a rate and a voltage range.

A template returns pieces whose durations are in samples and whose values are in -1..1, and how
often the whole repeats. The samples determine the drive: smooth parts have 20 samples per cycle or
more, and corners are rounded over 20 samples, as an amplifier does (a spline through sharp corners
of 3,000 samples would miss FOH's |du/dt| term by 3.5 noise sd, a straight line through sines by
0.1 to 0.4).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from .drives import Array, Drive, Piece, burst, compose, edge, rest

Rng = np.random.Generator
Template = Callable[[Rng, int, int], tuple[list[Piece], int]]  # (rng, samples, rest samples)


SOFT = 10.0  # samples on either side of a corner


def zigzag(legs: list[tuple[int, float]], start: float) -> Piece:
    """Straight legs (samples, end) around a closed period, with rounded corners.

    The slope changes by D as the integral of 15/16 (1 - r^2)^2, r the distance over SOFT, which
    adds D SOFT 15/16 ((1 - r^2)^3/6 - r (8/15 - r + 2 r^3/3 - r^5/5)) to the sharp corner.
    """
    times = np.concatenate([[0], np.cumsum([n for n, _ in legs])]).astype(float)
    values = np.array([start, *(v for _, v in legs)])
    slopes = np.diff(values) / np.diff(times)
    bends = slopes - np.roll(slopes, 1)  # at the start of each leg, round the period
    period = times[-1]

    def signal(t: Array) -> Array:
        out = np.interp(t, times, values)
        for at, bend in zip(times[:-1], bends, strict=True):
            r = np.minimum(np.abs((t - at + period / 2) % period - period / 2) / SOFT, 1.0)
            tail = r * (8 / 15 - r + 2 * r**3 / 3 - r**5 / 5)
            out += bend * SOFT * 15 / 16 * ((1 - r * r) ** 3 / 6 - tail)
        return out

    return float(period), signal


def _cycles(g: Rng, n: int) -> tuple[int, int]:
    """Number of cycles and even samples per cycle."""
    m = int(g.choice([4, 6, 8, 10, 12]))
    return m, n // m // 2 * 2


def sine(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Steady sine, 4 to 12 identical cycles, from its middle."""
    m, p = _cycles(g, n)
    return [(p, lambda t: np.sin(2 * np.pi * t / p))], m


def triangle(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Triangle, 4 to 12 identical cycles, from its lowest voltage."""
    m, p = _cycles(g, n)
    return [zigzag([(p // 2, 1), (p // 2, -1)], -1)], m


def ladder(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Two-cycle bursts at several amplitudes, up and down, with a rest; twice."""
    sizes = [0.15, 0.35, 0.6, 1.0, 0.75, 0.45, 0.25]
    p = (n // 2 - still) // (2 * len(sizes))
    body = [burst(1 / p, 2, a, 0.0, 0.15) for a in sizes]
    return [rest(n // 2 - 2 * p * len(sizes), 0.0), *body], 2


def bursts(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Bursts of six frequencies, slow to 22 samples per cycle, with a rest; twice."""
    room = (n // 2 - still) // 6
    body: list[Piece] = []
    for p in np.geomspace(room, 22, 6):
        p = int(p)
        c = max(1, room // p)
        body.append(burst(1 / p, c, min(1.0, (p / 60) ** 0.5), 0.0))
    used = sum(round(d) for d, _ in body)
    return [rest(n // 2 - used, 0.0), *body], 2


def steps(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Staircase of random levels both ways, holds over a decade, soft edges, rests at the ends."""
    levels = [-1.0, -0.3, 0.5, 1.0, *g.uniform(-1, 1, 5), -1.0, -1.0]
    holds = np.exp(g.uniform(0, np.log(12), len(levels) - 1))
    holds = np.maximum(24, holds / holds.sum() * (n - 2 * still)).astype(int)
    edges = [edge(int(h), a, b, 18) for a, b, h in zip(levels[:-1], levels[1:], holds, strict=True)]
    return [rest(still, -1.0), *edges, rest(n - still - int(holds.sum()), -1.0)], 1


def holds(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Up, long hold, down, long hold, a half step and back; twice."""
    p = n // 2
    length = [int(p * x) for x in (0.1, 0.3, 0.25, 0.2)]
    levels = [-1.0, -1.0, 1.0, -1.0, 0.2]
    body = [edge(h, a, b, 18) for a, b, h in zip(levels[:-1], levels[1:], length, strict=True)]
    return [*body, edge(p - sum(length), 0.2, -1.0, 18)], 2


def multisine(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Random-phase multisine with falling odd lines up to 25 samples per cycle; 3 or 4 periods."""
    m = int(g.choice([3, 4]))
    p = n // m
    k = np.arange(1, max(4, p // 25), 2)
    k = k[np.unique(np.geomspace(1, len(k), min(len(k), 24)).astype(int)) - 1]
    size, phase = 1 / (1 + k / 6), g.uniform(0, 2 * np.pi, len(k))

    def raw(t: Array) -> Array:
        return size @ np.sin(2 * np.pi * np.outer(k, t) / p + phase[:, None])

    peak = np.max(np.abs(raw(np.arange(0, p, 2.0))))
    return [(p, lambda t: raw(t) / peak)], m


def reversal_curves(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """First-order reversal curves from the top down to five levels; twice."""
    depth = np.array([0.2, 0.4, 0.6, 0.8, 1.0]) * 2
    half = (depth * (n // 2 - still) / 2 / depth.sum()).astype(int)
    legs = [q for d, h in zip(depth, half, strict=True) for q in ((int(h), 1 - d), (int(h), 1))]
    return [zigzag([(n // 2 - 2 * int(half.sum()), 1), *legs], 1)], 2


def rich(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Bursts of three amplitudes, three fast tones, a short staircase and a rest; twice."""
    room = n // 2 - still
    p = room // 12
    body = [burst(1 / p, 2, a, 0.0, 0.2) for a in (0.4, 1.0, 0.7)]
    for q in (90, 45, 24):
        body.append(burst(1 / q, max(1, p // q), min(1.0, (q / 90) ** 0.5), 0.0))
    levels = [0.0, 0.6, 1.0, -0.6, -1.0, 0.0]
    left = (room - sum(round(d) for d, _ in body)) // 5
    body += [edge(left, a, b, 18) for a, b in pairwise(levels)]
    return [rest(n // 2 - sum(round(d) for d, _ in body), 0.0), *body], 2


def bias_sweep(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Bursts of one small amplitude at five biases and one large burst; twice."""
    p = (n // 2 - still) // 17
    body: list[Piece] = []
    now = 0.0
    for bias in (-0.75, -0.4, 0.0, 0.4, 0.75):
        body += [edge(p, now, bias, min(p, 40)), burst(1 / p, 2, 0.22, bias, 0.2)]
        now = bias
    body += [edge(p, now, 0.0, min(p, 40)), burst(1 / p, 1, 1.0, 0.0, 0.2)]
    return [rest(n // 2 - sum(round(d) for d, _ in body), 0.0), *body], 2


def sweep(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Logarithmic sweep from three cycles per sweep to 22 samples per cycle; twice."""
    p = n // 2 - still
    first, last = 3 / p, 1 / 22
    rate = np.log(last / first) / p

    def signal(t: Array) -> Array:
        soft = np.sin(0.5 * np.pi * np.clip(np.minimum(t, p - t) / (0.03 * p), 0, 1)) ** 2
        size = 1 / (1 + 2 * t / p)
        return soft * size * np.sin(2 * np.pi * first * np.expm1(rate * t) / rate)

    return [rest(n // 2 - p, 0.0), (p, signal)], 2


def speeds(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Triangles of one amplitude at four speeds, a rest at the bottom; twice."""
    room = n // 2 - still
    legs = [max(24, int(room / 2 * x)) for x in (0.6, 0.25, 0.1, 0.05)]
    body = [q for h in legs for q in ((h, 1.0), (h, -1.0))]
    return [zigzag([(n // 2 - 2 * sum(legs), -1.0), *body], -1.0)], 2


def decaying(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Ten cycles whose amplitude decays and grows again, one run, a rest only at the end."""
    p = n - still

    def signal(t: Array) -> Array:
        soft = np.sin(0.5 * np.pi * np.clip(np.minimum(t, p - t) / (0.06 * p), 0, 1)) ** 2
        return soft * np.exp((np.abs(2 * t / p - 1) - 1) * 2.4) * np.sin(20 * np.pi * t / p)

    return [(p, signal), rest(still, 0.0)], 1


def wander(g: Rng, n: int, still: int) -> tuple[list[Piece], int]:
    """Smooth random voltage without repeat or rest: no noise floor to be had from it."""
    k = np.arange(1, n // 60)
    size, phase = 1 / (1 + k / 12), g.uniform(0, 2 * np.pi, len(k))
    size[0] = 0.0
    x = np.arange(0, 2 * n, 4.0)  # twice the record: the record is no period
    grid = size @ np.sin(np.pi * np.outer(k, x) / n + phase[:, None])
    peak = np.max(np.abs(grid[: len(x) // 2]))

    def signal(t: Array) -> Array:
        out = np.zeros_like(t)
        for c, a, b in zip(size / peak, k, phase, strict=True):
            out += c * np.sin(np.pi * a * t / n + b)
        return out

    return [(n, signal)], 1


TEMPLATES: dict[str, Template] = {
    f.__name__: f
    for f in (
        sine, triangle, ladder, bursts, steps, holds, multisine, reversal_curves, rich, bias_sweep,
        sweep, speeds, decaying, wander,
    )
}  # fmt: skip
ORDINARY = ("sine", "triangle", "ladder", "steps", "decaying")


# Held-out drives start where the training drive does, so that the actuator's zero is the same.
ALIKE = (
    ("triangle", "steps", "holds", "speeds"),
    ("sine", "ladder", "bursts", "rich", "bias_sweep", "sweep", "decaying"),
)


def make_drive(
    name: str, seed: int, rate: float, samples: int, volts_seed: int | None = None
) -> Drive:
    """The named drive: about `samples` at `rate` Hz, its voltages drawn within -20 to 110 V.

    Where the record is long enough, rests last 0.25 s. `volts_seed` draws the voltage range.
    """
    g = np.random.default_rng([seed, 3])
    still = int(min(0.25 * rate, 0.12 * samples))
    pieces, repeats = TEMPLATES[name](g, samples, still)
    g = np.random.default_rng([seed if volts_seed is None else volts_seed, 5])
    size, middle = g.uniform(28, 50), g.uniform(30, 60)
    unit = compose(name, pieces, repeats, 1.0)
    n = round(unit.duration)
    whole = unit.duration if repeats == 1 else unit.duration / repeats

    def signal(t: Array) -> Array:
        s = t * rate
        beyond = s > n - 1e-9
        if repeats > 1:
            s = np.where(beyond, s - whole, s)
        return middle + size * unit.signal(np.minimum(s, n + 16.0))

    period = None if unit.period is None else unit.period / rate
    drive = Drive(name, signal, n / rate, rate, (), period, 16 / rate)
    return replace(drive, rests=_rests(drive))


def _rests(drive: Drive, least: int = 10) -> tuple[tuple[float, float], ...]:
    """Stretches of `least` samples or more of constant voltage, in s."""
    still = np.abs(np.diff(drive(drive.times))) < 1e-9
    ends = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    pairs = zip(ends[::2].tolist(), ends[1::2].tolist(), strict=True)
    return tuple((a / drive.rate, b / drive.rate) for a, b in pairs if b - a >= least)


def floor_of(drive: Drive) -> str:
    """How the recording shows its noise: a rest of 0.2 s, repeated periods, or not at all."""
    if any(b - a >= 0.2 for a, b in drive.rests):
        return "rest"
    return "periods" if drive.period else "none"
