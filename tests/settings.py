"""Two slow cycles, and what the catalogue's trials make of them."""

import numpy as np

import fracjax as fj
from fracjax._blocks import Setting
from fracjax._prepare import prepare

TIMES = np.linspace(0, 2, 300)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES)


def setting_of_cycles() -> Setting:
    recording = fj.Recording(DRIVE, 0.1 * DRIVE, TIMES[1], "V", "um")
    return prepare([recording]).setting
