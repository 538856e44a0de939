"""A motion in a stroke, and models to compensate."""

import numpy as np

import fracjax as fj
from fracjax import blocks

STEP, COUNT = 1e-2, 120
TIMES = STEP * np.arange(COUNT)
SINE = 5 - 5 * np.cos(2 * np.pi * TIMES)

HYSTERESIS = blocks.FOH(0.05, 0.05, 1e-6, 0.1, -0.1)


def model(block) -> fj.Model:
    return fj.Model(block, "model")


def wanted(response=SINE, **options) -> fj.Trajectory:
    return fj.Trajectory(response, STEP, **options)
