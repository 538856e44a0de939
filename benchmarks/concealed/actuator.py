"""One actuator on one drive: its law, fine grid, noise-free response and refits."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from .columns import columns_of
from .drives import Array, Drive
from .refit import Absorber, Chord
from .separability import Bank
from .truth import BASES, Effect, Params, Scene, drive_side, response_side, simulate

OVER = 8  # fine steps per recorded sample; the tests halve the step
COARSE = 4  # for the effects that a truth is compared with


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


def grid(drive: Drive, over: int = OVER) -> Array:
    """Times in s, `over` steps per recorded sample, ending at the last sample."""
    return np.arange((len(drive.times) - 1) * over + 1) / (drive.rate * over)


def draw_law(base: str, drive: Drive, seed: int) -> Params:
    """A law within 20 % of nominal; the rate term of FOH is 0.3 to 3 % of the response.

    Its gain is tied to the drive, for |du/dt| grows with the rate of the recording.
    """
    rng, b = np.random.default_rng([seed, 7]), BASES[base]
    law = b.draw(rng)
    if "k_p" in law:
        t = grid(drive, COARSE)
        columns = columns_of("foh", drive(t), t[1], COARSE)([law["alpha"], law["beta"]])
        rest = law["k_l"] * columns[0] + law["k_h"] * columns[1]
        share = np.exp(rng.uniform(np.log(0.003), np.log(0.03)))
        law["k_p"] = float(share * np.std(rest) / np.std(columns[2]))
    return law


class Actuator:
    """A base with its law on a drive; responses in um at the recorded samples."""

    def __init__(self, base: str, law: Params, drive: Drive) -> None:
        self.name, self.base, self.law, self.drive = base, BASES[base], law, drive
        self.t = grid(drive)
        self.h = self.t[1]
        self.u = drive(self.t)
        self.fine = self.base.response(self.u, self.h, law)
        self.plain = self.fine[::OVER]
        self.scene = Scene.of(self.u, self.fine, self.h, 1 / drive.rate)

    @cached_property
    def absorber(self) -> Absorber:
        columns = columns_of(self.name, self.u, self.h, OVER)
        return Absorber(self.base, columns, [self.law[k] for k in self.base.shapes])

    def with_one(self, effect: Effect, params: dict) -> Array:
        """Response with one effect; the base's own response is at hand for the response side."""
        pair = [(effect, params)]
        if effect.side == "I":
            u = drive_side(pair, self.drive, self.t)
            return self.base.response(u, self.h, self.law, OVER)
        return response_side(pair, self.drive, self.t, self.fine)[::OVER]

    def with_all(self, pairs: list[tuple[Effect, dict]]) -> Array:
        """Response with several effects."""
        return simulate(pairs, self.drive, self.t, self.base, self.law)[::OVER]

    def bank(self) -> Bank:
        """The catalogue's changes to this actuator, on a coarser grid."""
        t = grid(self.drive, COARSE)
        return Bank(self.base, self.law, self.drive, t, COARSE, self.scene)

    def between_samples(self, chord: Chord) -> dict[str, float]:
        """rms, after the refit, of what drawing lines or a spline through the samples changes."""
        out = {}
        for how in ("linear", "cubic"):
            u = self.drive.between(how)(self.t)
            change = self.base.response(u, self.h, self.law, OVER) - self.plain
            out[how] = rms(chord.left(chord.prediction + change))
        return out
