"""How fast a signal moves, at a cost that grows no faster than its length."""

from functools import lru_cache

import numpy as np
from scipy.fft import prev_fast_len

_PIECE = 2**20
"""Samples that are transformed at once: of longer signals the transform no longer fits a
processor's cache, and takes four times as long per sample.  Chosen by measurement."""
_SLOW = 100
"""Lines of a piece below which a signal is slow: block means lose nothing of it.  Chosen by
judgement; the means of a signal of 10^8 samples still have fifty per period."""
_SHARE = 0.99


@lru_cache(maxsize=4)
def hann(size: int) -> np.ndarray:
    """Hann's window (size,), kept because recordings alike share it."""
    return np.hanning(size)


def thinned(signal: np.ndarray) -> np.ndarray:
    """A long signal (N,) that is slow as block means, of at most 2^20; any other as it is."""
    width = -(-len(signal) // _PIECE)
    if width == 1 or _line_in_pieces(signal) > _SLOW:
        return signal
    return signal[: len(signal) // width * width].reshape(-1, width).mean(axis=1)


def fastest(signal: np.ndarray) -> float:
    """The frequency [cycles per sample] below which 99 % of the power of a signal (N,) lies, at
    least one cycle in the whole of it."""
    if len(signal) > _PIECE and (line := _line_in_pieces(signal)) > _SLOW:
        return line / _PIECE
    means = thinned(signal)
    width = len(signal) // len(means)
    # Of a length that transforms fast.
    part = means[: prev_fast_len(len(means))]
    return max(1, _line(_power(part))) / (len(part) * width)


def _line_in_pieces(signal: np.ndarray) -> int:
    """That line of the mean spectrum of all pieces (Welch's method), of _PIECE samples each."""
    pieces = signal[: len(signal) // _PIECE * _PIECE].reshape(-1, _PIECE)
    centre = signal.mean()
    return _line(np.sum([_power(piece, centre) for piece in pieces], axis=0))


def _line(power: np.ndarray) -> int:
    """The line below which 99 % of a power spectrum lies."""
    total = np.cumsum(power)
    return int(np.searchsorted(total, _SHARE * total[-1]))


def _power(signal: np.ndarray, centre: float | None = None) -> np.ndarray:
    transform = np.fft.rfft(
        (signal - (signal.mean() if centre is None else centre)) * hann(len(signal))
    )
    return transform.real**2 + transform.imag**2
