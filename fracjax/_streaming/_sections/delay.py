r"""A pure delay: the last samples of the drive, read between two of them.

Its inverse looks ahead, which a motion not known ahead does not allow, but a smooth one does:

    exp(τ s) ≈ N(s)/((1 + τ s/a) (1 + τ s/b)),    N the Taylor polynomial of second order of
                                                  exp(τ s) (1 + τ s/a) (1 + τ s/b)

Source: Ljung, System Identification (1999), section 4.2.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import Delay
from ..._systems import System
from ._section import Response, Sampling, Section, State, section_of

_POLES = 3.0, 3.3
"""a and b: a sudden motion is amplified by 13 at most, and the error at ω τ = 0.1 is 5e-4."""

LEAD = 2
"""The order of N."""


class DelaySection(Section):
    """The drive some samples ago; between two samples on the straight line."""

    def __init__(self, samples: float):
        whole = int(np.floor(samples))
        self.taps = np.zeros(whole + 2)
        self.taps[whole : whole + 2] = 1 - (samples - whole), samples - whole
        self.gains, self.labels = np.ones(1), ("delay",)

    def start(self, drive: Array) -> State:
        return {"drives": jnp.full(self.taps.size - 1, drive)}

    def begin(self, state: State) -> Response:
        earlier = state["drives"]

        def respond(drive: Array) -> tuple[Array, State]:
            drives = jnp.concatenate([jnp.reshape(drive, (1,)), earlier])
            read = jnp.sum(self.taps * drives)
            return jnp.reshape(read, (1,)), {"drives": drives[:-1]}

        return respond


def lead(delay: float) -> System:
    """The rational approximation of exp(τ s) for a delay τ [s]."""
    a, b = _POLES
    # Denominator 1 + p x + q x², x = τ s; numerator 1 + (1 + p) x + (1/2 + p + q) x².
    p, q = 1 / a + 1 / b, 1 / (a * b)
    direct = (1 / 2 + p + q) / q
    x = -np.array([a, b])
    residues = (1 + (1 + p) * x + (1 / 2 + p + q) * x**2) / (p + 2 * q * x)
    return System.parallel(x / delay, residues / delay, direct)


@section_of.register
def _(block: Delay, sampling: Sampling) -> Section:
    return DelaySection(float(block.delay.value) / sampling.step)
