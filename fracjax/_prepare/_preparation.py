"""Recordings prepared to be fitted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .._blocks import Setting
from .._recording import Recording
from ._conditions import PLAIN, Conditions
from ._noise import Noise
from ._problem import Problem, make_problem, with_weighting
from ._setting import driven_recordings, setting_of, top_frequency
from ._take import Take


@dataclass(frozen=True)
class Preparation:
    """Recordings prepared to be fitted together, and the conditions on the parameters.

    Attributes:
        takes: the recordings with their assumptions.
        oversampling: steps of the simulation per sample.
        conditions: ties, own parameters and priors.
    """

    takes: tuple[Take, ...]
    oversampling: int
    conditions: Conditions = PLAIN

    @property
    def setting(self) -> Setting:
        """The magnitudes that the recordings suggest: spans, rates, frequencies."""
        return setting_of([take.recording for take in self.takes])

    @property
    def has_unknown_noise(self) -> bool:
        """Whether a recording does not show its noise."""
        return any(take.noise is None for take in self.takes)

    def problems(self, oversampling: int | None = None) -> tuple[Problem, ...]:
        """One problem per recording, on this grid or with another oversampling."""
        if oversampling is None or oversampling == self.oversampling:
            return self._default_problems
        return self._problems_at(oversampling)

    @cached_property
    def _default_problems(self) -> tuple[Problem, ...]:
        """The problems on this grid, made once because every stage of a fit uses them."""
        return self._problems_at(self.oversampling)

    def _problems_at(self, oversampling: int) -> tuple[Problem, ...]:
        """The problems with this many steps per sample."""
        return tuple(
            make_problem(
                take.recording,
                history="constant" if take.history == "estimated" else take.history,
                prior_history=take.history == "estimated",
                oversampling=oversampling,
                used=take.used,
                whitening=take.whitening,
                weights=take.roots,
                jumps=take.jumps,
            )
            for take in self.takes
        )

    def with_noises(self, noises: Sequence[Noise]) -> Preparation:
        """The same with another noise for each recording.

        Its problems differ by their weights and whitening alone, and are made from these.
        """
        other = self._with("noise", noises)
        problems = tuple(
            with_weighting(problem, take.used, take.whitening, take.roots)
            for problem, take in zip(self._default_problems, other.takes, strict=True)
        )
        vars(other)["_default_problems"] = problems
        return other

    def with_trust(self, trust: Sequence[np.ndarray | None]) -> Preparation:
        """The same with another `trust` (N,) for each recording."""
        return self._with("trust", trust)

    def with_jumps(self, jumps: Sequence[tuple[int, ...]]) -> Preparation:
        """The same with other jumps for each recording."""
        return self._with("jumps", jumps)

    def _with(self, field: str, values: Sequence[Any]) -> Preparation:
        """The same with one value per recording for a field of its take."""
        takes = zip(self.takes, values, strict=True)
        return replace(self, takes=tuple(replace(take, **{field: v}) for take, v in takes))

    def with_oversampling(self, oversampling: int) -> Preparation:
        """The same with another number of steps per sample."""
        return replace(self, oversampling=oversampling)


def coarse_oversampling(recordings: list[Recording]) -> int:
    """The oversampling of the first grid: at least 16 samples per period of the fastest drive."""
    samples = min(1 / (top_frequency(r) * r.dt) for r in driven_recordings(recordings))
    return int(np.clip(2 ** np.ceil(np.log2(max(16 / samples, 1))), 1, 8))
