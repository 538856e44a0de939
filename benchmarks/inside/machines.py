"""Machines with physics inside, integrated by SciPy; nothing here is imported from fracjax.

Each is linear but for one effect, whose size makes what no linear machine follows a given share of
the response; the noise is that over the level.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import copysign, hypot, inf, sqrt, tanh

import numpy as np
from scipy.integrate import odeint
from scipy.interpolate import CubicSpline

Array = np.ndarray
SAMPLES = 1500
LEVELS = (0.3, 1.0, 3.0, 10.0, 30.0)
"""What no linear machine follows, rms over the noise's."""
SHARES = 0.005, 0.05
"""The same over the response's rms, evenly in the logarithm."""
_FINE = 64
"""Values of the drive in a sample; between them it is a line."""
_TOLERANCE = {"rtol": 1e-7, "atol": 1e-9, "mxstep": 5000}
_SIZES, _HALVINGS = (1e-4, 30.0), 12
"""Sizes of an effect, over that which is as large as the drive, and how often they are halved."""
_WEAKER = {"quadratic_stiffness": 0.3, "clearance": 0.9, "negative_stiffness": 0.9}
"""The largest size where a spring must still hold."""
_HISTORY = 60
"""Samples in which a drive rises from rest."""
RATES = {"oscillator": 0.3, "mass": 0.1, "lag": 0.03}
"""Of a machine's own motion [rad a sample], within a factor of 1.4: an oscillator has some twenty
samples a period, and a store follows some of its levels and not others."""

Force = Callable[[float, Sequence[float], float], float]
"""Of the size, the state in typical units, and the drive: a force or a flow over the drive's."""


def _snap(size: float, state: Sequence[float], drive: float) -> float:
    # Two springs across the motion, compressed by a half.
    return size * state[0] * (1.5 / hypot(1.0, 2 * state[0]) - 0.5)


FORCES: dict[str, Force] = {
    "": lambda a, s, u: 0.0,
    "cubic_stiffness": lambda a, s, u: -a * s[0] ** 3,
    "quadratic_stiffness": lambda a, s, u: -a * s[0] ** 2,
    "clearance": lambda a, s, u: a * max(-0.3, min(0.3, s[0])),
    "end_stop": lambda a, s, u: -a * max(s[0] - 0.8, 0.0),
    "dry_friction": lambda a, s, u: -a * tanh(s[1] / 0.01),
    "quadratic_damping": lambda a, s, u: -a * s[1] * abs(s[1]),
    "position_dependent_gain": lambda a, s, u: -a * s[0] ** 2 * u,
    "hysteretic_spring": lambda a, s, u: -a * s[2],
    "negative_stiffness": _snap,
    "root_outflow": lambda a, s, u: -a * sqrt(max(s[0], 0.0)),
    "internal_saturation": lambda a, s, u: -a * max(s[0] - 0.7, 0.0),
}
"""Forces on a mass at the position s[0] with the velocity s[1], in typical units, and flows into a
store of the level s[0]; s[2] is Bouc and Wen's memory."""
OF_MACHINE = {
    "oscillator": tuple(FORCES)[1:10],
    "mass": ("dry_friction", "quadratic_damping"),
    "lag": ("root_outflow", "internal_saturation"),
}
"""The effects of each machine."""
_YIELD, _POWER = 0.4, 1.5
"""Deflection at which a hysteretic spring yields, in typical units, and Bouc and Wen's exponent."""


@dataclass(frozen=True)
class Case:
    """A recording of a machine.

    Attributes:
        number: of the case.
        machine: "oscillator", "mass" or "lag".
        effect: inside it; "" for none.
        level: what no linear machine follows over the noise, rms; 0 for none.
        share: the same over the response.
        step: between samples [s].
        drive: (N,) [V].
        response: (N,) with noise [um].
        noise: rms [um].
    """

    number: int
    machine: str
    effect: str
    level: float
    share: float
    step: float
    drive: Array
    response: Array
    noise: float


@dataclass(frozen=True)
class _Machine:
    """A linear machine at rest before its drive, whose values (M,) are `fine` [s] apart."""

    kind: str
    rate: float
    damping: float
    gain: float
    drive: tuple[float, ...]
    fine: float

    def moved(self, effect: str = "", size: float = 0.0) -> Array:
        """The response (N,) in typical units; NaN where the machine does not hold."""
        rate, damping, gain, drive, fine = (
            self.rate, self.damping, self.gain, self.drive, self.fine
        )  # fmt: skip
        force, last, kind = FORCES[effect], len(self.drive) - 2, self.kind
        spring = 1.0 if kind == "oscillator" else 0.0

        def change(state: Sequence[float], t: float) -> list[float]:
            at = t / fine
            k = min(max(int(at), 0), last)
            u = drive[k] + (at - k) * (drive[k + 1] - drive[k])
            pushed = gain * u + force(size, state, u)
            if kind == "lag":
                return [rate * (pushed - state[0])]
            x, v, z = state
            # Bouc and Wen's law, relieved with the stiffness that it is loaded with at first.
            bent = abs(z) ** _POWER * (copysign(1.0, v * z) > 0)
            return [rate * v, rate * (pushed - spring * x - 2 * damping * v),
                    rate * v / _YIELD * (1 - bent)]  # fmt: skip

        times = fine * np.arange(0, len(drive), _FINE)
        start = [0.0] if kind == "lag" else [0.0, 0.0, 0.0]
        states, told = odeint(
            change, start, times, full_output=True, hmax=0.5 * _FINE * fine, **_TOLERANCE
        )
        response = states[:, 1 if kind == "mass" else 0]
        return response if "successful" in told["message"] else np.full(response.size, np.nan)

    def tangent(self) -> Array:
        """What a change of each parameter, and an offset, adds to the response (N, 4)."""
        small, columns = 1e-3, []
        for name in ("rate", "damping", "gain"):
            up, down = (
                replace(self, **{name: getattr(self, name) * factor}).moved()
                for factor in (1 + small, 1 - small)
            )
            columns.append((up - down) / (2 * small))
        columns = [c for c in columns if np.ptp(c) > 0]
        return np.stack([*columns, np.ones_like(columns[0])], axis=1)


def _driven(rng: np.random.Generator, kind: str, rate: float) -> Array:
    """A drive (N,) that begins at rest: a multisine up to three times the machine's own frequency,
    or, of a store, levels that are approached smoothly."""
    count = np.arange(SAMPLES)
    rise = np.clip(count / _HISTORY, 0.0, 1.0) ** 2
    if kind == "lag":
        held = np.repeat(rng.uniform(0.0, 2.0, 30), SAMPLES // 30)
        kernel = np.hanning(15) / np.hanning(15).sum()
        return rise * np.convolve(held, kernel, "same")
    lines = np.arange(1, int(3 * rate / (2 * np.pi) * SAMPLES))
    phases = rng.uniform(0, 2 * np.pi, lines.size)
    waves = np.cos(2 * np.pi * np.outer(count / SAMPLES, lines) + phases).sum(axis=1)
    return rise * waves / waves.std()


def case(number: int) -> Case:
    """The `number`th of eighty, all of whose properties follow from its number: thirteen effects in
    machines at five levels, and fifteen machines without any."""
    rng = np.random.default_rng([2026, number])
    pairs = [(machine, e) for machine, effects in OF_MACHINE.items() for e in effects]
    pairs += [(machine, "") for machine in OF_MACHINE]
    kind, effect = pairs[number % len(pairs)]
    level = LEVELS[number // len(pairs)] if effect else 0.0
    step = float(np.exp(rng.uniform(np.log(1e-3), np.log(1e-1))))
    turn = RATES[kind] * float(np.exp(rng.uniform(np.log(1 / 1.4), np.log(1.4))))
    values = _driven(rng, kind, turn)
    places = np.arange((SAMPLES - 1) * _FINE + 1) / _FINE
    fine = tuple(CubicSpline(np.arange(SAMPLES), values)(places).tolist())
    damping = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3))))
    machine = _Machine(kind, turn / step, damping, 1.0, fine, step / _FINE)
    plain = machine.moved()
    machine = replace(machine, gain=float(1 / (plain.max() if kind == "lag" else plain.std())))
    plain, basis = machine.moved(), np.linalg.qr(machine.tangent())[0]
    share = float(np.exp(rng.uniform(*np.log(SHARES))))

    def beyond(size: float) -> tuple[Array, float]:
        """The response, and what no linear machine follows of it, rms over the response's."""
        response = machine.moved(effect, size)
        rest = response - plain
        rest = rest - basis @ (basis.T @ rest)
        part = float(np.std(rest) / np.std(response))
        return response, part if np.isfinite(part) else inf

    response, actual = plain, 0.0
    if effect:
        low, high = _SIZES[0], _WEAKER.get(effect, _SIZES[1])
        for _ in range(_HALVINGS):
            middle = sqrt(low * high)
            low, high = (middle, high) if beyond(middle)[1] < share else (low, middle)
        response, actual = beyond(low)
    size = float(np.exp(rng.uniform(np.log(0.1), np.log(100))))
    noise = float(np.std(response)) * (actual / level if effect else share)
    noisy = size * (response + noise * rng.standard_normal(SAMPLES))
    return Case(number, kind, effect, level, actual, step, values, noisy, size * noise)
