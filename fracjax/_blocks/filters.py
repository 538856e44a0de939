"""Two filters in series, with what lies between them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress, product

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter, named_parameters, set_values
from ._machine import AbstractMachine
from ._port import Port, System

_PARTS = (("frequencies", "dampings"), ("corners",), ("zeros", "zero_dampings"))
"""What either filter may have of the product of both, each by its parameters."""


class Filters(AbstractMachine):
    r"""Two filters of third order in series:

        G(s) = g F_1(s) F_2(s)
        F_i(s) = (1 + 2 ξ_i s/η_i + s²/η_i²) / ((1 + s/κ_i)(1 + 2 ζ_i s/ω_i + s²/ω_i²))

    with ω_i = 2π f_i, and κ_i and η_i likewise from the corner and the zeros.  At the port
    `between` acts a signal that is added to what enters the second filter, in units of the drive:
    a diode or a limited amplifier there makes a Wiener–Hammerstein system.  Its position is g times
    what the first filter yields.  A linear recording tells F_1 F_2 alone, so that it does not say
    which poles and zeros lie before the port: a diagnosis tries them all.

    Args:
        gain: initial g.
        frequencies: initial f of each filter's pair of poles.
        dampings: initial ζ of each.
        corners: initial corner of each filter's single pole.
        zeros: initial frequency of each filter's pair of zeros.
        zero_dampings: initial ξ of each.

    Attributes:
        gain: g, one number [response/drive].
        frequencies: f (2,) [Hz].
        dampings: ζ (2,), dimensionless.
        corners: κ/2π (2,) [Hz].
        zeros: η/2π (2,) [Hz].
        zero_dampings: ξ (2,), dimensionless; 0 where a frequency does not pass.

    Source: Schoukens & Ljung, IEEE Control Syst. Mag. 39 (2019) 28, block-oriented models;
    Oppenheim & Schafer, Discrete-Time Signal Processing (2010), appendix B, filters with zeros.
    """

    gain: Parameter
    frequencies: Parameter
    dampings: Parameter
    corners: Parameter
    zeros: Parameter
    zero_dampings: Parameter

    def __init__(
        self,
        gain: float = 1.0,
        frequencies: Sequence[float] | np.ndarray = (100.0, 150.0),
        dampings: Sequence[float] | np.ndarray = (0.5, 0.5),
        corners: Sequence[float] | np.ndarray = (100.0, 150.0),
        zeros: Sequence[float] | np.ndarray = (1000.0, 1000.0),
        zero_dampings: Sequence[float] | np.ndarray = (0.5, 0.5),
    ):
        self.gain = Parameter(gain, "response/drive", gain=True)
        self.frequencies, self.corners, self.zeros = (
            Parameter(
                start, "Hz", lower=1e-6, upper=1e9, plausible=(start / 20, 20 * start),
                logarithmic=True,
            )
            for start in (np.asarray(f, dtype=float) for f in (frequencies, corners, zeros))
        )  # fmt: skip
        self.dampings = Parameter(
            np.asarray(dampings), lower=1e-4, upper=10.0, plausible=(0.02, 2.0), logarithmic=True
        )
        self.zero_dampings = Parameter(
            np.asarray(zero_dampings), lower=-1e3, upper=1e3, plausible=(-2.0, 2.0)
        )

    @property
    def accuracy(self) -> int:
        return 3

    def symbol(self, s: Array) -> Array:
        result = self.gain.value + 0 * s
        for k in range(2):
            x, y, z = (
                s / (2 * np.pi * frequency.value[k])
                for frequency in (self.frequencies, self.corners, self.zeros)
            )
            passed = 1 + 2 * self.zero_dampings.value[k] * z + z * z
            result = result * passed / (1 + y) / (1 + 2 * self.dampings.value[k] * x + x * x)
        return result

    def static_gain(self) -> ArrayLike:
        return self.gain.value

    def _filter(self, k: int) -> tuple[Array, Array, Array]:
        """A (3, 3), b (3,) and c (3,) of a filter, in states that are a signal and its rates over
        the pair's own rate."""
        rate = 2 * np.pi * self.frequencies.value[k]
        ratio, damping = self.frequencies.value[k] / self.corners.value[k], self.dampings.value[k]
        last = -jnp.stack(
            [jnp.ones(()) / ratio, (ratio + 2 * damping) / ratio, (1 + 2 * damping * ratio) / ratio]
        )
        a = rate * jnp.concatenate([jnp.eye(3)[1:], last[None]])
        high = self.frequencies.value[k] / self.zeros.value[k]
        c = jnp.stack([jnp.ones(()), 2 * self.zero_dampings.value[k] * high, high**2])
        return a, jnp.zeros(3).at[2].set(rate / ratio), c

    def system(self) -> System:
        (a1, b1, c1), (a2, b2, c2) = self._filter(0), self._filter(1)
        none = jnp.zeros(3)
        a = jnp.block([[a1, jnp.zeros((3, 3))], [jnp.outer(b2, c1), a2]])
        row = jnp.concatenate([none, self.gain.value * c2])
        return System(a, jnp.concatenate([b1, none]), row, 0.0)

    def ports(self) -> dict[str, Port]:
        (_, _, c1), (_, b2, _) = self._filter(0), self._filter(1)
        none = jnp.zeros(3)
        enters = jnp.concatenate([none, b2])
        position = jnp.concatenate([self.gain.value * c1, none])
        return {"between": Port("signal", enters, position, jnp.zeros(6), 0.0)}

    def placements(self, site: str) -> tuple[AbstractMachine, ...]:
        parameters = named_parameters(self)
        return tuple(
            set_values(
                self,
                {n: parameters[n].value[::-1] for part in compress(_PARTS, swaps) for n in part},
            )
            for swaps in product((False, True), repeat=len(_PARTS))
        )

    def scales(self) -> Array:
        return jnp.full(6, 1 / (jnp.abs(jnp.asarray(self.gain.value)) + 1e-12))
