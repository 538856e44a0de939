"""The segments of a table: stretches of one recording each, parted by gaps and restarts."""

from itertools import pairwise

import numpy as np

from fracjax._recording import MINIMUM_SAMPLES

LONGEST_GAP = 10
"""Steps beyond which a gap parts two recordings; `--resample` fills none longer than that."""
_NEAR = 8


def segments_of_times(times: np.ndarray) -> list[slice]:
    """The stretches of times (N,) between restarts and gaps; one where there are none.

    None is parted where a stretch would be too short for a recording: then a stamp is wrong, not
    the recording in parts.
    """
    steps = np.diff(times)
    if not len(steps) or _are_alike(steps) or not np.isfinite(steps).all():
        return [slice(0, len(times))]
    usual = usual_step(steps)
    restarts = [int(at) + 1 for at in np.flatnonzero(steps < -usual)]
    return cut(len(times), sorted({*restarts, *_gaps(steps, usual)}))


def _are_alike(steps: np.ndarray) -> bool:
    """Whether no step goes back and none could be a gap, whatever the usual one is."""
    least = steps.min()
    return least > 0 and steps.max() <= LONGEST_GAP * least


def gaps(times: np.ndarray) -> list[int]:
    """The samples of times (N,) that follow a gap: more than ten times the steps around it."""
    steps = np.diff(times)
    return _gaps(steps, usual_step(steps))


def _gaps(steps: np.ndarray, usual: float) -> list[int]:
    """The samples behind the steps (N - 1,) that are gaps."""
    starts = []
    for at in np.flatnonzero(steps > LONGEST_GAP * usual):
        around = steps[max(at - _NEAR, 0) : at], steps[at + 1 : at + 1 + _NEAR]
        local = max((float(np.median(np.abs(side))) for side in around if side.size), default=0.0)
        if steps[at] > LONGEST_GAP * local:
            starts.append(int(at) + 1)
    return starts


def usual_step(steps: np.ndarray) -> float:
    """The median of the steps (N - 1,) that go ahead."""
    ahead = steps[steps > 0]
    return float(np.median(ahead)) if ahead.size else 0.0


def cut(count: int, places: list[int]) -> list[slice]:
    """The stretches of `count` rows between places; one where a stretch would be too short."""
    edges = [0, *places, count]
    segments = [slice(start, stop) for start, stop in pairwise(edges)]
    if any(part.stop - part.start < MINIMUM_SAMPLES for part in segments):
        return [slice(0, count)]
    return segments


def in_words(lengths: list[float], gaps: list[float | None]) -> str:
    """Segments of these lengths [s] with these gaps [s] between them, in a few words; of a gap of
    None the clock began anew."""
    count = {2: "two", 3: "three", 4: "four", 5: "five", 6: "six"}.get(
        len(lengths), str(len(lengths))
    )
    alike = max(lengths) - min(lengths) < 0.02 * max(lengths)
    long = (
        f"of {lengths[0]:.3g} s"
        if alike
        else "of " + ", ".join(f"{s:.3g}" for s in lengths[:6]) + " s"
    )
    apart = [gap for gap in gaps if gap is not None]
    if not apart:
        return f"{count} segments {long}, between which the clock begins anew"
    wide = (
        f"{apart[0]:.4g}"
        if max(apart) - min(apart) < 0.02 * max(apart)
        else f"{min(apart):.4g} to {max(apart):.4g}"
    )
    return f"{count} segments {long} with gaps of {wide} s between them"
