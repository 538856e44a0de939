"""The drive of the papers' tests."""

import jax.numpy as jnp
import numpy as np

from fracjax._parameters import named_parameters
from tests.helpers import smooth

RATE = 1000.0
TIMES = np.arange(1201) / RATE  # odd: no line at half the sampling rate, which has no phase
FREQUENCIES = np.geomspace(0.01, 100, 41)  # [F Fig. 12]

DRIVE = jnp.asarray(smooth(TIMES))


def values_of(block) -> dict[str, float]:
    return {n: float(p.value) for n, p in named_parameters(block).items()}
