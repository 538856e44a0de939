r"""The next experiment: the drive for which the responses of look-alikes differ most.

For two fitted explanations k and l the drive is worth

    λ_kl = ‖ (1 - P_l) W (f_k - f_l) ‖²

with P_l the projection onto the changes that l's own parameters could still absorb: the reduction
of χ² by the right one of them, N(λ, 4λ) distributed.  The drive whose smallest λ over all pairs is
largest is proposed.  If it is likely to fail, only the pairs of the first effect with as many
others as possible count.  If that fails too, the drives are tried at other rates: as many samples
over a longer time, which shows slow effects, or over a shorter one, whose faster drives reach above
the recorded band.
Source: Atkinson & Fedorov, Biometrika 62 (1975) 57 (T-optimality).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, combinations, permutations

import numpy as np
from scipy.special import ndtr

from .._blocks import AbstractBlock
from .._filters import moving_sum
from .._operators import Grid, refine
from .._prepare import Noise, Preparation, layout_of
from .._protocol import Drive, Limits, corners_rounded
from .._solve import orthonormal_basis

_SAMPLES = 4096
"""Samples of a drive after its rest; chosen by judgement."""
_LEAST_PER_PERIOD = 16
"""Samples per period of the fastest tone; chosen by judgement."""
_DELTA_BIC = 10.0
"""The reduction of χ² that distinguishes two effects, as for an adoption."""
_REST = 0.2
"""Duration of the rest before a drive [s]; chosen by judgement."""
_LEAD, _LONGEST_LEAD = 0.05, 0.25
"""The shortest and the longest rest, as shares of the drive; chosen by judgement."""
_EXAMINED = 10
"""Drives for which the absorbed changes are computed, those with the largest differences; chosen by
judgement."""
_RATES = (1, 1 / 4, 4, 1 / 16, 16)
"""Sampling rates that are tried, over the recording's own, in this order."""
LIKELY = 0.5
"""A drive with a smaller probability of success is more likely to fail."""


def _spanned(wave: np.ndarray, limits: Limits, share: float = 1.0, bias: float = 0.0) -> np.ndarray:
    """A wave within ±1 as a drive: `share` of the reach about the centre moved by `bias` of it."""
    return limits.centre + limits.reach * (bias + share * wave)


def _triangle(angle: np.ndarray) -> np.ndarray:
    """A triangle within ±1 that starts at -1."""
    from scipy.signal import sawtooth  # most diagnoses do without, and it takes long to import

    return sawtooth(angle, 0.5)  # type: ignore[arg-type]


def rest_samples(step: float) -> int:
    """Samples of the rest before a drive: long enough for a noise floor, but no longer than a
    quarter of the drive."""
    shortest, longest = (int(share * _SAMPLES) for share in (_LEAD, _LONGEST_LEAD))
    return int(np.clip(_REST / step, shortest, longest))


def drives(limits: Limits, step: float, unit: str, start: float, rest: int) -> list[Drive]:
    """Some forty drives within the limits, `_SAMPLES` long after `rest` samples at `start`: tones,
    triangles, amplitude ladders, steps, reversal curves, sweeps, bursts, small tones on a shifted
    bias, and a rest."""
    from scipy.signal import chirp  # as in `_triangle`

    t = np.arange(_SAMPLES) * step
    duration = _SAMPLES * step
    slowest = 2 / duration
    fastest = min(1 / (_LEAST_PER_PERIOD * step), limits.slew / (2 * np.pi * limits.reach))
    fastest = max(fastest, slowest)
    tones = np.geomspace(slowest, fastest, 6)
    few = np.geomspace(2 * slowest, 0.5 * fastest, 3) if fastest > 4 * slowest else tones[:1]
    waveforms: dict[str, np.ndarray] = {}

    def add(description: str, values: np.ndarray) -> None:
        waveforms[description] = values

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
        for text, values in waveforms.items()
    ]


def _allowed(
    values: np.ndarray, limits: Limits, step: float, start: float, rest: int
) -> np.ndarray:
    """The drive (N,) after a rest at `start`, within the limits of range and rate.

    It begins where the recording began, since some effects count from there.  Its corners are
    rounded over four samples, since samples do not show how a drive with corners runs between them.
    """
    led = np.concatenate([np.full(rest, start), values])
    most = limits.slew * step
    wanted = followed = np.clip(led, limits.low, limits.high)
    if np.abs(np.diff(wanted)).max() > most:
        followed, level = np.empty_like(wanted), wanted[0]
        for k, one in enumerate(wanted):
            level += min(max(one - level, -most), most)
            followed[k] = level
    return corners_rounded(followed)


@dataclass(frozen=True)
class Proposal:
    """The drive to record next, the indices of the rivals that it should distinguish from the
    first, and the smallest probability with which it does; `all_apart` if it should distinguish
    each from every other too; and `difference`, the smallest rms over the noise floor by which one
    differs from what the parameters of the other can make of it."""

    drive: Drive
    probability: float
    distinguished: tuple[int, ...]
    all_apart: bool
    difference: float


def propose(
    rivals: Sequence[AbstractBlock],
    preparation: Preparation,
    limits: Limits,
    progress: Callable[[str], None],
) -> Proposal:
    """The drive for which the responses of the fitted rivals differ most.

    If none is likely to distinguish each of them from every other, it is the one that distinguishes
    most of them from the first.  Its rate differs from the recording's only if no drive is likely
    to distinguish anything at that rate.
    """
    take = preparation.takes[0]
    noise, recording = take.noise, take.recording
    assert noise is not None  # a diagnosis has one
    start = float(recording.drive[0])
    rest = rest_samples(recording.dt)  # of one length at all rates, so that no block compiles again

    def at(rate: float) -> Proposal:
        step = recording.dt / rate
        candidates = drives(limits, step, recording.drive_unit, start, rest)
        progress(f"choosing the next experiment among {len(candidates)} drives")
        proposal = _proposed(candidates, rivals, noise, preparation.oversampling)
        if rate == 1:
            return proposal
        description = f"{proposal.drive.description}, at {1 / step:.6g} samples/s"
        return replace(proposal, drive=replace(proposal.drive, description=description))

    own = at(_RATES[0])
    others = map(at, _RATES[1:])
    return next((each for each in chain([own], others) if each.probability >= LIKELY), own)


def _proposed(
    candidates: list[Drive], rivals: Sequence[AbstractBlock], noise: Noise, oversampling: int
) -> Proposal:
    """The drive that distinguishes best."""
    trials = [_Trial(drive, noise, oversampling) for drive in candidates]
    # The changes that the parameters absorb cost ten times as much as the responses themselves.
    gaps = np.array([trial.gaps(rivals) for trial in trials])
    promising = np.argsort(-np.mean(np.log(gaps + 1e-300), axis=1))[:_EXAMINED]
    worth = np.array([trials[k].separability(rivals) for k in promising])
    k, distinguished, all_apart = _most_distinguishing(_probability(worth))
    least = float(worth[k].min() if all_apart else worth[k, 0, distinguished].min())
    drive = candidates[promising[k]]
    return Proposal(
        drive,
        float(_probability(np.array(least))),
        distinguished,
        all_apart,
        float(np.sqrt(least / drive.values.size)),
    )


def _most_distinguishing(apart: np.ndarray) -> tuple[int, tuple[int, ...], bool]:
    """The index of the drive that distinguishes best, from the probabilities (drives, rivals,
    rivals) that it distinguishes two; the rivals that it should distinguish from the first; and
    whether it should distinguish each from every other."""
    others, least = tuple(range(1, apart.shape[1])), apart.min(axis=(1, 2))
    if least.max() < LIKELY:
        from_first = apart[:, 0, 1:]
        for count in range(len(others), 0, -1):
            worst = np.sort(from_first, axis=1)[:, -count]
            k = int(np.argmax(worst))
            if worst[k] >= LIKELY:
                distinguished = 1 + np.argsort(-from_first[k], kind="stable")[:count]
                return k, tuple(sorted(distinguished.tolist())), False
    return int(np.argmax(least)), others, True


def _probability(separability: np.ndarray) -> np.ndarray:
    """P(reduction of χ² ≥ 10), if the reduction is N(λ, 4λ)."""
    return ndtr((separability - _DELTA_BIC) / (2 * np.sqrt(separability) + 1e-12))


class _Trial:
    """A drive on the grid on which it is simulated."""

    def __init__(self, drive: Drive, noise: Noise, oversampling: int):
        self.noise, self.oversampling = noise, oversampling
        self.grid = Grid(np.asarray(drive.step / oversampling), "constant")
        self.fine = refine(drive.values, oversampling, "constant")

    def _whitened(self, signals: np.ndarray) -> np.ndarray:
        """Signals (M, …) of the fine grid, sampled and whitened (N, …)."""
        sampled = signals[:: self.oversampling]
        return moving_sum(self.noise.whitening, sampled)

    def gaps(self, rivals: Sequence[AbstractBlock]) -> list[float]:
        """The variance of the whitened difference of every two rivals' responses, before any
        parameter absorbs it."""
        responses = [self._whitened(block.respond(self.fine, self.grid)) for block in rivals]
        return [float(np.var(one - other)) for one, other in combinations(responses, 2)]

    def separability(self, rivals: Sequence[AbstractBlock]) -> np.ndarray:
        """λ (rivals, rivals), the smaller of both orders of a pair."""
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
            residual = difference - bases[other] @ (bases[other].T @ difference)
            worth[one, other] = np.nan_to_num(residual @ residual, nan=0.0)
        return np.minimum(worth, worth.T)
