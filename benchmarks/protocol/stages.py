"""Actuators of the third tier's laws, on drives that fracjax designs for their amplifiers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import fracjax as fj

from ..concealed.anylaw.laws import LAWS, MEMORY, drawn
from ..concealed.anylaw.session import OPENING
from ..concealed.drives import Array, Drive
from ..concealed.inexact.stage import HISTORIES, Stage, history

AMPLIFIERS = {
    "laboratory, 60 mA": ("0..150 V, 60 mA", "1.5 uF", "2.3 mV"),
    "stage controller, 2 A": ("-30..130 V, 2 A", "6 uF", "2.5 mV"),
    "slow digital, 500 V/s": ("0..100 V, 500 V/s", None, "1.6 mV"),
    "bimorph, 100 mA": ("-100..100 V, 100 mA", "0.2 uF", "3.1 mV"),
    "high voltage, 20 mA": ("-250..1000 V, 20 mA", "20 nF", "20 mV"),
}
"""Limits, the load's capacitance and the converter's step, as five kinds of amplifier have them."""
RATE, DURATION = 160.0, 20.0
NOISES = (2e-4, 1e-2)
"""Over the stroke, evenly in the logarithm."""


@dataclass(frozen=True)
class Bench:
    """An actuator on the drive that was designed for it.

    Attributes:
        stage: the actuator.
        law: its law's name.
        amplifier: its name.
        designed: the drive, and what it promises in % of the stroke.
        noise: rms [um].
    """

    stage: Stage
    law: str
    amplifier: str
    designed: fj.Protocol
    noise: float

    @property
    def memory(self) -> str:
        """Of the law."""
        return MEMORY[self.law]


def designed_for(amplifier: str, noise: float) -> fj.Protocol:
    """The drive for an amplifier and a noise over the stroke."""
    limits, capacitance, resolution = AMPLIFIERS[amplifier]
    return fj.protocol(
        limits, RATE, duration=DURATION, capacitance=capacitance, resolution=resolution,
        noise=f"{100 * noise:.6g} %",
    )  # fmt: skip


def bench(number: int) -> Bench:
    """The `number`th actuator, all of whose properties follow from its number."""
    rng = np.random.default_rng([58, number])
    law = list(LAWS)[number % len(LAWS)]
    amplifier = list(AMPLIFIERS)[number % len(AMPLIFIERS)]
    noise = float(np.exp(rng.uniform(*np.log(NOISES))))
    designed = designed_for(amplifier, noise)
    params, swing = drawn(LAWS[law], rng, *OPENING)
    stroke = float(np.exp(rng.uniform(np.log(2), np.log(100))))
    values, times = designed.drive.values, designed.drive.times

    def volts(t: Array) -> Array:
        return np.interp(t, times, values)

    rated = designed.limits.low, designed.limits.high
    drive = Drive("designed", volts, values.size / RATE, RATE)
    x0 = (2 * values[0] - sum(rated)) / (rated[1] - rated[0])
    before = history(str(rng.choice(HISTORIES)), float(x0))
    stage = Stage(LAWS[law], params, stroke / swing, rated, drive, before)
    return Bench(stage, law, amplifier, designed, noise * stage.scene.stroke)
