r"""The next experiment: the drive on which effects that look alike part the most.

For two fitted explanations k and l the drive is worth

    λ_kl = ‖ (1 - P_l) W (f_k - f_l) ‖²

with P_l the projection onto what l's own parameters could still take up: the fall of χ² that the
right one of them would show, N(λ, 4λ) distributed.  The drive with the largest least λ over all
pairs is proposed; where that is likely to fail, over those of the first with as many as possible.
Where it fails for all of them, the drives are tried anew at other rates: as many samples over a
longer time, in which what is slow shows, or over a shorter one, whose faster drives reach above
the band that was recorded.
Source: Atkinson & Fedorov, Biometrika 62 (1975) 57 (T-optimality).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, permutations

import numpy as np
from scipy.signal import chirp, lfilter, sawtooth
from scipy.stats import norm

from .._blocks import AbstractBlock
from .._operators import Grid, refine
from .._prepare import Noise, Preparation, layout_of
from .._recording import InputError, Recording, parse_quantity
from .._solve import orthonormal_basis

_SAMPLES = 4096
_FASTER = 10.0
_LEAST_PER_PERIOD = 16
_DELTA_BIC = 10.0
_REST, _LEAD, _LONGEST_LEAD = 0.2, 0.05, 0.25
_ROUNDING = np.array([1, 4, 6, 4, 1]) / 16
_EXAMINED = 10
_RATES = (1, 1 / 4, 4, 1 / 16, 16)
LIKELY = 0.5
"""A drive that is more likely to fail tells nothing."""


@dataclass(frozen=True)
class Limits:
    """What the hardware allows: the drive's range [drive unit] and its fastest change [unit/s]."""

    low: float
    high: float
    slew: float

    @property
    def centre(self) -> float:
        return 0.5 * (self.low + self.high)

    @property
    def reach(self) -> float:
        return 0.5 * (self.high - self.low)


def recorded_limits(recordings: Sequence[Recording]) -> Limits:
    """The range that was recorded, and ten times its fastest change."""
    rates = [float(np.abs(np.diff(r.drive)).max() / r.dt) for r in recordings]
    return Limits(
        float(min(r.drive.min() for r in recordings)),
        float(max(r.drive.max() for r in recordings)),
        _FASTER * max(rates),
    )


def parse_limits(text: str, recordings: Sequence[Recording]) -> Limits:
    """Limits from such as "0..100 V, 50 V/ms"; the slew may be left out.  Raises InputError."""
    unit, known = recordings[0].drive_unit, recorded_limits(recordings)
    found = re.fullmatch(r"\s*(\S+?)\s*\.\.\s*(\S+?)\s*([A-Za-zµ]*)\s*(?:,\s*(.+))?", text)
    if found is None:
        raise InputError.at(
            "--limits", f'a range and a slew such as "0..100 {unit}, 50 {unit}/ms"', f'"{text}"',
            "write it so",
        )  # fmt: skip
    low, high, own, slew = found.groups()
    low, high = (parse_quantity(f"{end} {own or unit}", unit, "--limits") for end in (low, high))
    fastest = parse_quantity(slew, f"{unit}/s", "--limits") if slew else known.slew
    if not (low < high and fastest > 0):
        raise InputError.at(
            "--limits", "a lower end below the upper and a slew above zero", f'"{text}"',
            "correct it",
        )  # fmt: skip
    return Limits(low, high, fastest)


@dataclass(frozen=True)
class Drive:
    """A drive that could be recorded next: `values` (N,) at `step` s, and how to describe it."""

    description: str
    values: np.ndarray
    step: float

    @property
    def times(self) -> np.ndarray:
        """Times (N,) [s] of the samples."""
        return self.step * np.arange(self.values.size)


def _spanned(wave: np.ndarray, limits: Limits, share: float = 1.0, bias: float = 0.0) -> np.ndarray:
    """A wave within ±1 as a drive: `share` of the reach about the centre moved by `bias` of it."""
    return limits.centre + limits.reach * (bias + share * wave)


def _triangle(angle: np.ndarray) -> np.ndarray:
    """A triangle within ±1 that starts at -1."""
    return sawtooth(angle, 0.5)  # type: ignore[arg-type]


def rest_samples(step: float) -> int:
    """How many samples a drive rests before it begins: as long as tells a noise floor, but no
    longer than a quarter of the drive."""
    shortest, longest = (int(share * _SAMPLES) for share in (_LEAD, _LONGEST_LEAD))
    return int(np.clip(_REST / step, shortest, longest))


def drives(limits: Limits, step: float, unit: str, start: float, rest: int) -> list[Drive]:
    """Some forty drives within the limits, `_SAMPLES` long after `rest` samples at `start`: tones,
    triangles, amplitude ladders, steps, reversal curves, sweeps, bursts, small tones on a shifted
    bias, and a rest."""
    t = np.arange(_SAMPLES) * step
    duration = _SAMPLES * step
    slowest = 2 / duration
    fastest = min(1 / (_LEAST_PER_PERIOD * step), limits.slew / (2 * np.pi * limits.reach))
    fastest = max(fastest, slowest)
    tones = np.geomspace(slowest, fastest, 6)
    few = np.geomspace(2 * slowest, 0.5 * fastest, 3) if fastest > 4 * slowest else tones[:1]
    found: dict[str, np.ndarray] = {}

    def add(description: str, values: np.ndarray) -> None:
        found[description] = values

    for f in tones:
        for share in (1.0, 0.4):
            add(
                f"a sine of {f:.3g} Hz over {2 * share * limits.reach:.3g} {unit}",
                _spanned(-np.cos(2 * np.pi * f * t), limits, share),
            )
    for f in few:
        angle = 2 * np.pi * f * t
        rising = np.minimum(1.0, 0.25 * (1 + np.floor(4 * t / duration)))
        full = f"{2 * limits.reach:.3g} {unit}"
        add(f"a triangle of {f:.3g} Hz over {full}", _spanned(_triangle(angle), limits))
        add(
            f"sines of {f:.3g} Hz in four amplitudes up to {full}",
            _spanned(-np.cos(angle) * rising, limits),
        )
        add(
            f"a decaying sine of {f:.3g} Hz from {full}",
            _spanned(np.sin(angle) * (1 - t / duration), limits),
        )
        peaks = np.floor(f * t) / max(np.floor(f * duration), 1)
        add(
            f"first-order reversal curves of {f:.3g} Hz over {full}",
            _spanned(1 - (1 - _triangle(angle + np.pi)) * (1 - 0.9 * peaks), limits),
        )
        for bias in (-0.6, 0.6):
            add(
                f"a sine of {f:.3g} Hz over {0.8 * limits.reach:.3g} {unit} about "
                f"{limits.centre + bias * limits.reach:.4g} {unit}",
                _spanned(np.sin(angle), limits, 0.4, bias),
            )
    levels = np.array([-1, 1, -1, 0, 1, 0, -1, -0.5, 1, -1])
    for holds in (5, 10):
        at = np.minimum((t / duration * holds).astype(int), holds - 1)
        add(
            f"{holds} steps over {2 * limits.reach:.3g} {unit}, each held for "
            f"{duration / holds:.3g} s",
            _spanned(levels[at], limits),
        )
    low, high = tones[0], tones[-1]
    add(
        f"a sweep from {low:.3g} to {high:.3g} Hz over {2 * limits.reach:.3g} {unit}",
        _spanned(chirp(t, low, duration, high, "logarithmic", 90), limits),
    )
    thirds = np.minimum((3 * t / duration).astype(int), 2)
    bursts = np.sin(2 * np.pi * few[np.minimum(thirds, few.size - 1)] * t)
    within = (3 * t / duration) % 1 < 0.8
    add(
        f"bursts of {', '.join(f'{f:.3g}' for f in few)} Hz with rests",
        _spanned(bursts * within, limits),
    )
    add("a rest at one level", np.full(_SAMPLES, limits.centre))
    return [
        Drive(text, _allowed(values, limits, step, start, rest), step)
        for text, values in found.items()
    ]


def _allowed(
    values: np.ndarray, limits: Limits, step: float, start: float, rest: int
) -> np.ndarray:
    """The drive from a rest at `start`, within range and slew.

    It begins where the recording began, for some effects count from there.  Its corners are rounded
    over four samples: what a drive with corners does between its samples, they do not tell.
    """
    led = np.concatenate([np.full(rest, start), values])
    most = limits.slew * step
    wanted = followed = np.clip(led, limits.low, limits.high)
    if np.abs(np.diff(wanted)).max() > most:
        followed, level = np.empty_like(wanted), wanted[0]
        for k, one in enumerate(wanted):
            level += min(max(one - level, -most), most)
            followed[k] = level
    beyond = _ROUNDING.size // 2
    return np.convolve(np.pad(followed, beyond, mode="edge"), _ROUNDING, "valid")


@dataclass(frozen=True)
class Proposal:
    """The drive to record next, the rivals that it is to tell from the first, and the least
    probability with which it does; `all_apart` where it is to tell each from every other too."""

    drive: Drive
    probability: float
    told: tuple[int, ...]
    all_apart: bool


def propose(
    rivals: Sequence[AbstractBlock],
    preparation: Preparation,
    limits: Limits,
    progress: Callable[[str], None],
) -> Proposal:
    """The drive on which the fitted rivals part the most.

    Where none is likely to tell each of them from every other, the one that tells most from the
    first: two that nothing tells apart are no reason to leave the others together.  At another
    rate than the recording's only where none is likely to tell anything at that.
    """
    take = preparation.takes[0]
    noise, recording = take.noise, take.recording
    assert noise is not None  # a diagnosis has one
    start = float(recording.drive[0])
    rest = rest_samples(recording.dt)  # of one length at all rates, so that no law compiles anew

    def at(rate: float) -> Proposal:
        step = recording.dt / rate
        candidates = drives(limits, step, recording.drive_unit, start, rest)
        progress(f"choosing the next experiment among {len(candidates)} drives")
        found = _proposed(candidates, rivals, noise, preparation.oversampling)
        if rate == 1:
            return found
        told = f"{found.drive.description}, at {1 / step:.6g} samples/s"
        return replace(found, drive=replace(found.drive, description=told))

    own = at(_RATES[0])
    others = map(at, _RATES[1:])
    return next((found for found in chain([own], others) if found.probability >= LIKELY), own)


def _proposed(
    candidates: list[Drive], rivals: Sequence[AbstractBlock], noise: Noise, oversampling: int
) -> Proposal:
    """The most telling of some drives."""
    trials = [_Trial(drive, noise, oversampling) for drive in candidates]
    # What the parameters can take up costs ten times more to find than the responses themselves.
    gaps = np.array([trial.gaps(rivals) for trial in trials])
    promising = np.argsort(-np.mean(np.log(gaps + 1e-300), axis=1))[:_EXAMINED]
    apart = _probability(np.array([trials[k].separability(rivals) for k in promising]))
    k, told, all_apart = _most_telling(apart)
    probability = float(apart[k].min() if all_apart else apart[k, 0, told].min())
    return Proposal(candidates[promising[k]], probability, told, all_apart)


def _most_telling(apart: np.ndarray) -> tuple[int, tuple[int, ...], bool]:
    """Which drive, and what it is to tell from the first, of the probabilities (drives, rivals,
    rivals) that it tells two apart; with whether it tells each from every other."""
    others, least = tuple(range(1, apart.shape[1])), apart.min(axis=(1, 2))
    if least.max() < LIKELY:
        from_first = apart[:, 0, 1:]
        for count in range(len(others), 0, -1):
            worst = np.sort(from_first, axis=1)[:, -count]
            k = int(np.argmax(worst))
            if worst[k] >= LIKELY:
                told = 1 + np.argsort(-from_first[k], kind="stable")[:count]
                return k, tuple(sorted(told.tolist())), False
    return int(np.argmax(least)), others, True


def _probability(separability: np.ndarray) -> np.ndarray:
    """P(fall of χ² ≥ 10) where the fall is N(λ, 4λ)."""
    return norm.cdf((separability - _DELTA_BIC) / (2 * np.sqrt(separability) + 1e-12))


class _Trial:
    """A drive made ready to be simulated."""

    def __init__(self, drive: Drive, noise: Noise, oversampling: int):
        self.noise, self.oversampling = noise, oversampling
        self.grid = Grid(np.asarray(drive.step / oversampling), "constant")
        self.fine = refine(drive.values, oversampling, "constant")

    def _whitened(self, signals: np.ndarray) -> np.ndarray:
        """Signals (M, …) on the fine grid, at the samples and whitened."""
        sampled = signals[:: self.oversampling]
        return np.asarray(lfilter(self.noise.whitening, 1.0, sampled, axis=0))

    def gaps(self, rivals: Sequence[AbstractBlock]) -> list[float]:
        """How far every two rivals' responses are apart, before any parameter takes it up."""
        found = [self._whitened(block.respond(self.fine, self.grid)) for block in rivals]
        return [float(np.var(one - other)) for one, other in combinations(found, 2)]

    def separability(self, rivals: Sequence[AbstractBlock]) -> np.ndarray:
        """λ (rivals, rivals), the lesser of both orders of a pair."""
        responses, bases = [], []
        for block in rivals:
            layout = layout_of(block)
            names = [name for name, _ in layout.shapes + layout.gains]
            response, columns, _ = block.linearise(self.fine, self.grid, names, ())
            pieces = [columns[name] for name in names]
            own = np.ones((self.fine.size, 1))
            bases.append(orthonormal_basis(self._whitened(np.concatenate([*pieces, own], axis=1))))
            responses.append(self._whitened(response))
        worth = np.diag(np.full(len(rivals), np.finfo(float).max))
        for one, other in permutations(range(len(rivals)), 2):
            difference = responses[one] - responses[other]
            left = difference - bases[other] @ (bases[other].T @ difference)
            worth[one, other] = np.nan_to_num(left @ left, nan=0.0)
        return np.minimum(worth, worth.T)
