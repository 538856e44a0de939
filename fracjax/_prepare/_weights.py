"""The samples that count: weights of a call, and times to leave out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .._recording import MINIMUM_SAMPLES, InputError, Recording, pair_of

Weights = ArrayLike | Sequence[ArrayLike] | None
Mask = Sequence[tuple[float, float]]


def weights_of(
    recordings: Sequence[Recording], weights: Weights = None, mask: Mask = ()
) -> list[np.ndarray | None]:
    """Weights (N,) per recording, 0 where the mask leaves a sample out; None where all are 1.

    `weights` multiply the squared residuals: an array (N,), or one per recording.  The noise's
    level is that of a sample of weight 1.  Samples that a recording has masked have weight 0.
    `mask` holds times [s] from the first sample, ends included, of every recording.  Raises
    InputError where they do not fit, are negative or leave too few samples.
    """
    per_recording: list[ArrayLike | None] = [None] * len(recordings)
    if weights is not None:
        alone = len(recordings) == 1 and np.ndim(weights[0]) == 0  # type: ignore[index]
        per_recording = [weights] if alone else list(weights)  # type: ignore[arg-type, list-item]
        if len(per_recording) != len(recordings):
            raise InputError.at(
                "weights",
                f"an array for each of {len(recordings)} recordings",
                f"{len(per_recording)}",
                "give one for each",
            )
    result = []
    for recording, one in zip(recordings, per_recording, strict=True):
        if one is None and not mask and recording.masked is None:
            result.append(None)
            continue
        values = np.ones(len(recording)) if one is None else np.array(one, dtype=float)
        if values.shape != (len(recording),) or not np.all((values >= 0) & np.isfinite(values)):
            raise InputError.at(
                f"{recording.source}, weights",
                f"{len(recording)} numbers, none below 0",
                f"shape {values.shape}"
                if values.shape != (len(recording),)
                else "values below 0 or not finite",
                "correct them",
            )
        if recording.masked is not None:
            values[recording.masked] = 0.0
        for times in mask:
            start, stop = pair_of(times, "mask", "pairs of times [s]", "write [(3.0, 4.0), ...]")
            slack = 1e-6 * recording.dt  # allows for the rounding of k·dt
            inside = (recording.times >= start - slack) & (recording.times <= stop + slack)
            if not start <= stop or not inside.any():
                raise InputError.at(
                    f"{recording.source}, mask",
                    f"times within 0 to {recording.times[-1]:.4g} s",
                    f"{start:.4g} to {stop:.4g} s",
                    "correct it",
                )
            values[inside] = 0.0
        if np.count_nonzero(values) < MINIMUM_SAMPLES:
            raise InputError.at(
                f"{recording.source}, weights and mask",
                f"at least {MINIMUM_SAMPLES} samples that count",
                f"{np.count_nonzero(values)}",
                "leave out less",
            )
        result.append(values)
    return result
