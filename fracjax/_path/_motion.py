"""A recording's drive and response as effects of dynamics are made from them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.polynomial import Polynomial, chebyshev

from .._filters import solve_recursion
from . import _kernels as kernels
from ._fading import openings_of, path_length

_STATIC = 3
"""Order of the static curve without which a loop's opening is left."""
_WIDTHS = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Half-widths of the plays that may wear, over half the drive's range: without them a Preisach
plane that wears was called a clock's skew in two of 48 recordings of laws that wear."""


class Motion:
    """One recording's drive (N,), of an rms `error`, and the response (N,) without effects; `moved`
    is what it would be for another drive (N,) on the same branches; of steady cycles `periodic`."""

    def __init__(
        self,
        drive: np.ndarray,
        response: np.ndarray,
        moved: Callable[[np.ndarray], np.ndarray],
        step: float,
        *,
        error: float,
        periodic: bool,
    ):
        self.drive, self.response, self.moved = drive, response, moved
        self.step, self.error, self.periodic = step, error, periodic
        self.times = np.arange(drive.size) * step

    def with_response(self, response: np.ndarray) -> Motion:
        """The same drive with another response (N,)."""
        return Motion(
            self.drive, response, self.moved, self.step, error=self.error, periodic=self.periodic
        )

    @cached_property
    def path(self) -> np.ndarray:
        """The path (N,) that the drive has travelled, over its span."""
        return path_length(self.drive, self.error)

    @cached_property
    def of_path(self) -> np.ndarray:
        """Functions (N, K) of the drive's path, at most about 1: curves of the drive, and the
        openings of plays, tilted or not."""
        scaled = self._scaled
        curves = chebyshev.chebvander(scaled, _STATIC)[:, [0, 2, 3]]
        plays = 0.5 * openings_of(scaled, _WIDTHS)
        return np.column_stack([curves, plays, plays * scaled[:, None]])

    @cached_property
    def opening(self) -> np.ndarray:
        """The opening (N,) of the response's loop: what a static curve leaves of it."""
        return self.response - Polynomial.fit(self._scaled, self.response, _STATIC)(self._scaled)

    @property
    def _scaled(self) -> np.ndarray:
        """The drive (N,), from -1 to 1."""
        return 2 * (self.drive - self.drive.min()) / np.ptp(self.drive) - 1

    @cached_property
    def of_response(self) -> kernels.Convolution:
        """The response, ready to be convolved."""
        return kernels.Convolution(self.response, self.step, periodic=self.periodic)

    @cached_property
    def of_drive(self) -> kernels.Convolution:
        """The drive, ready to be convolved."""
        return kernels.Convolution(self.drive, self.step, periodic=self.periodic)

    def warming(self, time_constant: float, losses: float) -> np.ndarray:
        """The temperature (N,) by losses |ẋ|^p |x - x0|^(2-p), mean 1 after a long run."""
        rate = np.abs(np.diff(self.response, prepend=self.response[0])) / self.step
        size = np.abs(self.response - self.response[0])
        power = rate**losses * size ** (2 - losses)
        kept = np.exp(-self.step / time_constant)
        scaled = power / max(power.mean(), 1e-300)
        return solve_recursion(np.array([1, -kept]), (1 - kept) * scaled)
