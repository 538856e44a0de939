"""Stores that fill and drain, one or two in series: lags of any length."""

from __future__ import annotations

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter
from ._machine import AbstractMachine
from ._port import Port, System


class Lag(AbstractMachine):
    r"""One store, or two in series, each of which drains in proportion to its level:

        τ_1 dx_1/dt = g u - x_1,    dx_2/dt = x_1/τ_1 - x_2/τ_2
        G(s) = g / (1 + τ_1 s),     or (τ_2/τ_1) g / ((1 + τ_1 s)(1 + τ_2 s))

    The response is the level of the last store, such as a tank's, a temperature or a charge.  What
    leaves the first enters the second.  At the ports acts a flow into a store, in units of the
    drive: at `outflow` into the first, where it is taken from the second, at `last` into the last
    of two.

    Args:
        gain: initial g.
        time_constants: initial τ of each store, one or two.

    Attributes:
        gain: g, one number [response/drive].
        time_constants: τ (1,) or (2,) [s].

    Source: Ogata, Modern Control Engineering (2010), section 4.2, liquid-level systems; Schoukens
    & Noël, IFAC-PapersOnLine 50 (2017) 446, cascaded tanks.
    """

    gain: Parameter
    time_constants: Parameter

    def __init__(self, gain: float = 1.0, time_constants: Sequence[float] | np.ndarray = (1.0,)):
        start = np.atleast_1d(np.asarray(time_constants, dtype=float))
        self.gain = Parameter(gain, "response/drive", gain=True)
        self.time_constants = Parameter(
            start, "s", lower=1e-9, upper=1e9, plausible=(start / 20, 20 * start), logarithmic=True
        )

    def symbol(self, s: Array) -> Array:
        constants = self.time_constants.value
        result = self.gain.value * constants[-1] / constants[0] + 0 * s
        for k in range(np.shape(constants)[0]):
            result = result / (1 + constants[k] * s)
        return result

    def static_gain(self) -> ArrayLike:
        constants = self.time_constants.value
        return self.gain.value * constants[-1] / constants[0]

    def system(self) -> System:
        rates = 1 / jnp.asarray(self.time_constants.value)
        enters = jnp.zeros(rates.size).at[0].set(self.gain.value * rates[0])
        a = -jnp.diag(rates) + jnp.diag(rates[:-1], -1)
        return System(a, enters, jnp.eye(rates.size)[-1], 0.0)

    def ports(self) -> dict[str, Port]:
        _, enters, _, _ = self.system()
        rows, flow, none = jnp.eye(enters.size), enters[0], jnp.zeros(enters.size)
        if enters.size == 1:
            return {"outflow": Port("flow", flow * rows[0], rows[0], none, 0.0)}
        return {
            "outflow": Port("flow", flow * (rows[0] - rows[1]), rows[0], none, 0.0),
            "last": Port("flow", flow * rows[1], rows[1], none, 0.0),
        }

    def scales(self) -> Array:
        return jnp.ones(np.shape(self.time_constants.value))
