"""Several modes of one structure."""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

from .._parameters import Parameter, set_values
from ._machine import AbstractMachine
from ._port import Port, System
from .oscillator import _POWERS, Measured, gain_unit


class Modes(AbstractMachine):
    r"""A structure as the sum of its modes:

        G(s) = s^q Σ_i g_i / (1 + 2 ζ_i s/ω_i + s²/ω_i²) + d,    ω_i = 2π f_i,   i = 1 … n

    The response is a position (q = 0), velocity or acceleration; d stands for modes beyond the
    band.  With two states for each mode, z_i and its rate, z̈_i + 2 ζ_i ω_i ż_i + ω_i² z_i = ω_i² u.
    At the port `joint` a force acts between two parts of the structure, in units of the drive: it
    enters mode i by the share φ_i, and its position is the sum of φ_i z_i, as reciprocity has it.
    No linear recording tells the shares: a diagnosis tries the joint in each mode alone, and fits
    them from there.

    Args:
        gains: initial g_i (n,).
        frequencies: initial f_i (n,).
        dampings: initial ζ_i (n,).
        measured: "position", "velocity" or "acceleration".

    Attributes:
        gains: g_i (n,) [position/drive], the position in response units times 1, s or s².
        frequencies: f_i (n,) [Hz].
        dampings: ζ_i (n,), dimensionless.
        joint: φ_i (n,) the joint's share in each mode, dimensionless; what acts there frees it.
        direct: d, one number [response/drive].
        measured: what the response is.

    Source: Ewins, Modal Testing (2000), section 2.4; Preumont, Vibration Control of Active
    Structures (2011), chapter 2.
    """

    gains: Parameter
    frequencies: Parameter
    dampings: Parameter
    joint: Parameter
    direct: Parameter
    measured: Measured = eqx.field(static=True)

    def __init__(
        self,
        gains: Sequence[float] | np.ndarray = (1.0, 0.5),
        frequencies: Sequence[float] | np.ndarray = (50.0, 120.0),
        dampings: Sequence[float] | np.ndarray = (0.02, 0.02),
        measured: Measured = "position",
    ):
        start = np.asarray(frequencies, dtype=float)
        self.gains = Parameter(np.asarray(gains), gain_unit(measured), gain=True)
        self.frequencies = Parameter(
            start, "Hz", lower=1e-6, upper=1e8, plausible=(start / 2, 2 * start), logarithmic=True
        )
        self.dampings = Parameter(
            np.asarray(dampings), lower=1e-4, upper=2.0, plausible=(2e-3, 0.2), logarithmic=True
        )
        self.joint = Parameter(np.ones(start.shape), lower=-1e3, upper=1e3, fixed=True)
        self.direct = Parameter(0.0, "response/drive", gain=True)
        self.measured = measured

    @property
    def accuracy(self) -> int:
        return 3

    def symbol(self, s: Array) -> Array:
        total = self.direct.value + 0 * s
        for k in range(np.shape(self.gains.value)[0]):
            x = s / (2 * np.pi * self.frequencies.value[k])
            mode = self.gains.value[k] / (1 + 2 * self.dampings.value[k] * x + x * x)
            total = total + mode * s ** _POWERS[self.measured]
        return total

    def static_gain(self) -> ArrayLike:
        moving = jnp.sum(jnp.asarray(self.gains.value)) if self.measured == "position" else 0.0
        return self.direct.value + moving

    def system(self) -> System:
        w = 2 * np.pi * jnp.asarray(self.frequencies.value)
        n, gains = w.size, jnp.asarray(self.gains.value)
        below, middle = (
            jnp.concatenate([-jnp.diag(w**2), -2 * jnp.diag(self.dampings.value * w)], 1),
            jnp.zeros(n),
        )
        a = jnp.concatenate([jnp.concatenate([jnp.zeros((n, n)), jnp.eye(n)], 1), below])
        b = jnp.concatenate([middle, w**2])
        rows = {
            "position": jnp.concatenate([gains, middle]),
            "velocity": jnp.concatenate([middle, gains]),
            "acceleration": gains @ below,
        }
        direct = self.direct.value + (gains @ w**2 if self.measured == "acceleration" else 0.0)
        return System(a, b, rows[self.measured], direct)

    def ports(self) -> dict[str, Port]:
        w, shares = 2 * np.pi * jnp.asarray(self.frequencies.value), jnp.asarray(self.joint.value)
        middle = jnp.zeros(w.size)
        direct = 0.0
        if self.measured == "acceleration":
            direct = jnp.asarray(self.gains.value) @ (shares * w**2)
        enters = jnp.concatenate([middle, shares * w**2])
        position, velocity = jnp.concatenate([shares, middle]), jnp.concatenate([middle, shares])
        return {"joint": Port("force", enters, position, velocity, direct)}

    def opened(self, site: str) -> Modes:
        return eqx.tree_at(lambda block: block.joint, self, self.joint.freed())

    def placements(self, site: str) -> tuple[AbstractMachine, ...]:
        # Where the joint is, is unknown: in each mode alone, from where a fit finds its shares.
        return tuple(
            set_values(self, {"joint": shares}) for shares in np.eye(np.size(self.joint.value))
        )

    def scales(self) -> Array:
        w, size = (
            2 * np.pi * jnp.asarray(self.frequencies.value),
            jnp.abs(jnp.asarray(self.gains.value)) + 1e-12,
        )
        # Of the modes' states by the response that they make.
        power = _POWERS[self.measured]
        return jnp.concatenate([w**-power / size, w ** (1 - power) / size])
