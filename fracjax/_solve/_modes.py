"""Starts of a model's modes, from the frequency response that the recordings show.

The peak of a mode is as narrow as its damping, far narrower than the range of frequencies that a
model admits: a start drawn at random is beside it, where nothing leads to it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from scipy.fft import next_fast_len
from scipy.ndimage import uniform_filter1d

from .._blocks import AbstractBlock
from .._parameters import named_parameters, set_values
from .._prepare import Preparation, layout_of
from .._recording import Recording, hann

_FREQUENCY = re.compile(r"(?:.*\.)?frequenc(?:y|ies)")
_LINES = 5
"""Lines of the spectra that are averaged: with fewer, noise has peaks of its own, with more, a
narrow peak is lost.  Chosen by judgement."""
_DRIVEN = 1e-10
"""Least power that counts as the drive's at a line, as a share of the largest.  Chosen by
judgement."""
_STARTS = 2
"""Starts of each model from the measured peaks, of the strongest and the next.  Chosen by
judgement."""


def measured_starts(block: AbstractBlock, preparation: Preparation) -> list[AbstractBlock]:
    """The block with its modes at the strongest peaks of the measured frequency response; none
    where it has no free mode, or there are no peaks."""
    modes = _modes_of(block)
    if not modes:
        return []
    takes = (take.recording for take in preparation.takes)
    recording = max(takes, key=lambda each: (np.ptp(each.drive) > 0, len(each)))
    frequencies, dampings = measured_modes(recording)
    starts = []
    for skipped in range(min(_STARTS, len(frequencies))):
        values, at = {}, skipped
        for frequency, damping in modes.items():
            parameters = named_parameters(block)
            size = int(np.size(parameters[frequency].value))
            taken = np.sort(np.arange(at, at + size) % len(frequencies))
            at += size
            for name, measured in ((frequency, frequencies), (damping, dampings)):
                parameter = parameters[name]
                value = np.reshape(measured[taken], np.shape(parameter.value))
                values[name] = np.clip(value, parameter.lower, parameter.upper)
        starts.append(set_values(block, values))
    return starts


def measured_modes(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and damping ratios (n,) of the peaks of the response to the drive that are
    twice as high as what is around them, those with most of the response's power first.

    With S the power averaged over five lines, the response to the drive is √(S_yy/S_uu): a mode
    that rings longer than the recording lasts answers to no line of the drive coherently.  The
    damping is half the peak's width at 1/√2 of its height over its frequency.
    """
    from scipy.signal import find_peaks  # takes long to import, and most models have no mode

    window = hann(len(recording))
    size = int(next_fast_len(len(recording), real=True))  # type: ignore[arg-type]
    drive, response = (
        uniform_filter1d(
            np.abs(np.fft.rfft((signal - signal.mean()) * window, size)) ** 2,
            _LINES,
            mode="nearest",
        )
        for signal in (recording.drive, recording.response)
    )
    ratio = np.sqrt(response / np.maximum(drive, _DRIVEN * drive.max()))
    level = np.log(np.maximum(ratio, np.finfo(float).tiny))
    peaks = find_peaks(level, prominence=np.log(2.0))[0]
    peaks = peaks[np.argsort(-response[peaks], kind="stable")]
    step = recording.rate / size
    return peaks * step, np.array([_width(ratio, at) / (2 * at) for at in peaks])


def _width(ratio: np.ndarray, peak: int) -> float:
    """The lines over which a peak is above 1/√2 of its height."""
    low = ratio < ratio[peak] / np.sqrt(2)
    before, behind = np.flatnonzero(low[:peak]), np.flatnonzero(low[peak:])
    start = before[-1] + 1 if before.size else 0
    stop = peak + behind[0] if behind.size else len(ratio)
    return float(stop - start)


def _modes_of(block: AbstractBlock) -> Mapping[str, str]:
    """The free frequencies of modes in the block, each with its damping, which is free too."""
    free = dict(layout_of(block).shapes)
    pairs = {
        name: name.replace("frequency", "damping").replace("frequencies", "dampings")
        for name in free
        if _FREQUENCY.fullmatch(name)
    }
    return {frequency: damping for frequency, damping in pairs.items() if damping in free}
