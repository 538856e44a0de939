r"""Linear filters of few poles between the path and the response, of any size and exact.

A filter answers z to a signal x by A z = B x, two banded matrices: the response of a lag, of a mode
or of several in series.  Before its first sample a signal is constant, or it is of steady cycles;
between samples it is a parabola, through what a path is halfway or of the mean second difference.

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


def highest_of(step: float) -> float:
    """The highest frequency [Hz] of a mode that recordings of a step [s] show."""
    return 0.5 * _HIGHEST / step


def filters_of(effect: str, shape: Shape, step: float) -> list[Recursion]:
    """The departures of an effect of a shape, in series."""
    if effect == "sensor_lag":
        order = int(shape["order"])
        constant = time_constant_of(shape["corner"], order)
        # Of what is slow the equations of fourth order have no digits left.
        parts = 2 if order > _STEEPEST and constant > _SLOW * step else 1
        return [kernels.lag(constant, step, order // parts)] * parts
    first = kernels.mode(shape["frequency"], shape["damping"], step)
    if effect == "resonance":
        return [first]
    other = kernels.mode(shape["frequency"] * shape["ratio"], shape["second_damping"], step)
    return [kernels.shared(first, other, shape["participation"])]


_HIGHEST = 0.9
"""The highest frequency of a mode, over Nyquist's."""
_STEEPEST = 2
"""The order of a filter whose equations have digits left at any slowness."""
_SLOW = 3.0
"""The time constant, in steps, from which what a lag leaves is smooth between samples."""


class Section(NamedTuple):
    """One filter A z = B x of some recordings: A (ΣN, ΣN), B (ΣN, ΣN), or (ΣN, 2 ΣN) where x is
    known halfway too, and the sum of A's taps (ΣN,)."""

    after: sp.csc_array
    before: sp.csr_array
    gain: np.ndarray


class Filter:
    """Filters in series after the path of some recordings of `sizes` samples.

    What they filter is known at each sample and halfway before it, since a path is one function of
    its drive between corners: (2 ΣN, …), all samples first.

    Attributes:
        sections: the first is the path's.
    """

    def __init__(
        self,
        sizes: Sequence[int],
        departures: Sequence[Sequence[Recursion]],
        periodic: Sequence[bool],
    ):
        self._sizes, self._periodic = sizes, periodic
        self.sections = [
            _section(sizes, own, periodic, halfway=k == 0)
            for k, own in enumerate(zip(*departures, strict=True))
        ]

    def nodes(self, drive: np.ndarray) -> np.ndarray:
        """A drive (ΣN,) of all recordings, and what it is halfway before each sample: (2 ΣN,)."""
        parts = np.split(drive, np.cumsum(self._sizes)[:-1])
        between = [
            kernels.halfway(part, periodic=periodic)
            for part, periodic in zip(parts, self._periodic, strict=True)
        ]
        return np.concatenate([drive, *between])

    @cached_property
    def _factors(self) -> list[Any]:
        return [
            splu(one.after, permc_spec="NATURAL", diag_pivot_thresh=0.0) for one in self.sections
        ]

    def __call__(self, signals: np.ndarray) -> np.ndarray:
        """The responses (ΣN, …) to signals (2 ΣN, …)."""
        for one, factor in zip(self.sections, self._factors, strict=True):
            signals = factor.solve(np.asarray(one.before @ signals))
        return signals

    @cached_property
    def log_determinant(self) -> float:
        """The logarithm of all |A|: 0 but for steady cycles."""
        return float(sum(np.log(np.abs(f.U.diagonal())).sum() for f in self._factors))


def _section(
    sizes: Sequence[int],
    departures: Sequence[Recursion],
    periodic: Sequence[bool],
    *,
    halfway: bool,
) -> Section:
    """One filter of all recordings."""
    parts = [
        _matrices(*own, halfway=halfway) for own in zip(sizes, departures, periodic, strict=True)
    ]
    after, before, between = (sp.block_diag(of) for of in zip(*parts, strict=True))
    return Section(
        sp.csc_array(after),
        sp.csr_array(sp.hstack([before, between]) if halfway else before),
        np.concatenate(
            [np.full(n, d.denominator.sum()) for n, d in zip(sizes, departures, strict=True)]
        ),
    )


def _matrices(
    size: int, departure: Recursion, periodic: bool, *, halfway: bool
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """A of one recording, B of its samples, and B of what is halfway before them."""
    samples = np.arange(size)

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
    # Halfway a signal is the mean of both ends less an eighth of its bend.
    bends = (
        banded(np.array([4.0, 4.0]))
        if halfway
        else banded(np.array([0.5, -0.5, -0.5, 0.5]), ahead=1)
    )
    # At rest before the first sample the response is the path's.
    after = own(denominator)
    before = after + own(straight) @ steps + own(bent) @ bends
    return after, sp.csr_array(before), sp.csr_array(-8.0 * own(bent))
