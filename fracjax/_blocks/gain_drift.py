"""Gain that drifts as the actuator warms itself."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from ._relaxation import relax

_LEAST = 1e-12
"""The smallest base of a power whose exponent is fitted."""
_FASTEST, _SLOWEST = 0.01, 3600.0
"""The plausible time constants [s]; see the ranges of `GainDrift`."""


class GainDrift(AbstractBlock):
    r"""The actuator's own losses warm it, and its gain changes with its temperature:

        x = y + g (y - y_0 + z) T,    τ Ṫ + T = |ẏ/v|^p |(y - y_0)/s|^(2-p)

    T is the warming, relative to that of an endless motion of the rms speed v and the size s: both
    are the recording's, computed from its drive, so that g is the relative change of the gain after
    a long run at this drive.  Losses are proportional to the square of the amplitude; to the
    frequency for hysteresis (p = 1) and to its square for a viscous or an ohmic loss (p = 2).
    y_0 is the response before the first sample.  With `rest` history it is 0, since the first
    response to a drive that begins with a jump depends on the step.  If the drive jumps, losses
    with p > 1 depend on the step.
    The power in each step h, that of its mean speed and its midpoint, is constant over the step,
    and T follows it exactly: of second order.  The actuator is cold at the start; with `periodic`
    history it is warm, and T only ripples.
    Ranges: τ from 10 ms (a film on its electrode) over 1 s (a chip) to 1 h (a stack in a frame),
    and not less than s/v, the time of a reversal: a gain that follows the power within a cycle is
    not a drift; z within two strokes; the stroke was observed to grow by 15 % when driven at 10 kHz
    without cooling (Actuators 10 (2021) 297).  Ageing during the recording looks the same and is
    not in the catalogue: repeat the recording when the actuator is cool.

    Args:
        gain: initial g.
        zero: initial z.
        time_constant: initial τ.
        losses: initial p.
        speed: v [response/s].
        size: s [response].

    Attributes:
        gain: g, one number, dimensionless.
        zero: z, how far y_0 lies above the unknown zero of the displacement, one number [response].
        time_constant: τ, one number [s].
        losses: p, from 1 to 2, one number, dimensionless.
        speed: v, one number [response/s].
        size: s, one number [response].

    Source: Zheng, Takahashi, Yoshikawa, Uchino & de Vries, J. Am. Ceram. Soc. 79 (1996) 3193.
    """

    gain: Parameter
    zero: Parameter
    time_constant: Parameter
    losses: Parameter
    speed: Array | np.ndarray
    size: Array | np.ndarray

    def __init__(
        self,
        gain: float,
        zero: float,
        time_constant: float,
        losses: float = 2.0,
        *,
        speed: float,
        size: float,
    ):
        self.gain = Parameter(gain, plausible=(-0.2, 0.2), gain=True)
        self.zero = Parameter(
            zero, "response", lower=-10 * size, upper=10 * size, plausible=(-6 * size, 6 * size)
        )
        shortest = float(np.clip(size / speed, _FASTEST, _SLOWEST / 10))
        self.time_constant = Parameter(
            time_constant,
            "s",
            lower=1e-3,
            upper=1e4,
            plausible=(shortest, _SLOWEST),
            logarithmic=True,
        )
        self.losses = Parameter(losses, lower=1.0, upper=2.0)
        self.speed, self.size = np.asarray(speed, float), np.asarray(size, float)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        origin = grid.origin(drive)
        before = jnp.roll(drive, 1)
        if grid.history != "periodic":
            before = before.at[0].set(drive[0])
        speed = jnp.abs(drive - before) / (grid.step * self.speed)
        size = jnp.abs(0.5 * (drive + before) - origin) / self.size
        # A power of zero has no derivative with respect to its exponent.
        speed, size = (jnp.maximum(x, _LEAST) for x in (speed, size))
        power = speed**self.losses.value * size ** (2 - self.losses.value)
        exponents = jnp.full(drive.shape, grid.step / self.time_constant.value)
        warming = relax(power, exponents, grid.history)
        return drive + self.gain.value * (drive - origin + self.zero.value) * warming


def _trials(setting: Setting) -> list:
    slope = setting.response_span / setting.drive_span
    middle = setting.response_low + 0.5 * setting.response_span
    block = GainDrift(
        0.02, 0.0, 1.0, speed=slope * setting.rms_rate, size=0.35 * setting.response_span
    )
    usual = block.time_constant.plausible
    constants = np.unique(np.clip(setting.duration * np.array([0.1, 0.3, 1.0]), *usual))
    # The zero of the displacement lies at the first value, or in the middle of the stroke.
    return at_values(
        block,
        [
            {"time_constant": t, "zero": z, "losses": p}
            for t in constants
            for z in (0.0, -middle)
            for p in (1.0, 2.0)
        ],
    )


EFFECT = Effect(
    name="gain_drift",
    site="modulation",
    sentence="the actuator is warmed by its own losses and its gain changes with the temperature",
    equation="y + g (y - y0 + z) T, tau dT/dt + T = |dy/dt / v|^p |(y - y0)/s|^(2 - p)",
    source="Zheng et al., J. Am. Ceram. Soc. 79 (1996) 3193; Actuators 10 (2021) 297",
    trials=_trials,
    separated_by={
        "thermal_drift": "a record at constant drive after a hot run: drift continues, a change of "
        "gain shows only when the drive moves",
        "creep": "the same loop at two frequencies: a gain drifts with the power, creep with time",
    },
    concealed_by="the gain k_l, which absorbs its average; ageing looks the same until the "
    "recording is repeated when the actuator is cool",
    axes=("time", "level", "harmonics"),
)
