"""What the effects' names stand for: dynamics, a static curve, or the loop's shape."""

from __future__ import annotations

FAMILIES: dict[str, tuple[str, ...]] = {
    "slow": ("creep", "thermal_drift", "gain_drift", "viscoelastic_layer"),
    "lag": ("drive_lag", "sensor_lag", "delay", "clock_skew"),
    "mode": ("resonance", "second_mode"),
    "slew": ("slew_rate_limit",),
    "mains": ("mains_interference",),
    "static": (
        "electrostriction", "cubic_nonlinearity", "sensor_nonlinearity", "saturation",
        "lost_contact",
    ),
}  # fmt: skip
"""Effects that a case may have, by family; two of one case are of two families."""

FAMILY_SHARES = {"slow": 6, "lag": 4, "mode": 3, "slew": 1, "mains": 1, "static": 4}
"""How often each family is drawn, before what a recording does not show is drawn again."""

STATIC = FAMILIES["static"]
SHAPE = (
    "hysteresis_shape", "minor_loop_memory", "amplitude_dependence", "backlash", "coulomb_friction",
)  # fmt: skip
"""Names of the loop's shape: given to a mismatch of shape they are no wrong physics."""

MODE_RATE = 500.0
"""Lowest sampling rate in Hz at which a mode is put in, with five samples in its period or more."""

SLEW = 300.0
"""Speed of the drive in V/s from which on an amplifier may be too slow for it."""


def kind_of(name: str) -> str:
    """dynamic, static or shape; a name from outside the catalogue counts as dynamic."""
    return "shape" if name in SHAPE else "static" if name in STATIC else "dynamic"


def family_of(name: str) -> str:
    """The family of an effect that a case may have."""
    return next(family for family, names in FAMILIES.items() if name in names)
