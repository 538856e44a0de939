r"""Jumps of the response that nothing in the drive calls for: a description without a law.

A mount that slips, a domain that switches, a counter that loses a fringe, a reading that is held:

    y + Σ_i a_i 1[t ≥ t_i]

found one after the other by the projected score test, with a step at every sample for a column,
then fitted together with the base.  Each costs two numbers in BIC.  Effects of the catalogue that
leave more than that have only followed them.  What is back after a few samples is no jump but a
tail of the noise, and says nothing for or against an effect.
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
_LEAST_SEEN = 1e-6
_BRIEF, _BACK = 5, 0.5
_LIKELIER, _CLEARLY_LESS = 10.0, 0.85


@dataclass(frozen=True)
class Jumps:
    """The base fitted together with jumps at the samples that its preparation says."""

    solved: Solved

    @property
    def preparation(self) -> Preparation:
        return self.solved.preparation

    @property
    def count(self) -> int:
        """Of all recordings together."""
        return sum(len(take.jumps) for take in self.preparation.takes)

    @property
    def searched(self) -> float:
        """What the times cost in BIC, which are numbers too and not among those of the fit."""
        return self.count * float(np.log(self.solved.samples))

    @property
    def sizes(self) -> list[np.ndarray]:
        """Of each recording's jumps, in the response's unit."""
        takes = zip(self.preparation.takes, self.solved.own, strict=True)
        return [own[own.size - len(take.jumps) :] for take, own in takes]

    def ahead_of(self, other: Solved) -> float:
        """What jumps that last gain in BIC over another fit, where the noise is not in its tails;
        -inf where none lasts."""
        if 2 * sum(len(self._brief(k)) for k in range(len(self.sizes))) == self.count:
            return -np.inf
        cost, numbers = 0.0, self.solved.free - other.free + self.count
        pairs = zip(self.solved.whitened, other.whitened, strict=True)
        for k, (own, others) in enumerate(pairs):
            counted = np.ones(own.size, dtype=bool)
            for brief in self._brief(k):
                counted[brief] = False
                numbers -= 4
            cost += float(np.sum((others**2 - own**2)[counted]))
        return cost / self.solved.excess_ratio - numbers * float(np.log(self.solved.samples))

    def _brief(self, k: int) -> list[slice]:
        """Where a jump of the k-th recording is back after a few samples, with what whitening makes
        of it."""
        take = self.preparation.takes[k]
        assert take.noise is not None  # a diagnosis has one
        steps = sorted(zip(take.jumps, self.sizes[k], strict=True))
        found = []
        while len(steps) > 1:
            (at, size), (then, back), *_ = steps
            returns = abs(size + back) < _BACK * max(abs(size), abs(back))
            if then - at <= _BRIEF and returns:
                found.append(slice(at, then + take.noise.whitening.size))
            steps = steps[2 if then - at <= _BRIEF and returns else 1 :]
        return found

    @property
    def gradual(self) -> bool:
        """Whether ramps in their places take more than they do, each so long that a true jump would
        be told from it, or as long as its neighbours leave room for."""
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

        def taken(columns: list[np.ndarray]) -> float:
            directions = orthonormal_basis(np.stack(columns, axis=1))
            return float(np.sum((directions.T @ residual.whitened) ** 2))

        return taken(ramps) > taken(steps)

    def p_value(self, base: Stage) -> float:
        """P(jumps that gain so much in χ²) where the base is right, wherever they may be."""
        fall = base.solved.cost - self.solved.cost
        return float(np.exp(min(0.0, chi2.logsf(fall, 2 * self.count) + self.searched)))

    @property
    def listed(self) -> str:
        """Sizes and times in words."""
        told, several = [], len(self.preparation.takes) > 1
        for take, sizes in zip(self.preparation.takes, self.sizes, strict=True):
            recording = take.recording
            for at, size in zip(take.jumps, sizes, strict=True):
                of = f" of {recording.source}" if several else ""
                told.append(
                    f"{size:+.3g} {recording.response_unit} at {at * recording.dt:.4g} s{of}"
                )
        return f"{'jumps' if len(told) > 1 else 'a jump'} of the response: {', '.join(told)}"

    @property
    def sentence(self) -> str:
        """What they are, and what to do."""
        if self.gradual:
            return (
                f"It is followed best by {self.listed}; yet these come gradually, as what is slow "
                "or a law of the drive would make them. Record the same drive again: what that "
                "causes comes at the same times."
            )
        return (
            f"It looks like {self.listed}. Record the same drive "
            "again, for such jumps come at other times and what the drive causes at the same; or "
            "leave out the time that they spoil (--mask)."
        )


def find_jumps(base: Stage, least: float) -> Jumps | None:
    """As many jumps as each lower BIC; None where all of them together gain less than `least` in
    the linear test.

    Large ones have led the base so far astray that the test finds more than there are: it is taken
    again about the fit that it led to.
    """
    problems, residual = base.preparation.problems(), residual_of(base.solved)
    places, gained = _places(problems, residual)
    if not places or gained < least:
        return None
    first = _fitted(places, base, base.solved)
    again, _ = _places(problems, _without_jumps(first, base.preparation))
    return _fitted(again, base, first.solved) if again and {*again} != {*places} else first


def hidden_in_noise(base: Stage, k: int) -> tuple[Jumps, Noise] | None:
    """Jumps that the k-th recording's noise floor holds, and the noise beside them: where two
    periods differ by a jump, what does not repeat is as large as that.

    They are sought beside white noise of the size by which neighbouring samples differ.  None where
    they are not likelier than noise of one colour, or leave it nearly as large: steps here and
    there follow a slow noise too, but take little from it.
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
    whole, beside = (
        residual_noise(recording.response - simulation, take.used, recording)
        for simulation in (before, jumps.solved.simulations[0])
    )
    fall = 2 * jumps.solved.samples * np.log(whole.innovation / beside.innovation)
    if fall < 2 * jumps.searched + _LIKELIER:
        return None
    return (jumps, beside) if beside.sigma < _CLEARLY_LESS * floor.sigma else None


def _fitted(places: list[tuple[int, int]], base: Stage, solved: Solved) -> Jumps:
    """The base fitted together with jumps, from where it was and from its nominal point."""
    count = len(base.preparation.takes)
    jumps = [tuple(sorted(at for k, at in places if k == j)) for j in range(count)]
    preparation = base.preparation.with_jumps(jumps)
    return Jumps(solve_from([solved.block, base.nominal], preparation))


def _without_jumps(found: Jumps, preparation: Preparation) -> Residual:
    """What the base would leave at the orders that the fit with jumps found."""
    places = [(k, at) for k, take in enumerate(found.preparation.takes) for at in take.jumps]
    steps = _steps(preparation.problems(), places)
    left = np.concatenate(found.solved.whitened) + np.concatenate(found.sizes) @ steps
    return beside_fit(left, found.solved.on(preparation))


def _places(problems: tuple[Problem, ...], residual: Residual) -> tuple[list, float]:
    """The recording and sample of each jump, and what they gain in BIC."""
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
        # A jump that was found is one thing more that the fit absorbs.
        basis = np.concatenate([residual.basis, column[:, None]], axis=1)
        residual = Residual(residual.whitened - size * column, basis)
    return places, gained


def _strongest(
    problems: tuple[Problem, ...], residual: Residual
) -> tuple[tuple[int, int], np.ndarray]:
    """Where a step would take the most, and its column (ΣL,) of unit length beside the fit."""
    starts = np.cumsum([0] + [problem.response.shape[0] for problem in problems])
    signals = np.column_stack([residual.whitened, residual.basis])
    pieces = zip(problems, np.split(signals, starts[1:-1]), strict=True)
    of_steps = [_of_steps(problem, piece) for problem, piece in pieces]
    products, squares = (np.concatenate(each) for each in zip(*of_steps, strict=True))
    beside = squares - np.sum(products[:, 1:] ** 2, axis=1)
    seen = beside > _LEAST_SEEN**2 * residual.whitened.size
    seen[starts[:-1]] = False  # a step there is a constant
    strength = np.where(seen, products[:, 0] ** 2 / np.where(seen, beside, 1.0), 0.0)
    found = int(np.argmax(strength))
    k = int(np.searchsorted(starts, found, "right")) - 1
    place = (k, found - int(starts[k]))
    column = residual.project(_steps(problems, [place]))[0]
    return place, column / max(float(np.linalg.norm(column)), 1e-300)


def _of_steps(problem: Problem, signals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the whitened steps from each sample on: inner products (L, K) with whitened signals
    (L, K), and squares (L,).

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
    """Whitened steps (K, ΣL), each from its sample of its recording on; or ramps in their places,
    `half` samples longer at either end."""
    pieces = []
    for k, problem in enumerate(problems):
        samples = np.arange(problem.response.shape[0])[:, None]
        starts = np.array([at if j == k else np.inf for j, at in places])
        steps = np.clip((samples - starts + half + 1) / (2 * half + 1), 0, 1)
        pieces.append(np.asarray(problem.whiten(steps)))
    return np.concatenate(pieces).T
