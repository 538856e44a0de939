"""Rate-independent laws that are not the product's, and drives."""

import numpy as np

from fracjax._path import Signal


def relays(seed: int, low: float, high: float, count: int = 400):
    """A random Preisach plane: thresholds up and down (M,), and weights (M,)."""
    rng = np.random.default_rng(seed)
    pairs = np.sort(rng.uniform(low, high, (count, 2)), axis=1)
    return pairs[:, 1], pairs[:, 0], rng.standard_normal(count)


def preisach(drive: np.ndarray, plane) -> np.ndarray:
    """The response (N,) of a Preisach plane to a drive (N,), which came from saturation in the
    direction of its first motion."""
    up, down, weights = plane
    moving = np.flatnonzero(np.diff(drive))
    rises = bool(moving.size) and drive[moving[0] + 1] > drive[0]
    state = np.where(drive[0] >= up, 1.0, np.where(drive[0] <= down, -1.0, -1.0 if rises else 1.0))
    response = np.empty(drive.size)
    for k, value in enumerate(drive):
        state[up <= value] = 1.0
        state[down >= value] = -1.0
        response[k] = weights @ state
    return response


def plays(drive: np.ndarray) -> np.ndarray:
    """A generalised sum of plays (N,) of curved envelope, over the drive's span."""
    scaled = (drive - drive.min()) / np.ptp(drive)
    response = scaled + 0.2 * scaled**2
    for width in (0.05, 0.12, 0.25):
        state, values = scaled[0], np.empty(drive.size)
        for k, value in enumerate(scaled):
            state = min(max(state, value - width), value + width)
            values[k] = state
        response = response + 0.2 * np.tanh(1.5 * values)
    return response / np.ptp(response)


def through(levels, counts) -> np.ndarray:
    """A drive of straight pieces through levels, the k-th of `counts[k]` samples."""
    pieces = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(levels[:-1], levels[1:], counts, strict=True)
    ]
    return np.concatenate([*pieces, levels[-1:]])


def twin_rates() -> np.ndarray:
    """A path between 0 and 1 that is met at two rates, each twice, with rests: 2,560 samples."""
    path = [0.0, 1.0, 0.2, 0.8, 0.2, 1.0, 0.0]
    levels, counts = [0.0], []
    for pieces in (40, 160, 40, 160):
        for level in path[1:]:
            levels += [level]
            counts += [pieces]
        levels += [levels[-1]]
        counts += [40]
    rounded = np.convolve(np.pad(through(levels, counts), 4, mode="edge"), np.ones(9) / 9, "valid")
    return rounded


def signal_of(
    drive: np.ndarray, response: np.ndarray, noise: float, *, step: float = 1e-3, seed: int = 0
) -> Signal:
    """A recording of a response under white noise."""
    own = noise * np.random.default_rng(seed).standard_normal(drive.size)
    return Signal(
        drive=drive,
        response=response + own,
        step=step,
        periodic=False,
        taps=np.array([1 / noise]),
        weights=np.ones(drive.size),
        drive_error=np.zeros(drive.size),
    )
