"""Effects as large and as slow as machines have them, by the first tier's truths.

Their times are shares of the recording, not samples, so that a lag of a second fits one of a
minute; a mode's period has at least five samples.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..truth import EFFECTS, Effect, Scene

Rng = np.random.Generator
LEAST_PERIOD = 5  # samples


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _as(key: str, parameters: Callable[[float, dict, Scene], dict],
        shape: Callable[[Rng], dict], cap: float, typical: float) -> Effect:  # fmt: skip
    """A truth of the first tier with other ranges."""
    e = EFFECTS[key]
    return Effect(e.side, e.apply, parameters, shape, cap, e.site, e.axes, typical)


def _time(name: str) -> Callable[[float, dict, Scene], dict]:
    """A time of a hundredth of the recording at amplitude 1."""
    return lambda a, s, c: {name: a * 0.01 * c.duration} | s


def _period(a: float, s: dict, c: Scene) -> dict:
    return {"period": LEAST_PERIOD * c.step + a * 0.02 * c.duration} | s


def _kelvin_voigt(a: float, s: dict, c: Scene) -> dict:
    return {"gain": a, "taus": [tau * c.duration for tau in s["taus"]]}


def _drift(a: float, s: dict, c: Scene) -> dict:
    slope = s["slope"] / c.duration
    return {"size": a * c.stroke, "tau": s["tau"] * c.duration, "slope": slope}


def _two_modes(g: Rng) -> dict:
    return {
        "mass": float(g.uniform(0.1, 0.5)),
        "ratio": float(g.uniform(0.6, 1.6)),
        "zetas": [_log(g, 0.01, 0.1), _log(g, 0.01, 0.1)],
    }


TRIED: dict[str, Effect] = {
    "creep": _as(
        "creep", lambda a, s, c: {"gain": a, "t0": s["t0"] * c.step},
        lambda g: {"t0": _log(g, 3, 40)}, 0.08, 0.01,
    ),
    "creep_kelvin_voigt": _as(
        "creep_kelvin_voigt", _kelvin_voigt,
        lambda g: {"taus": [_log(g, 0.7 * x, 1.4 * x) for x in (0.003, 0.015, 0.08, 0.4)]},
        0.08, 0.01,
    ),
    "drive_lag": _as("drive_lag", _time("tau"), lambda g: {}, 1.0, 0.1),
    "sensor_lag": _as(
        "sensor_lag", _time("tau"), lambda g: {"order": int(g.choice([1, 1, 2, 4]))}, 1.0, 0.1
    ),
    "delay": _as("delay", _time("dead"), lambda g: {}, 1.0, 0.1),
    "resonance": _as("resonance", _period, lambda g: {"zeta": _log(g, 0.01, 0.1)}, 1.0, 0.1),
    "second_mode": _as("second_mode", _period, _two_modes, 1.0, 0.1),
    "thermal_drift": _as(
        "thermal_drift", _drift,
        lambda g: {"tau": _log(g, 0.15, 2), "slope": float(g.uniform(0, 0.6))}, 0.2, 0.02,
    ),
    "gain_drift": EFFECTS["gain_drift"],
    "mains_interference": EFFECTS["mains_interference"],
    "slew_rate_limit": EFFECTS["slew_rate_limit"],
}  # fmt: skip
"""Effects that a case may have."""

BESIDE = {k: EFFECTS[k] for k in ("viscoelastic_layer", "clock_skew")}
"""Effects that only could pass for one."""

FAMILIES = {
    "slow": ("creep", "creep_kelvin_voigt"),
    "lag": ("drive_lag", "sensor_lag", "delay"),
    "mode": ("resonance", "second_mode"),
    "drift": ("thermal_drift", "gain_drift"),
    "mains": ("mains_interference",),
    "slew": ("slew_rate_limit",),
}
"""Entries by family; two of one case are of two families."""

SHARES = {"slow": 5, "lag": 5, "mode": 3, "drift": 4, "mains": 1.5, "slew": 1.5}
MAINS_RATE = 140.0
"""Lowest sampling rate in Hz at which the mains are put in."""


def family_of(key: str) -> str:
    """The family of an entry."""
    return next(family for family, keys in FAMILIES.items() if key in keys)
