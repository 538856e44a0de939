"""The desired motion, validated when it is made."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._recording import LARGEST, UNSTATED, InputError, conversion, parse_quantity, unit, varying
from .._show import Shown


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Shown):
    """Uniform samples of a desired response.

    Attributes:
        response: The desired response (N,) [response_unit].
        dt: The time step [s].
        response_unit: Unit of the response; "response units" where none is stated.
        source: Name of the trajectory in messages, such as its file.

    Raises:
        InputError: When the response is not finite, not one-dimensional, shorter than 32 samples or
            constant, the step is not positive, or the unit is unknown.
    """

    response: np.ndarray
    dt: float
    response_unit: str = ""
    source: str = "trajectory"

    def __post_init__(self):
        stated = self.response_unit or UNSTATED["response"]
        unit(stated, f"{self.source}, response")
        object.__setattr__(self, "response_unit", stated)
        step = parse_quantity(self.dt, "s", f"{self.source}, dt")
        if not 1 / LARGEST < step < LARGEST:
            raise InputError.at(
                f"{self.source}, dt", "a positive step in seconds", f"{step:g}", "correct it"
            )
        object.__setattr__(self, "dt", step)
        object.__setattr__(self, "response", varying(self.response, f"{self.source}, response"))

    def in_unit(self, name: str) -> Trajectory:
        """The same motion in another unit.

        Raises InputError for a unit that is unknown or of another kind.
        """
        unit(name, "response_unit")
        scale = conversion(self.response_unit, name)
        if scale is None:
            remedy = f"give --unit response={name} if it is in {name}"
            if name == UNSTATED["response"]:
                remedy = f"fit its recording with --unit response={self.response_unit}"
            raise InputError.at(
                f"{self.source}, response",
                f"a motion in {name} or a multiple of it, as the model's",
                self.response_unit,
                remedy,
            )
        return replace(self, response=scale * self.response, response_unit=name)

    def __len__(self) -> int:
        return len(self.response)

    @property
    def stroke(self) -> float:
        """Peak-to-peak value of the desired response [response_unit]."""
        return float(np.ptp(self.response))
