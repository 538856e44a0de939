"""Times in even steps, exactly or within the digits that they are written with."""

import numpy as np

UNIFORM = 1e-3
"""Largest departure of a step from the median step, and of a rate from the time column's."""


def is_time(times: np.ndarray) -> bool:
    """Whether numbers, shape (N,), increase in uniform steps, but for their rounding."""
    steps = np.diff(times)
    if not np.isfinite(times).all():
        return False
    return len(steps) > 0 and bool(
        are_even(steps) or ((steps > 0).all() and slope_of(times) is not None)
    )


def filled(times: np.ndarray) -> np.ndarray:
    """Times without the empty cells at their end, in which a shorter channel's column ends."""
    valid = np.flatnonzero(~np.isnan(times))
    return times[: int(valid[-1]) + 1] if valid.size else times[:0]


def is_counter(counts: np.ndarray) -> bool:
    """Whether numbers, shape (N,), count 0, 1, 2 or 1, 2, 3."""
    return (
        len(counts) > 1
        and bool(np.isfinite(counts).all())
        and counts[0] in (0, 1)
        and bool((np.diff(counts) == 1).all())
    )


def are_even(steps: np.ndarray) -> bool:
    """Whether all steps, shape (N - 1,), are positive and agree with their median."""
    least = steps.min()
    # The median, which takes longer to find, is between the least and the largest.
    alike = least > 0 and steps.max() - least <= UNIFORM * least
    return bool(alike or even(steps).all())


def even(steps: np.ndarray) -> np.ndarray:
    """Which of the steps, shape (N - 1,), are positive and agree with their median."""
    usual = np.median(steps)
    return (steps > 0) & (np.abs(steps - usual) <= UNIFORM * usual)


def slope_of(times: np.ndarray) -> float | None:
    """The slope of a straight line that passes all stamps, shape (N,), within their rounding.

    None where there is none, or the stamps go back. What a line leaves over beyond the rounding
    is convex in its slope, so that the sign of its derivative halves the interval: the line must
    rise more where the stamp furthest above it comes later than the one furthest below. The search
    begins with least squares.
    """
    if (np.diff(times) < 0).any() or times[0] == times[-1]:
        return None
    half = rounding(times)
    centred = np.arange(len(times)) - (len(times) - 1) / 2
    slope = float(centred @ times / (centred @ centred))
    reach = 4 * float(half.max()) / len(times)
    low, high = slope - reach, slope + reach
    for _ in range(40):
        excess, above, below = beyond(times, slope, half)
        if excess <= 0:
            return slope if slope > 0 else None
        low, high = (slope, high) if above > below else (low, slope)
        slope = (low + high) / 2
    return None


def beyond(times: np.ndarray, slope: float, half: np.ndarray) -> tuple[float, int, int]:
    """How far the best line of a slope misses the stamps beyond their rounding, each shape (N,).

    Not above 0 where it passes them all; with the stamps furthest above and below it.
    """
    rest = times - slope * np.arange(len(times))
    above, below = int((rest - half).argmax()), int((rest + half).argmin())
    return float(rest[above] - half[above] - rest[below] - half[below]), above, below


def rounding(times: np.ndarray) -> np.ndarray:
    """Half a unit of the last digit each stamp was written to, and a hundredth of it, shape (N,).

    Of decimals it is that of a fixed number of places or of significant digits, whichever the
    stamps show; of numbers that float32 holds exactly, half its spacing; at least a unit of
    float64.
    """
    places = np.full(len(times), 17)
    for number in range(15, -1, -1):
        places[np.round(times, number) == times] = number
    with np.errstate(divide="ignore", over="ignore"):
        leading = np.floor(np.log10(np.abs(times)))
        digits = np.maximum(10.0 ** -places.max(), 10.0 ** (leading - (leading + places).max()))
        single = times.astype(np.float32)
    half = np.maximum(digits / 2, np.spacing(np.abs(times)))
    if (np.abs(single - times) <= half).all():
        half = np.maximum(half, np.spacing(np.abs(single)).astype(np.float64) / 2)
    return 1.01 * half
