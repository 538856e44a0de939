"""The catalogue of effects with ranges of amplitude and shape, and truths outside it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import electric, material, mechanics, outside, sensor, thermal
from .effect import Effect, Scene

Rng = np.random.Generator
Shape = Callable[[Rng], dict]


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _plain(name: str) -> Callable[[float, dict, Scene], dict]:
    return lambda a, shape, scene: {name: a} | shape


def _nothing(rng: Rng) -> dict:
    return {}


def _mains_shape(rng: Rng) -> dict:
    return {
        "frequency": float(rng.choice([50.0, 60.0]) + rng.uniform(-0.05, 0.05)),
        "ratios": [1.0, *rng.uniform(0.1, 0.5, 4).tolist()],
        "phases": rng.uniform(0, 2 * np.pi, 5).tolist(),
    }


def _mains(a: float, s: dict, c: Scene) -> dict:
    """Lines above 0.45 of the sampling rate are the anti-alias filter's."""
    heard = [r * (k * s["frequency"] * c.step < 0.45) for k, r in enumerate(s["ratios"], start=1)]
    return {"size": a * c.stroke} | s | {"ratios": heard}


def _layer_shape(rng: Rng) -> dict:
    n = int(rng.integers(3, 6))
    return {"arms": (rng.uniform(0.6, 1.4, n) * rng.uniform(0.5, 2) / n).tolist()}


def _layer(a: float, s: dict, c: Scene) -> dict:
    taus = np.geomspace(6 * c.step, c.duration / 2, len(s["arms"])).tolist()
    return {"softness": a, "arms": s["arms"], "taus": taus}


def _times_stroke(name: str) -> Callable[[float, dict, Scene], dict]:
    return lambda a, s, c: {name: a * c.stroke} | s


def _friction(a: float, s: dict, c: Scene) -> dict:
    return {
        "force": a * c.stroke,
        "bristle": s["bristle"] * c.stroke,
        "stick": s["stick"],
        "stribeck": s["stribeck"] * c.pace,
    }


def _heat(a: float, s: dict, c: Scene) -> dict:
    times = {k: s[k] * c.duration for k in ("core", "case")}
    return {"gain": a, "power": c.power, "share": s["share"]} | times


def _level(name: str) -> Callable[[float, dict, Scene], dict]:
    return lambda a, s, c: {name: 2 * a / c.span, "u0": c.low + s["where"] * c.span}


LOOPS = ("reversal", "level", "harmonics", "phase")
STATIC = ("level", "harmonics", "phase")
LAGS = ("frequency", "rate", "phase")

# Times are bounded by samples too, so that fast records see fast effects.
EFFECTS: dict[str, Effect] = {
    "creep": Effect(
        "O", material.creep, _plain("gain"), lambda g: {"t0": _log(g, 0.03, 0.3)},
        0.04, "response", ("time", "frequency", "reversal"), 0.01,
    ),
    "creep_kelvin_voigt": Effect(
        "O", material.creep_kelvin_voigt, _plain("gain"),
        lambda g: {"taus": [_log(g, 0.7 * x, 1.4 * x) for x in (0.05, 0.3, 1.5, 8.0)]},
        0.04, "response", ("time", "frequency", "reversal"), 0.01,
    ),
    "drive_lag": Effect(
        "I", electric.drive_lag, lambda a, s, c: {"tau": a * min(5e-3, 6 * c.step)}, _nothing,
        1.0, "drive", LAGS, 0.1,
    ),
    "delay": Effect(
        "I", electric.delay, lambda a, s, c: {"dead": a * 3 * c.step}, _nothing,
        1.0, "drive", LAGS, 0.2,
    ),
    "sensor_lag": Effect(
        "O", sensor.sensor_lag, lambda a, s, c: {"tau": a * min(1.6e-3, 6 * c.step)} | s,
        lambda g: {"order": int(g.integers(1, 5))}, 1.0, "response", LAGS, 0.1,
    ),
    "resonance": Effect(
        "O", mechanics.resonance, lambda a, s, c: {"period": a * min(0.01, 40 * c.step)} | s,
        lambda g: {"zeta": _log(g, 0.01, 0.1)}, 1.0, "response", ("frequency", "time"), 0.4,
    ),
    "second_mode": Effect(
        "O", mechanics.second_mode, lambda a, s, c: {"period": a * min(0.01, 40 * c.step)} | s,
        lambda g: {
            "mass": float(g.uniform(0.1, 0.5)),
            "ratio": float(g.uniform(0.6, 1.6)),
            "zetas": [_log(g, 0.01, 0.1), _log(g, 0.01, 0.1)],
        },
        1.0, "response", ("frequency", "time"), 0.4,
    ),
    "electrostriction": Effect(
        "I", material.electrostriction, _level("q"),
        lambda g: {"where": float(g.uniform(0.3, 0.7))}, 0.1, "drive", STATIC, 0.01,
    ),
    "cubic_nonlinearity": Effect(
        "I", material.cubic_nonlinearity,
        lambda a, s, c: {
            "q": s["sign"] * 4 * a / c.span**2, "u0": c.low + s["where"] * c.span
        },
        lambda g: {"where": float(g.uniform(0.4, 0.6)), "sign": float(g.choice([-1.0, 1.0]))},
        0.1, "drive", STATIC, 0.01,
    ),
    "amplitude_dependence": Effect(
        "I", material.amplitude_dependence, lambda a, s, c: {"rate": a / c.span}, _nothing,
        0.2, "drive", LOOPS, 0.03,
    ),
    "minor_loop_memory": Effect(
        "I", material.minor_loop_memory,
        lambda a, s, c: {"weight": a, "radii": [x * c.span for x in s["radii"]]},
        lambda g: {"radii": np.sort(np.exp(g.uniform(*np.log([0.02, 0.5]), 6))).tolist()},
        0.3, "drive", LOOPS, 0.05,
    ),
    "backlash": Effect(
        "O", mechanics.backlash, lambda a, s, c: {"radius": a * c.stroke} | s,
        lambda g: {"weight": float(g.uniform(0.4, 1)), "sharpness": float(g.uniform(8, 20))},
        0.05, "response", LOOPS, 0.005,
    ),
    "coulomb_friction": Effect(
        "O", mechanics.coulomb_friction, _friction,
        lambda g: {
            "bristle": _log(g, 0.002, 0.02),
            "stick": float(g.uniform(0, 0.5)),
            "stribeck": _log(g, 0.05, 0.5),
        },
        0.05, "force", ("reversal", "phase", "rate", "harmonics"), 0.005,
    ),
    "lost_contact": Effect(
        "O", mechanics.lost_contact,
        lambda a, s, c: {"rest": c.bottom + a * c.stroke, "dent": 0.02 * a * c.stroke},
        _nothing, 0.3, "response", STATIC, 0.04,
    ),
    "saturation": Effect(
        "I", electric.saturation,
        lambda a, s, c: {"u_max": c.high - a * c.span, "width": s["soft"] * a * c.span},
        lambda g: {"soft": float(g.uniform(0.02, 0.15))}, 0.3, "drive", STATIC, 0.04,
    ),
    "slew_rate_limit": Effect(
        "I", electric.slew_rate_limit,
        lambda a, s, c: {"rate": c.speed * (1 - a), "tau": 2e-7},
        _nothing, 0.9, "drive", ("rate", "frequency", "harmonics", "phase"), 0.2,
    ),
    "thermal_drift": Effect(
        "O", thermal.thermal_drift, _times_stroke("size"),
        lambda g: {"tau": _log(g, 2, 60), "slope": float(g.uniform(0, 0.05))},
        0.2, "additive", ("time",), 0.02,
    ),
    "gain_drift": Effect(
        "M", thermal.gain_drift, _heat,
        lambda g: {
            "core": float(g.uniform(0.05, 0.4)),
            "case": float(g.uniform(0.5, 2)),
            "share": float(g.uniform(0.4, 0.7)),
        },
        0.1, "modulation", ("time", "level"), 0.01,
    ),
    "sensor_nonlinearity": Effect(
        "O", sensor.sensor_nonlinearity,
        lambda a, s, c: {
            "curve": a, "middle": c.bottom + s["where"] * c.stroke, "span": c.stroke
        },
        lambda g: {"where": float(g.uniform(0.3, 0.7))}, 0.08, "response", STATIC, 0.01,
    ),
    "mains_interference": Effect(
        "O", sensor.mains_interference, _mains, _mains_shape,
        0.05, "additive", ("frequency",), 0.001,
    ),
    "viscoelastic_layer": Effect(
        "O", material.viscoelastic_layer, _layer, _layer_shape,
        0.3, "series", ("frequency", "time"), 0.03,
    ),
    "clock_skew": Effect(
        "I", electric.clock_skew,
        lambda a, s, c: {"skew": s["sign"] * 2 * a * c.step / c.duration, "bend": s["bend"]},
        lambda g: {"sign": float(g.choice([-1.0, 1.0])), "bend": float(g.uniform(0, 0.4))},
        1.0, "modulation", ("time", "rate"), 0.2,
    ),
    "quantisation": Effect(
        "Q", sensor.quantisation, lambda a, s, c: {"lsb": a * c.stroke} | s,
        lambda g: {
            "offset": float(g.uniform()),
            "dither": float(g.uniform(0, 0.3)),
            "seed": int(g.integers(2**31)),
        },
        0.05, "response", ("level",), 0.003,
    ),
}  # fmt: skip

NAMES = tuple(k for k in EFFECTS if k != "creep_kelvin_voigt")


def name_of(key: str) -> str:
    """The catalogue's name of an entry: both creep laws are creep."""
    return "creep" if key == "creep_kelvin_voigt" else key


def _off_mains(f: float) -> float:
    for line in (50.0, 60.0):
        k = round(f / line)
        if 1 <= k <= 5 and abs(f - k * line) < 3:
            f = k * line + 4.3
    return f


def _chirp(a: float, s: dict, c: Scene) -> dict:
    start, sweep = s["start"] / c.step, s["sweep"] / c.step / c.duration
    return {"size": a * c.stroke, "start": start, "sweep": sweep, "phase": s["phase"]}


def _beat(a: float, s: dict, c: Scene) -> dict:
    f = _off_mains(s["frequency"] / c.step)
    gap = s["beats"] / c.duration
    return {"size": a * c.stroke, "frequency": f, "gap": gap, "phase": s["phase"]}


def _jumps(a: float, s: dict, c: Scene) -> dict:
    return {
        "size": a * c.stroke,
        "times": [x * c.duration for x in s["times"]],
        "heights": s["heights"],
    }


def _kinks(a: float, s: dict, c: Scene) -> dict:
    return {"size": a, "at": [c.low + x * c.span for x in s["at"]], "turns": s["turns"]}


def _ripple(a: float, s: dict, c: Scene) -> dict:
    return {"size": a * c.stroke, "pitch": s["pitch"] * c.stroke, "phase": s["phase"]}


def _jump_shape(g: Rng) -> dict:
    n = int(g.integers(2, 5))
    return {
        "times": np.sort(g.uniform(0.15, 0.9, n)).tolist(),
        "heights": (g.choice([-1.0, 1.0], n) * g.uniform(0.4, 1, n)).tolist(),
    }


OUTSIDE: dict[str, Effect] = {
    "jumps": Effect(
        "O", outside.jumps, _jumps, _jump_shape, 0.2, "additive", ("time",), 0.005
    ),
    "chirped_tone": Effect(
        "O", outside.chirped_tone, _chirp,
        lambda g: {
            "start": float(g.uniform(0.02, 0.1)),
            "sweep": float(g.uniform(0.05, 0.2)),
            "phase": float(g.uniform(0, 6.28)),
        },
        0.2, "additive", ("frequency", "time"), 0.005,
    ),
    "beating_tone": Effect(
        "O", outside.beating_tone, _beat,
        lambda g: {
            "frequency": float(g.uniform(0.03, 0.2)),
            "beats": float(g.uniform(3, 12)),
            "phase": float(g.uniform(0, 6.28)),
        },
        0.2, "additive", ("frequency", "time"), 0.005,
    ),
    "kinked_input": Effect(
        "I", outside.kinked_input, _kinks,
        lambda g: {
            "at": (np.linspace(0.2, 0.8, 4) + g.uniform(-0.06, 0.06, 4)).tolist(),
            "turns": (np.array([1.0, -1, 1, -1]) * g.choice([-1.0, 1.0])).tolist(),
        },
        0.3, "drive", STATIC, 0.02,
    ),
    "encoder_ripple": Effect(
        "O", outside.encoder_ripple, _ripple,
        lambda g: {"pitch": float(g.uniform(0.08, 0.2)), "phase": float(g.uniform(0, 6.28))},
        0.05, "response", STATIC, 0.005,
    ),
}  # fmt: skip
