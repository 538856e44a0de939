r"""Jumps of the response without a cause in the drive: an empirical description of a mismatch.

A mount that slips, a domain that switches, a counter that loses a fringe, a reading that is held:

    y + Σ_i a_i 1[t ≥ t_i]

They are found one after the other by the projected score test, with a step at every sample as a
column, then fitted together with the base.  Each costs two parameters in BIC.  Effects of the
catalogue with a larger residual than that have only followed the jumps.  A jump that returns after
a few samples is a tail of the noise, and no evidence for or against an effect.
Source: Basseville & Nikiforov, Detection of Abrupt Changes (1993), section 2.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter
from scipy.stats import chi2

from .._prepare import Noise, Preparation, Problem, level_from_differences, residual_noise
from .._solve import Solved, orthonormal_basis, solve_from
from ._judgement import APART
from ._residual import beside_fit, residual_of
from ._score import Residual
from ._stage import Stage

_MOST = 6
"""Jumps that are searched for at most; chosen by judgement."""
_LEAST_SEEN = 1e-6
"""Norm of a step, per sample, below which the fit absorbs it completely."""
_BRIEF = 5
"""Samples within which a jump that returns counts as a tail of the noise; chosen by judgement."""
_BACK = 0.5
"""Remaining share of such a jump; chosen by judgement."""
_LIKELIER = 10.0
"""Gain in BIC from which jumps are more likely than noise of one spectrum."""
_CLEARLY_LESS = 0.85
"""Ratio of the noise without jumps to that with them; chosen by judgement."""


@dataclass(frozen=True)
class Jumps:
    """The base fitted together with jumps at the samples that its preparation lists."""

    solved: Solved

    @property
    def preparation(self) -> Preparation:
        return self.solved.preparation

    @property
    def count(self) -> int:
        """The number of jumps in all recordings together."""
        return sum(len(take.jumps) for take in self.preparation.takes)

    @property
    def searched(self) -> float:
        """The cost in BIC of the times, which are parameters in addition to those of the fit."""
        return self.count * float(np.log(self.solved.samples))

    @property
    def sizes(self) -> list[np.ndarray]:
        """The sizes of each recording's jumps, in the response's unit."""
        takes = zip(self.preparation.takes, self.solved.own, strict=True)
        return [own[own.size - len(take.jumps) :] for take, own in takes]

    def ahead_of(self, other: Solved) -> float:
        """The gain in BIC of the lasting jumps over another fit, without the samples of brief ones;
        -inf if none lasts."""
        if 2 * sum(len(self._brief(k)) for k in range(len(self.sizes))) == self.count:
            return -np.inf
        cost, parameters = 0.0, self.solved.free - other.free + self.count
        pairs = zip(self.solved.whitened, other.whitened, strict=True)
        for k, (own, others) in enumerate(pairs):
            counted = np.ones(own.size, dtype=bool)
            for brief in self._brief(k):
                counted[brief] = False
                parameters -= 4
            cost += float(np.sum((others**2 - own**2)[counted]))
        return cost / self.solved.excess_ratio - parameters * float(np.log(self.solved.samples))

    def _brief(self, k: int) -> list[slice]:
        """The samples of the k-th recording's brief jumps, those that return after a few samples,
        extended by the length of the whitening filter."""
        take = self.preparation.takes[k]
        assert take.noise is not None  # a diagnosis has one
        steps = sorted(zip(take.jumps, self.sizes[k], strict=True))
        brief = []
        while len(steps) > 1:
            (at, size), (then, back), *_ = steps
            returns = abs(size + back) < _BACK * max(abs(size), abs(back))
            if then - at <= _BRIEF and returns:
                brief.append(slice(at, then + take.noise.whitening.size))
            steps = steps[2 if then - at <= _BRIEF and returns else 1 :]
        return brief

    @property
    def gradual(self) -> bool:
        """Whether ramps instead of the jumps reduce χ² more, each so long that it could be
        distinguished from a jump, or as long as its neighbours permit."""
        plain = self.preparation.with_jumps([()] * len(self.sizes))
        problems, residual = plain.problems(), _without_jumps(self, plain)
        ramps, steps = [], []
        for k, (take, sizes) in enumerate(zip(self.preparation.takes, self.sizes, strict=True)):
            ends = [0, *take.jumps, len(take.recording)]
            for at, size in zip(take.jumps, sizes, strict=True):
                place, half = (k, at), 1
                room = min(abs(at - end) for end in ends if end != at)
                step = residual.project(_steps(problems, [place]))[0]
                ramp = residual.project(_steps(problems, [place], half))[0]
                while 2 * half <= room and size**2 * np.sum((ramp - step) ** 2) < APART:
                    half *= 2
                    ramp = residual.project(_steps(problems, [place], half))[0]
                steps.append(step)
                ramps.append(ramp)

        def reduction(columns: list[np.ndarray]) -> float:
            directions = orthonormal_basis(np.stack(columns, axis=1))
            return float(np.sum((directions.T @ residual.whitened) ** 2))

        return reduction(ramps) > reduction(steps)

    def p_value(self, base: Stage) -> float:
        """P(jumps at any times reduce χ² as much), if the base is right."""
        fall = base.solved.cost - self.solved.cost
        return float(np.exp(min(0.0, chi2.logsf(fall, 2 * self.count) + self.searched)))

    @property
    def listed(self) -> str:
        """Sizes and times in words."""
        listed, several = [], len(self.preparation.takes) > 1
        for take, sizes in zip(self.preparation.takes, self.sizes, strict=True):
            recording = take.recording
            for at, size in zip(take.jumps, sizes, strict=True):
                of = f" of {recording.source}" if several else ""
                listed.append(
                    f"{size:+.3g} {recording.response_unit} at {at * recording.dt:.4g} s{of}"
                )
        return f"{'jumps' if len(listed) > 1 else 'a jump'} of the response: {', '.join(listed)}"

    @property
    def sentence(self) -> str:
        """The jumps and the remedy, in words."""
        if self.gradual:
            return (
                f"It is described best by {self.listed}; but these are gradual, as a slow change "
                "or an effect of the drive would make them. Record the same drive again: effects "
                "of the drive come at the same times."
            )
        return (
            f"It looks like {self.listed}. Record the same drive "
            "again, since such jumps come at other times and effects of the drive at the same; or "
            "leave out the affected time (--mask)."
        )


def find_jumps(base: Stage, least: float) -> Jumps | None:
    """The jumps that each lower BIC; None if all of them together gain less than `least` in the
    linear test.

    Large jumps distort the fit of the base so much that the test finds too many: it is repeated at
    the fit that it has led to.
    """
    problems, residual = base.preparation.problems(), residual_of(base.solved)
    places, gained = _places(problems, residual)
    if not places or gained < least:
        return None
    first = _fitted(places, base, base.solved)
    again, _ = _places(problems, _without_jumps(first, base.preparation))
    return _fitted(again, base, first.solved) if again and {*again} != {*places} else first


def hidden_in_noise(base: Stage, k: int) -> tuple[Jumps, Noise] | None:
    """Jumps that the k-th recording's noise floor contains, and the noise without them: if two
    periods differ by a jump, the jump counts as noise.

    They are searched for under white noise with the standard deviation of neighbouring samples'
    differences.  None if they are not more likely than noise of one spectrum, or the noise without
    them is nearly as large: a few steps follow a slow noise too, but reduce it little.
    """
    take, before = base.preparation.takes[k], base.solved.simulations[k]
    recording, floor = take.recording, take.noise
    assert floor is not None  # a diagnosis has one
    size = level_from_differences(np.diff((recording.response - before)[take.used]))
    if not 0 < size < _CLEARLY_LESS * floor.sigma:
        return None
    white = Noise(size, floor.unit, "specification", np.ones(1), size)
    preparation = replace(base.preparation, takes=(replace(take, noise=white),))
    solved = solve_from([base.solved.block], preparation)
    jumps = find_jumps(replace(base, solved=solved), 0.0)
    if jumps is None:
        return None
    whole, without = (
        residual_noise(recording.response - simulation, take.used, recording)
        for simulation in (before, jumps.solved.simulations[0])
    )
    fall = 2 * jumps.solved.samples * np.log(whole.innovation / without.innovation)
    if fall < 2 * jumps.searched + _LIKELIER:
        return None
    return (jumps, without) if without.sigma < _CLEARLY_LESS * floor.sigma else None


def _fitted(places: list[tuple[int, int]], base: Stage, solved: Solved) -> Jumps:
    """The base fitted together with jumps, from its last fit and from its nominal parameters."""
    count = len(base.preparation.takes)
    jumps = [tuple(sorted(at for k, at in places if k == j)) for j in range(count)]
    preparation = base.preparation.with_jumps(jumps)
    return Jumps(solve_from([solved.block, base.nominal], preparation))


def _without_jumps(jumps: Jumps, preparation: Preparation) -> Residual:
    """The residual of the base with the parameters that were fitted together with jumps."""
    places = [(k, at) for k, take in enumerate(jumps.preparation.takes) for at in take.jumps]
    steps = _steps(preparation.problems(), places)
    whitened = np.concatenate(jumps.solved.whitened) + np.concatenate(jumps.sizes) @ steps
    return beside_fit(whitened, jumps.solved.on(preparation))


def _places(problems: tuple[Problem, ...], residual: Residual) -> tuple[list, float]:
    """The recording and sample of each jump, and their gain in BIC."""
    price = 2 * float(np.log(np.count_nonzero(residual.whitened)))
    places: list[tuple[int, int]] = []
    gained = 0.0
    while len(places) < _MOST:
        place, column = _strongest(problems, residual)
        size = float(column @ residual.whitened)
        if size**2 < price:
            break
        places.append(place)
        gained += size**2 - price
        # The fit now absorbs this jump too.
        basis = np.concatenate([residual.basis, column[:, None]], axis=1)
        residual = Residual(residual.whitened - size * column, basis)
    return places, gained


def _strongest(
    problems: tuple[Problem, ...], residual: Residual
) -> tuple[tuple[int, int], np.ndarray]:
    """The place where a step reduces χ² most, and its projected column (ΣL,) of unit length."""
    starts = np.cumsum([0] + [problem.response.shape[0] for problem in problems])
    signals = np.column_stack([residual.whitened, residual.basis])
    pieces = zip(problems, np.split(signals, starts[1:-1]), strict=True)
    of_steps = [_of_steps(problem, piece) for problem, piece in pieces]
    products, squares = (np.concatenate(each) for each in zip(*of_steps, strict=True))
    projected = squares - np.sum(products[:, 1:] ** 2, axis=1)
    visible = projected > _LEAST_SEEN**2 * residual.whitened.size
    visible[starts[:-1]] = False  # a step there is a constant
    strength = np.where(visible, products[:, 0] ** 2 / np.where(visible, projected, 1.0), 0.0)
    strongest = int(np.argmax(strength))
    k = int(np.searchsorted(starts, strongest, "right")) - 1
    place = (k, strongest - int(starts[k]))
    column = residual.project(_steps(problems, [place]))[0]
    return place, column / max(float(np.linalg.norm(column)), 1e-300)


def _of_steps(problem: Problem, signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Inner products (L, K) of whitened steps, one from each sample on, with whitened signals
    (L, K), and the steps' squares (L,).

    A step from a on, whitened with weights w and the filter's step response c, is w_t c_{t-a}:
    both are sums over what follows a, and all of them one cumulative sum.
    """
    weights, taps = np.asarray(problem.weights), np.asarray(problem.whitening)
    back = lfilter(taps, 1.0, (signals.T * weights)[:, ::-1])
    response = np.cumsum(taps)
    settled, rising = response[-1] ** 2, response**2 - response[-1] ** 2
    squares = lfilter(rising, 1.0, weights[::-1] ** 2) + settled * np.cumsum(weights[::-1] ** 2)
    return np.cumsum(back, axis=1)[:, ::-1].T, squares[::-1]


def _steps(
    problems: tuple[Problem, ...], places: list[tuple[int, int]], half: int = 0
) -> np.ndarray:
    """Whitened steps (K, ΣL), each from its sample of its recording on; or ramps instead, that
    extend by `half` samples on either side."""
    pieces = []
    for k, problem in enumerate(problems):
        samples = np.arange(problem.response.shape[0])[:, None]
        starts = np.array([at if j == k else np.inf for j, at in places])
        steps = np.clip((samples - starts + half + 1) / (2 * half + 1), 0, 1)
        pieces.append(np.asarray(problem.whiten(steps)))
    return np.concatenate(pieces).T
