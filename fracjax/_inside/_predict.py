"""The error of a fitted machine on a recording that no fit has used."""

from __future__ import annotations

import numpy as np

from .._blocks import AbstractBlock
from .._computing import computing
from .._operators import History
from .._parameters import set_values
from .._prepare import Preparation, take_of
from .._recording import Recording
from .._solve import Solved

_STEPS = 6
"""Gauss–Newton steps for the state at the first sample."""


def error_on(
    solved: Solved, recording: Recording, history: History, settling: int, read: int = 0
) -> tuple[float, np.ndarray]:
    """The rms error of a fitted machine on another recording, and its simulation (N,).

    Args:
        solved: the fit, whose offset stays.
        recording: the held-out recording, in the same units.
        history: its drive before the first sample.
        settling: first samples that are not scored.
        read: first samples from which the state at the first one is estimated; 0 where it is as the
            history says.

    Returns:
        The rms [response] over the samples after `settling`, and the simulation [response].
    """
    with computing():
        return _error_on(solved, recording, history, settling, read)


def _error_on(
    solved: Solved, recording: Recording, history: History, settling: int, read: int
) -> tuple[float, np.ndarray]:
    """`error_on` in double precision."""
    take = take_of(recording, None, history, 0)
    (problem,) = Preparation((take,), solved.preparation.oversampling).problems()
    block: AbstractBlock = solved.block
    # Where it is read, from where the fit's own recording began; else as the history says.
    at = (1.0 if read else 0.0) * np.asarray(block.start.value)  # type: ignore[attr-defined]
    count, offset = len(recording), float(solved.own[0][0])

    def simulated(start: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = set_values(block, {"start": start})
        response, derivative = problem.linearised(moved, ["start"])
        return response[:count] + offset, derivative[:count]

    if read:
        for _ in range(_STEPS):
            simulation, derivative = simulated(at)
            error = (recording.response - simulation)[:read]
            at = at + np.linalg.lstsq(derivative[:read], error, rcond=1e-8)[0]
    simulation, _ = simulated(at)
    error = (recording.response - simulation)[settling:]
    return float(np.sqrt(np.mean(error**2))), simulation
