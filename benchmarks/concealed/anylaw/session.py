"""An actuator on one drive, or on two, and what one knows of it who does not know its law."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..drives import Array, Drive
from ..inexact.noises import Noise
from ..inexact.oracle import Oracle
from ..inexact.signals import make_drive
from ..inexact.stage import HISTORIES, Pairs, Stage, history
from .design import Spec
from .drives import DRIVES
from .effects import MAINS_RATE
from .laws import LAWS, MEMORY, drawn
from .oracle import STROKES, LawFree, fading_columns, travelled_columns

RATED = ((0.0, 100.0), (0.0, 150.0), (-20.0, 120.0), (-100.0, 100.0), (-250.0, 1000.0))
OPENING = (0.02, 0.3)  # of the rated loop
COLOURS = {"white": 0.5, "ar": 0.3, "quantised": 0.2}
MEASURED = 0.25  # share of recordings with white noise whose drive is measured with noise too
Rng = np.random.Generator


@dataclass(frozen=True)
class Session:
    """An actuator on one drive, or on two.

    `sensor` is the response's noise, `drive_noise` that of the drive's record in V.
    """

    stages: tuple[Stage, ...]
    sensor: Noise
    drive_noise: float
    memory: str

    @cached_property
    def noise(self) -> Noise:
        """The response's noise, and what that of the drive is worth through the mean gain."""
        if not self.drive_noise:
            return self.sensor
        scene = self.first.scene
        through = self.drive_noise * scene.stroke / scene.span
        return replace(self.sensor, sd=float(np.hypot(self.sensor.sd, through)))

    def recorded(self, pairs: Pairs) -> Array:
        """Response in um at the samples of all recordings, without noise."""
        return np.concatenate([stage.recorded(pairs) for stage in self.stages])

    @property
    def first(self) -> Stage:
        return self.stages[0]

    @property
    def coarse(self) -> Session:
        return replace(self, stages=tuple(s.coarse() for s in self.stages))

    @cached_property
    def plain(self) -> Array:
        return self.recorded([])

    def dense(self, memories: Sequence[str]) -> Array:
        """Columns in um that stand for memory that is no return-point memory, as large as it may
        well be."""
        makers = {"fading": fading_columns, "degrading": travelled_columns}
        stages, size = self.coarse.stages, STROKES * self.first.scene.stroke
        columns = [size * np.vstack([makers[m](s.u, s.over) for s in stages]) for m in memories]
        return np.column_stack(columns)

    @cached_property
    def tangent(self) -> Array:
        """What another gain, offset and shapes of the law itself would change, in um."""
        parts = [Oracle(s, self.noise).tangent for s in self.coarse.stages]
        return self.first.scene.stroke * len(self.plain) ** 0.5 * np.vstack(parts)

    def knowing(self, memories: Sequence[str], tangent: bool) -> LawFree:
        """What one knows who knows of memory that is no return-point memory, and the tangent."""
        drives, scene = [s.u for s in self.stages], self.first.scene
        columns = [self.dense(memories)] if memories else []
        columns += [self.tangent] if tangent else []
        dense = np.column_stack(columns) if columns else None
        return LawFree(drives, self.first.over, self.noise, scene.stroke / scene.span, dense)

    @cached_property
    def law_free(self) -> LawFree:
        """What one knows who knows of return points, or that the memory fades, and this law how."""
        if self.memory == "returning":
            return self.knowing([], False)
        return self.knowing(["fading", "degrading"][: 1 + (self.memory == "degrading")], True)

    @cached_property
    def any_law(self) -> LawFree:
        """What one knows who knows nothing of the law."""
        return self.knowing(["fading", "degrading"], False)


def draw_noise(rng: Rng, stroke: float) -> Noise:
    """A colour by COLOURS and .02 to .3 % of the stroke, evenly in the logarithm."""
    colour = str(rng.choice(list(COLOURS), p=list(COLOURS.values())))
    sd = stroke * float(np.exp(rng.uniform(np.log(2e-4), np.log(3e-3))))
    ranges = {"white": (0.0, 0.0), "ar": (0.3, 0.9), "quantised": (0.5, 4.0)}
    return Noise(colour, sd, float(rng.uniform(*ranges[colour])))


def draw_session(spec: Spec) -> tuple[Session, str]:
    """The case's actuator on its drives, and the kind of its history."""
    rng = np.random.default_rng([spec.seed, 1])
    law = LAWS[spec.law]
    params, swing = drawn(law, rng, *OPENING)
    stroke = float(np.exp(rng.uniform(np.log(2), np.log(100))))
    rated = RATED[int(rng.integers(len(RATED)))]
    share = rng.uniform(0.6, 1.0)
    low = rated[0] + rng.uniform(0, 1 - share) * (rated[1] - rated[0])
    volts = (low, low + share * (rated[1] - rated[0]))
    kind = str(rng.choice(HISTORIES, p=(0.5, 0.3, 0.2)))

    def stage(drive: Drive) -> Stage:
        start = float(drive(np.zeros(1))[0])
        before = history(kind, (2 * start - rated[0] - rated[1]) / (rated[1] - rated[0]))
        return Stage(law, params, stroke / swing, rated, drive, before)

    first = make_drive(spec.drive, spec.seed, spec.rate, spec.samples, volts, DRIVES)
    stages = [stage(first)]
    if spec.second:
        samples = max(2000, spec.samples // 2)
        second = make_drive(spec.second, spec.seed + 1, spec.rate, samples, volts, DRIVES)
        stages.append(stage(second))
    rng, scene = np.random.default_rng([spec.seed, 4]), stages[0].scene
    sensor, measured_drive = draw_noise(rng, scene.stroke), rng.uniform() < MEASURED
    share = rng.uniform(0.3, 1.0) * (measured_drive and sensor.colour == "white")
    drive_noise = float(share * sensor.sd * scene.span / scene.stroke)
    return Session(tuple(stages), sensor, drive_noise, MEMORY[spec.law]), kind


def possible(key: str, stage: Stage) -> bool:
    """Whether the sampling rate can hold the effect."""
    return key != "mains_interference" or stage.drive.rate >= MAINS_RATE
