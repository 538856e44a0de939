"""Which effects could pass for the truth on this recording: λ_kl = |P d_k|^2 (1 - ρ_kl^2).

d_k is what the truth changed, d_l what another effect of the simulator changes, P takes out what a
refit of the base absorbs, all in units of the noise. λ is the gain in log-likelihood (times two)
of the truth over effect l at its best amplitude. A nuisance shape is taken at several draws, and
at more where one of them comes near.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from .drives import Array, Signal
from .refit import Absorber, Chord
from .truth import EFFECTS, Base, Params, Scene, drive_side, name_of, response_side, whiten

DRAWS = {
    "creep": 2,
    "sensor_lag": 3,
    "resonance": 2,
    "second_mode": 3,
    "electrostriction": 2,
    "cubic_nonlinearity": 2,
    "minor_loop_memory": 2,
    "backlash": 2,
    "coulomb_friction": 3,
    "thermal_drift": 3,
    "gain_drift": 3,
    "sensor_nonlinearity": 2,
    "viscoelastic_layer": 2,
}
FURTHER, STEPS = 10, 4
SEPARABLE = 25.0
CANCELS = 0.5
ONE_SIGNED = (
    "creep", "drive_lag", "delay", "sensor_lag", "resonance", "second_mode", "amplitude_dependence",
    "backlash", "coulomb_friction", "lost_contact", "saturation", "slew_rate_limit",
)  # fmt: skip
"""Physics knows these with one sign only: nothing creeps back, nor comes before its cause."""


class Bank:
    """Changes that each catalogued effect makes to one actuator on one drive."""

    def __init__(
        self, base: Base, law: Params, signal: Signal, t: Array, keep: int, scene: Scene
    ) -> None:
        self.base, self.law, self.signal, self.t, self.keep = base, law, signal, t, keep
        self.scene = scene
        self.plain = base.response(signal(t), t[1] - t[0], law)
        self.recorded = self.plain[::keep]

    def change(self, key: str, amplitude: float, shape: dict) -> Array:
        """What one effect changes at the recorded samples, in um, without noise."""
        e = EFFECTS[key]
        pair = [(e, e.parameters(amplitude, shape, self.scene))]
        if e.side == "I":
            u, h = drive_side(pair, self.signal, self.t), self.t[1] - self.t[0]
            y = self.base.response(u, h, self.law, self.keep)
        else:
            y = response_side(pair, self.signal, self.t, self.plain)[:: self.keep]
        return y - self.recorded


@dataclass(frozen=True)
class Other:
    """An effect that the truth is compared with: its entries, with draws of their shapes, and
    `further` draws for what comes near."""

    name: str
    draws: tuple[tuple[str, dict], ...]
    further: tuple[tuple[str, dict], ...]

    def left(self, bank: Bank, chord: Chord, times: float = 1.0) -> Array:
        """What the refit leaves, in um: a column per draw, at `times` the typical amplitude."""
        columns = []
        for key, shape in self.draws:
            a = min(times * EFFECTS[key].typical, EFFECTS[key].cap)
            columns.append(chord.left(chord.prediction + bank.change(key, a, shape)))
        return np.column_stack(columns)

    def nearest(self, clean: Array, bank: Bank, law: Off, noise: str, sd: float, times: float,
                ) -> float:  # fmt: skip
        """|clean less a recording with this effect|^2 at its best amplitude, within a factor of
        four of `times` the typical one, less what a change of the law takes up."""
        wanted, found = law(whiten(noise, clean - bank.recorded, sd)), []
        for key, shape in (*self.draws, *self.further):
            a = times * EFFECTS[key].typical
            low, high = (min(k * a, EFFECTS[key].cap) for k in (0.25, 4.0))
            for _ in range(STEPS):
                a = float(np.clip(a, low, high))
                made = law(whiten(noise, bank.change(key, a, shape), sd))
                found.append(float(np.sum((wanted - made) ** 2)))
                if not made.any():
                    break
                a *= (made @ wanted) / (made @ made)
        return min(found)


def others(seed: int) -> list[Other]:
    """Every catalogued effect that displaces (quantisation only makes noise)."""
    rng, more = np.random.default_rng([seed, 17]), np.random.default_rng([seed, 18])
    draws: dict[str, list[tuple[str, dict]]] = {}
    further: dict[str, list[tuple[str, dict]]] = {}
    for key, e in EFFECTS.items():
        if e.side != "Q":
            mine = [(key, e.shape(rng)) for _ in range(DRAWS.get(key, 1))]
            draws.setdefault(name_of(key), []).extend(mine)
            beside = [(key, e.shape(more)) for _ in range(FURTHER * (key in DRAWS))]
            further.setdefault(name_of(key), []).extend(beside)
    return [Other(k, tuple(v), tuple(further[k])) for k, v in draws.items()]


class Off:
    """Projection off the whitened tangent space, for columns or one signal."""

    def __init__(self, chord: Chord, noise: str, sd: float) -> None:
        self.q = np.linalg.qr(whiten(noise, chord.jacobian, sd))[0]

    @classmethod
    def law(cls, bank: Bank, absorber: Absorber, noise: str, sd: float) -> Off:
        """Off the tangent space at the actuator's own law, where a right diagnosis ends."""
        shape = np.array([bank.law[name] for name in bank.base.shapes])
        gains = absorber.project(shape, bank.recorded)[1]
        return cls(Chord(absorber, shape, gains), noise, sd)

    def __call__(self, r: Array) -> Array:
        return r - self.q @ (self.q.T @ r)


def unexplained(truth: Array, columns: Array) -> float:
    """|truth|^2 less what the columns' span explains; directions under 5 % of the first are none.

    The span stands for a free nuisance shape: a family of laws bends between its draws.
    """
    u = _span(columns / np.linalg.norm(columns, axis=0))[0]
    return float(truth @ truth - np.sum((u.T @ truth) ** 2))


def unexplained_by(name: str, truth: Array, columns: Array) -> float:
    """What an effect's draws leave of the truth, as one law of its family could.

    Amplitudes that nearly cancel are no shape between the draws, nor near them: of two cubes they
    make a square.  Nor does an effect of one sign explain what it would with the other.  Where the
    span asks for either, no two amplitudes may differ in sign.
    """
    unit = columns / np.linalg.norm(columns, axis=0)
    signs = (1.0,) if name in ONE_SIGNED else (1.0, -1.0)
    if len(signs) > 1:  # draws of either sign, made those of one
        columns, unit = (x * np.where(unit.T @ unit[:, 0] < 0, -1.0, 1.0) for x in (columns, unit))
    u, size, v = _span(unit)
    amplitudes = v.T @ (u.T @ truth / size) / np.linalg.norm(columns, axis=0)
    together = float(amplitudes.sum())
    cancels = abs(together) < CANCELS * np.abs(amplitudes).sum()
    if cancels or (together < 0 and len(signs) == 1):
        return min(float(nnls(unit, sign * truth)[1] ** 2) for sign in signs)
    return unexplained(truth, columns)


def _span(unit: Array) -> tuple[Array, Array, Array]:
    """The singular directions of columns of unit length, but for those under 5 % of the first."""
    u, size, v = np.linalg.svd(unit, full_matrices=False)
    kept = size > 0.05 * size[0]
    return u[:, kept], size[kept], v[kept]


def separation(truth: Array, clean: Array, bank: Bank, chord: Chord, noise: str, sd: float,
               own: str, seed: int) -> dict[str, float]:  # fmt: skip
    """λ of a truth's whitened residual from every effect but its own.

    Each is taken at its typical amplitude about the refit; those that come near, also at the
    amplitude that leaves as much as the truth does (large changes bend), and about the actuator's
    own law: of a concealed effect the refit has gone far, and a fit of another effect with the base
    together need not go there.  All of them are, where the truth's own law at its typical amplitude
    does not come near: there the refit has gone so far that nothing about it tells who could.
    `clean` is the recording with the truth, without noise [um].
    """
    off, power = Off(chord, noise, sd), float(truth @ truth)
    law = Off.law(bank, chord.absorber, noise, sd)
    rivals = others(seed)
    columns = {o.name: off(whiten(noise, o.left(bank, chord), sd)) for o in rivals}
    out = {name: unexplained_by(name, truth, column) for name, column in columns.items()}
    tells = out.pop(own, 0.0) < 0.5 * power
    for other in rivals:
        if other.name in out and (out[other.name] < 0.5 * power or not tells):
            times = float(np.sqrt(power / np.mean(np.sum(columns[other.name] ** 2, axis=0))))
            matched = off(whiten(noise, other.left(bank, chord, times), sd))
            nearest = other.nearest(clean, bank, law, noise, sd, times)
            left = unexplained_by(other.name, truth, matched)
            out[other.name] = min(out[other.name], left, nearest)
    return out
