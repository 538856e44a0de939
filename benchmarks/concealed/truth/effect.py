"""What an effect is: a law, where it is inserted, its amplitude and its shape."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..drives import Array, Signal
from .bases import Base, Params


@dataclass(frozen=True)
class Scene:
    """What amplitudes are relative to: one actuator without the effect, on one drive.

    Drive range (V), displacement range (um), recording step and length (s), largest |du/dt| (V/s),
    rms |dy/dt| (um/s), mean |v dv/dt| (V^2/s), v = u - u(0).
    """

    low: float
    high: float
    bottom: float
    stroke: float
    step: float
    duration: float
    speed: float
    pace: float
    power: float

    @classmethod
    def of(cls, u: Array, y: Array, h: float, step: float) -> Scene:
        """From drive and response on a fine grid of step h."""
        du, dy, v = np.diff(u) / h, np.diff(y) / h, u - u[0]
        return cls(
            float(u.min()),
            float(u.max()),
            float(y.min()),
            float(np.ptp(y)),
            step,
            h * (len(u) - 1),
            float(np.max(np.abs(du))),
            float(np.sqrt(np.mean(dy**2))),
            float(np.mean(np.abs(v[1:] * du))),
        )

    @property
    def span(self) -> float:
        return self.high - self.low


@dataclass(frozen=True)
class Effect:
    """An effect; `side` says on what it acts and with which arguments.

    I: drive, f(drive, t, ...); O: response, f(t, y, ...); M: response, knowing the drive,
    f(t, y, u, ...); Q: recorded samples with their noise, f(y, ...).
    `parameters(a, shape, scene)` gives its physical parameters at amplitude a in [0, cap]; zero is
    the identity. `shape(rng)` draws everything that is not amplitude. `axes` are the places where
    the physics leaves its mark, in the words of diagnosis.json.
    """

    side: str
    apply: Callable[..., Array]
    parameters: Callable[[float, dict, Scene], dict]
    shape: Callable[[np.random.Generator], dict]
    cap: float
    site: str
    axes: tuple[str, ...]
    typical: float  # an amplitude of middle visibility

    def simulate(self, drive: Signal, t: Array, base: Base, law: Params, params: dict) -> Array:
        """Displacement in um on the fine grid t."""
        return simulate([(self, params)], drive, t, base, law)


def drive_side(effects: list[tuple[Effect, Mapping]], drive: Signal, t: Array) -> Array:
    """Voltage at the actuator after the drive-side effects, in the order given."""
    signal, v = drive, drive(t)
    for e, params in effects:
        if e.side == "I":
            v = e.apply(signal, t, **params)
            signal = lambda x, v=v: np.interp(x, t, v)  # noqa: E731 - a second effect sees samples
    return v


def response_side(
    effects: list[tuple[Effect, Mapping]], drive: Signal, t: Array, y: Array
) -> Array:
    """Displacement after the response-side effects, in the order given."""
    for e, params in effects:
        if e.side == "O":
            y = e.apply(t, y, **params)
        if e.side == "M":
            y = e.apply(t, y, drive(t), **params)
    return y


def simulate(
    effects: list[tuple[Effect, Mapping]], drive: Signal, t: Array, base: Base, law: Params
) -> Array:
    """Noise-free displacement in um on the fine grid t with all effects."""
    u = drive_side(effects, drive, t)
    return response_side(effects, drive, t, base.response(u, t[1] - t[0], law))
