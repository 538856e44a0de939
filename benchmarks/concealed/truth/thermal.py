"""Effects of temperature: drift of the frame, and a gain that follows the heat of the losses."""

from __future__ import annotations

import numpy as np

from ..drives import Array
from .linear import state_space


def thermal_drift(t: Array, y: Array, size: float, tau: float, slope: float) -> Array:
    """y + size (1 - exp(-t/tau) + slope t); size in um, tau in s, slope in 1/s."""
    return y + size * (-np.expm1(-t / tau) + slope * t)


def gain_drift(
    t: Array, y: Array, u: Array, gain: float, power: float, core: float, case: float, share: float
) -> Array:
    """y (1 + gain T): T the core's temperature rise, 1 in the steady state of the mean `power`.

    Losses |v dv/dt| heat the core; core and case are two thermal masses in a row:
    core T' = P/power - (T - C)/share, (1 - share) C' case-side with time constants in s.
    """
    v, h = u - u[0], t[1] - t[0]
    heat = np.abs(v * np.gradient(v, h)) / power
    # T' = (heat - (T - C)/share)/(core), C' = ((T - C)/share - C/(1 - share))/case
    a = np.array(
        [[-1 / (share * core), 1 / (share * core)],
         [1 / (share * case), -1 / (share * case) - 1 / ((1 - share) * case)]]
    )  # fmt: skip
    rise = state_space(heat, h, a, np.array([1 / core, 0.0]), np.array([1.0, 0.0]))
    return y * (1 + gain * rise)
