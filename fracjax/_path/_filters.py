r"""Linear filters of few poles between the path and the response, of any size and exact.

A filter answers z to a signal x by A z = B x, two banded matrices: the response of a lag, of a mode
or of several in series.  Before its first sample a signal is constant, or it is of steady cycles.

Source: Franklin, Powell & Workman, Digital Control of Dynamic Systems (1998), chapter 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from . import _kernels as kernels
from ._kernels import Recursion

Shape = dict[str, float]
RESPONSE_SIDE = ("sensor_lag", "resonance", "second_mode")
"""The effects that are such filters."""


def time_constant_of(corner: float, order: float) -> float:
    """The time constant [s] of each of `order` lags of first order that together have a corner
    [Hz]."""
    return float(np.sqrt(2 ** (1 / order) - 1) / (2 * np.pi * corner))


def corner_of(time_constant: float, order: float) -> float:
    """The corner [Hz] of `order` lags of first order of a time constant [s]."""
    return time_constant_of(time_constant, order)


def filters_of(effect: str, shape: Shape, step: float) -> list[Recursion]:
    """The departures of an effect of a shape, in series."""
    if effect == "sensor_lag":
        order = int(shape["order"])
        return [kernels.lag(time_constant_of(shape["corner"], order), step, order)]
    first = kernels.mode(shape["frequency"], shape["damping"], step)
    if effect == "resonance":
        return [first]
    other = kernels.mode(shape["frequency"] * shape["ratio"], shape["second_damping"], step)
    return [kernels.shared(first, other, shape["participation"])]


class Section(NamedTuple):
    """One filter A z = B x of some recordings: A (ΣN, ΣN), B (ΣN, ΣN), and the sum of B's taps
    (ΣN,)."""

    after: sp.csc_array
    before: sp.csr_array
    gain: np.ndarray


class Filter:
    """Filters in series after the path of some recordings.

    `smooth` (N,) is of each recording the share of its bends that counts.

    Attributes:
        sections: the first is the path's.
    """

    def __init__(
        self,
        smooth: Sequence[np.ndarray],
        departures: Sequence[Sequence[Recursion]],
        periodic: Sequence[bool],
    ):
        # What a first filter leaves is smooth.
        after = [np.ones_like(s) for s in smooth]
        self.sections = [
            _section(after if k else smooth, own, periodic)
            for k, own in enumerate(zip(*departures, strict=True))
        ]

    @cached_property
    def _factors(self) -> list[Any]:
        return [
            splu(one.after, permc_spec="NATURAL", diag_pivot_thresh=0.0) for one in self.sections
        ]

    def __call__(self, signals: np.ndarray) -> np.ndarray:
        """The responses (ΣN, …) to signals (ΣN, …)."""
        for one, factor in zip(self.sections, self._factors, strict=True):
            signals = factor.solve(np.asarray(one.before @ signals))
        return signals

    @cached_property
    def log_determinant(self) -> float:
        """The logarithm of all |A|: 0 but for steady cycles."""
        return float(sum(np.log(np.abs(f.U.diagonal())).sum() for f in self._factors))


def _section(
    smooth: Sequence[np.ndarray], departures: Sequence[Recursion], periodic: Sequence[bool]
) -> Section:
    """One filter of all recordings."""
    parts = [_matrices(*own) for own in zip(smooth, departures, periodic, strict=True)]
    return Section(
        sp.csc_array(sp.block_diag([after for after, _ in parts])),
        sp.csr_array(sp.block_diag([before for _, before in parts])),
        np.concatenate(
            [np.full(s.size, d.denominator.sum()) for s, d in zip(smooth, departures, strict=True)]
        ),
    )


def _matrices(
    smooth: np.ndarray, departure: Recursion, periodic: bool
) -> tuple[sp.csr_array, sp.csr_array]:
    """A and B of one recording."""
    size, samples = smooth.size, np.arange(smooth.size)

    def banded(taps: np.ndarray, ahead: int = 0) -> sp.csr_array:
        """Σ_m taps_m x_(k + ahead - m), of steady cycles or with what is before the first sample
        as the first, and what is after the last as the last."""
        rows = np.tile(samples, taps.size)
        columns = rows - np.repeat(np.arange(taps.size) - ahead, size)
        columns = columns % size if periodic else np.clip(columns, 0, size - 1)
        return sp.csr_array((np.repeat(taps, size), (rows, columns)), shape=(size, size))

    def own(taps: np.ndarray) -> sp.csr_array:
        """The same with nothing before the first sample."""
        if periodic:
            return banded(taps)
        offsets: Any = [-k for k in range(taps.size)]
        return sp.csr_array(sp.diags_array(list(taps), offsets=offsets, shape=(size, size)))

    straight, bent, denominator = departure
    steps = banded(np.array([1.0, -1.0]))
    bends = sp.diags_array(smooth) @ banded(np.array([0.5, -0.5, -0.5, 0.5]), ahead=1)
    # At rest before the first sample the response is the path's.
    after = own(denominator)
    before = after + own(straight) @ steps + own(bent) @ bends
    return after, sp.csr_array(before)
