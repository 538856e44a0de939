"""Reasons for doubt in a diagnosis: recording, noise floor, numerics and unusual parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._prepare import Noise
from .._solve import discretisation_warnings
from ._stage import Stage


def warnings_of(
    base: Stage,
    stage: Stage,
    noise: Noise,
    numerics: float,
    hidden: Sequence[tuple[str, str]],
) -> tuple[str, ...]:
    """Every warning; `hidden`: jumps that count as noise, by the recording's name, in words."""
    warnings = [
        warning
        for take in base.preparation.takes
        for warning in (*take.recording.warnings, *take.recording.checks())
    ]
    if noise.method == "residual":
        warnings.append(
            "The noise floor was estimated from the residual itself, since there are no repeats, "
            "rests or specification: a mismatch that looks like noise cannot be excluded."
        )
    warnings += discretisation_warnings(numerics)
    if not base.solved.converged:
        warnings.append("The base fit did not converge; its figures are those of its best point.")
    warnings += [f"{source}: {words}" for source, words in hidden]
    return (*warnings, *_tones(stage), *_displaced(base))


def _tones(stage: Stage) -> list[str]:
    """Tones other than the mains', which count as noise, since no drive causes them."""
    if "mains_interference" in stage.adopted:
        return []
    sentences = []
    for take in stage.preparation.takes:
        tone, recording = take.noise and take.noise.tone, take.recording
        if tone:
            sentences.append(
                f"{recording.source}: the noise floor contains a tone near "
                f"{tone.frequency * recording.rate:.4g} Hz of about {tone.rms:.2g} "
                f"{recording.response_unit} rms, such as interference or a vibration. It "
                "counts as noise and hides smaller effects; remove its cause and record again."
            )
    return sentences


def _displaced(base: Stage) -> list[str]:
    """Base parameters outside their usual range, which may absorb a missing effect."""
    sentences = []
    for name, p in base.displaced.items():
        low, high = p.plausible
        ends = f"{float(np.min(low)):.3g} to {float(np.max(high)):.3g}"
        sentences.append(
            f"{name} of {base.base} was fitted as {float(np.ravel(p.value)[0]):.3g}, "
            f"outside its usual range of {ends}: it may compensate for physics that the "
            "model lacks."
        )
    return sentences
