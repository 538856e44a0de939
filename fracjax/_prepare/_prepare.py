"""Recordings prepared for a fit according to the options of a call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Unpack

from .._blocks import AbstractBlock
from .._models import Model
from .._recording import InputError, Recording, require_units_of
from ._border import history_of, settling_of, sigma_of
from ._conditions import PLAIN, Conditions
from ._keywords import ParameterOptions, apply_options
from ._noise import Noise
from ._noise_sources import measured_noises
from ._preparation import Preparation, coarse_oversampling
from ._take import HistoryOption, take_of
from ._weights import Mask, Weights, weights_of


def prepare(
    recordings: Sequence[Recording],
    *,
    noise: Noise | None = None,
    repeats: Sequence[Recording] = (),
    specification: float | str | None = None,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    weights: Weights = None,
    mask: Mask = (),
    conditions: Conditions = PLAIN,
) -> Preparation:
    """Decide noise, history, settling and grid of recordings that are fitted together.

    Raises InputError where an argument does not fit.
    """
    if not recordings:
        raise InputError("expected at least one recording, found none; give one")
    for other in recordings[1:]:
        require_units_of(recordings[0], other)
    history_of(history)
    sigma = sigma_of(specification, recordings[0].response_unit)
    counts = weights_of(recordings, weights, mask)
    noises = [noise] * len(recordings)
    if noise is None:
        noises = measured_noises(recordings, repeats, sigma, counts)
    takes = tuple(
        take_of(recording, its_noise, history, settling_of(settling, recording), its_counts)
        for recording, its_noise, its_counts in zip(recordings, noises, counts, strict=True)
    )
    return Preparation(takes, coarse_oversampling(list(recordings)), conditions)


def prepare_fit(
    model: Model,
    recordings: Sequence[Recording],
    *,
    noise: Noise | float | str | None = None,
    history: HistoryOption | None = None,
    settling: int | str | None = None,
    weights: Weights = None,
    mask: Mask = (),
    **options: Unpack[ParameterOptions],
) -> tuple[AbstractBlock, Preparation]:
    """The block and the recordings, prepared according to the options of a call.

    Raises InputError where an option does not fit.
    """
    block, conditions = apply_options(model, **options)
    return block, prepare(
        recordings,
        noise=noise if isinstance(noise, Noise) else None,
        specification=None if isinstance(noise, Noise) else noise,
        history=history,
        settling=settling,
        weights=weights,
        mask=mask,
        conditions=conditions,
    )
