"""The motion that is wanted, validated once at the border."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._recording import LARGEST, InputError, parse_quantity, unit, varying


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Uniform samples of a desired response.

    **Arguments:** `response`, shape (N,), in `response_unit`; `dt`, the step [s]; `source`, named
    in messages.

    **Raises:** `InputError` unless it is finite, one-dimensional, at least 32 samples long and not
    constant, `dt` is positive and the unit is known.
    """

    response: np.ndarray
    dt: float
    response_unit: str = "um"
    source: str = "trajectory"

    def __post_init__(self):
        unit(self.response_unit, f"{self.source}, response")
        step = parse_quantity(self.dt, "s", f"{self.source}, dt")
        if not 1 / LARGEST < step < LARGEST:
            raise InputError.at(
                f"{self.source}, dt", "a positive step in seconds", f"{step:g}", "correct it"
            )
        object.__setattr__(self, "dt", step)
        object.__setattr__(self, "response", varying(self.response, f"{self.source}, response"))

    def in_unit(self, name: str) -> Trajectory:
        """The same motion in another unit.

        **Raises:** `InputError` for a unit that is unknown or of another kind.
        """
        scale = parse_quantity(f"1 {self.response_unit}", name, f"{self.source}, response")
        return replace(self, response=scale * self.response, response_unit=name)

    def __len__(self) -> int:
        return len(self.response)

    @property
    def stroke(self) -> float:
        """Peak to peak of the desired response, in its unit."""
        return float(np.ptp(self.response))
