"""A motion, and what several effects are measured by."""

import numpy as np

import fracjax as fj
from fracjax._blocks import FOH, CoulombFriction, LuGreFriction
from fracjax._operators import Grid
from tests.helpers import respond

STEP = 2e-3
TIMES = np.arange(601) * STEP
GRID = Grid(STEP, "constant")
NAMES = (
    "coulomb_friction",
    "LuGre's friction",
    "lost_contact",
    "thrown load",
    "slew_rate_limit",
    "gain_drift",
    "viscoelastic_layer",
    "clock_skew",
    "quantisation",
)


def motion(times):
    """A motion [um] with inner loops that starts at rest."""
    return 6 * np.sin(np.pi * times) ** 2 + 2 * np.sin(3 * np.pi * times) ** 2


def rate_of_motion(times):
    return 6 * np.pi * np.sin(2 * np.pi * times) + 6 * np.pi * np.sin(6 * np.pi * times)


def errors_of(simulate, exact, counts=(150, 300, 600)) -> list[float]:
    """Largest errors over 1.2 s on ever finer grids."""
    grids = [np.linspace(0, 1.2, count + 1) for count in counts]
    return [float(np.abs(simulate(t) - exact(t)).max()) for t in grids]


friction = CoulombFriction(0.4, 0.7, span=8.0)

lubricated = LuGreFriction(0.4, 0.7, 0.5, 20.0, span=8.0)

RATE = 500.0
SECONDS = np.arange(3000) / RATE


def rich_drive(times):
    """A drive [V] of growing frequency and changing amplitude, smoothly from 5 V."""
    swell = 0.3 + 0.7 * np.sin(2 * np.pi * times / 6) ** 2
    return (
        50
        + 45 * swell * np.sin(2 * np.pi * (0.6 + 0.4 * times) * times)
        - 45 * np.exp(-((times / 0.4) ** 2))
    )


BASE = FOH(k_l=0.07, k_h=0.04, k_p=1.5e-6, alpha=0.14, beta=-0.13)
DRIVE = rich_drive(SECONDS)
PLAIN = respond(BASE, DRIVE, Grid(1 / RATE, "constant"))


def recorded(response) -> fj.Recording:
    return fj.Recording(drive=DRIVE, response=response, dt=1 / RATE)
