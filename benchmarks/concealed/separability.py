"""Which effects could pass for the truth on this recording: λ_kl = |P d_k|^2 (1 - ρ_kl^2).

d_k is what the truth changed, d_l what another effect of the simulator changes, P takes out what a
refit of the base absorbs, all in units of the noise. λ is the gain in log-likelihood (times two)
of the truth over effect l at its best amplitude. A nuisance shape is taken at several draws.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .drives import Array, Signal
from .refit import Chord
from .truth import EFFECTS, Base, Params, Scene, drive_side, name_of, response_side, whiten

DRAWS = {
    "creep": 2, "creep_kelvin_voigt": 1, "sensor_lag": 2, "resonance": 2, "second_mode": 2,
    "electrostriction": 2, "cubic_nonlinearity": 2, "minor_loop_memory": 2, "coulomb_friction": 2,
    "thermal_drift": 2, "gain_drift": 2, "sensor_nonlinearity": 2,
}  # fmt: skip
SEPARABLE = 25.0


class Bank:
    """Changes that each catalogued effect makes to one actuator on one drive."""

    def __init__(
        self, base: Base, law: Params, signal: Signal, t: Array, keep: int, scene: Scene
    ) -> None:
        self.base, self.law, self.signal, self.t, self.keep = base, law, signal, t, keep
        self.scene = scene
        self.plain = base.response(signal(t), t[1] - t[0], law)

    def change(self, key: str, amplitude: float, shape: dict) -> Array:
        """What one effect changes at the recorded samples, in um, without noise."""
        e = EFFECTS[key]
        pair = [(e, e.parameters(amplitude, shape, self.scene))]
        if e.side == "I":
            u, h = drive_side(pair, self.signal, self.t), self.t[1] - self.t[0]
            y = self.base.response(u, h, self.law, self.keep)
        else:
            y = response_side(pair, self.signal, self.t, self.plain)[:: self.keep]
        return y - self.plain[:: self.keep]

    def others(self, rng: np.random.Generator) -> Iterable[tuple[str, Array]]:
        """(name, change) of every effect at its typical amplitude, several shapes each."""
        for key, e in EFFECTS.items():
            if e.side == "Q":  # no displacement of its own: it makes noise
                continue
            for _ in range(DRAWS.get(key, 1)):
                yield name_of(key), self.change(key, e.typical, e.shape(rng))


def directions(bank: Bank, chord: Chord, noise: str, sd: float, seed: int) -> dict[str, Array]:
    """What the refit leaves of each effect, whitened: one column per shape."""
    rng = np.random.default_rng([seed, 17])
    out: dict[str, list[Array]] = {}
    for name, change in bank.others(rng):
        left = chord.left(chord.prediction + change)
        out.setdefault(name, []).append(whiten(noise, left, sd))
    off = Off(chord, noise, sd)
    return {k: off(np.column_stack(v)) for k, v in out.items()}


class Off:
    """Projection off the whitened tangent space, for columns or one signal."""

    def __init__(self, chord: Chord, noise: str, sd: float) -> None:
        self.q = np.linalg.qr(whiten(noise, chord.jacobian, sd))[0]

    def __call__(self, r: Array) -> Array:
        return r - self.q @ (self.q.T @ r)


def separation(truth: Array, others: dict[str, Array]) -> dict[str, float]:
    """λ of the truth's whitened residual from each other effect (least over its shapes)."""
    power = float(truth @ truth)
    out = {}
    for name, columns in others.items():
        size = np.sum(columns**2, axis=0) + 1e-300
        rho2 = np.max((columns.T @ truth) ** 2 / size) / max(power, 1e-300)
        out[name] = power * (1 - float(rho2))
    return out
