"""Dry friction of a guide: presliding (Dahl), and sticking that motion weakens (LuGre)."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from ._recursion import recursion, settled
from ._relaxation import relax

_LEAST = 1e-12
"""The smallest argument of a logarithm and of a quotient, against overflow."""
_FAR = 600.0
"""The largest |logarithm| of Lambert's function, against overflow of exp."""
_ITERATIONS = 4
"""Newton's steps for Lambert's function, which reach rounding error."""


class CoulombFriction(AbstractBlock):
    r"""A guide's dry friction reduces the motion by the deflection that its force causes:

        x = y - a z(y),    dz = (1 - z sgn ẏ) dy / λ,    -1 ≤ z ≤ 1

    y [response] is the motion without friction, and z the friction force over the Coulomb force
    f_c.  The model is rate-independent; between samples y is taken as monotone, and z then
    approaches ±1 exactly as exp(-|Δy|/λ).  z starts from 0, and is steady with `periodic` history.
    Ranges: published presliding lengths go from 50 nm (ball on flat) to 10 µm (LuGre's standard
    parameters), 0.1 % to half of a piezo's stroke.

    Args:
        amplitude: initial a.
        presliding: initial λ.
        span: peak to peak of the response [response].

    Attributes:
        amplitude: a = f_c/k, the deflection by the Coulomb force on the actuator's stiffness k, one
            number [response].
        presliding: λ = f_c/σ, the length in which the force builds up again after a reversal on the
            stiffness σ of the contacts, one number [response].

    Source: Dahl, AIAA J. 14 (1976) 1675; Canudas de Wit, Olsson, Åström & Lischinsky, IEEE Trans.
    Autom. Control 40 (1995) 419.
    """

    amplitude: Parameter
    presliding: Parameter

    def __init__(self, amplitude: float, presliding: float, *, span: float):
        self.amplitude = Parameter(amplitude, "response", plausible=(0.0, 0.2 * span), gain=True)
        self.presliding = Parameter(
            presliding,
            "response",
            lower=2e-4 * span,
            upper=2 * span,
            plausible=(1e-3 * span, 0.5 * span),
            logarithmic=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        moves = grid.changes(drive)
        force = relax(jnp.sign(moves), jnp.abs(moves) / self.presliding.value, grid.history)
        return drive - self.amplitude.value * force


class LuGreFriction(AbstractBlock):
    r"""Dry friction that depends on the reduced motion, and is larger in slow motion (LuGre):

        x = y - a z,    dz = (1 - z sgn ẏ / g) dx / λ,    g = 1 + r exp(-(ẏ/v_s)²)

    a, λ and z are those of `CoulombFriction`, which has dy instead of dx: both agree for a ≪ λ.
    For a ≫ λ the guide sticks until the actuator has pushed with f_c, and x is a play of y.
    LuGre's viscous term is linear; it is left to the base model.
    Within a step of the grid ẏ is taken as constant: then λ ln q + a q, with q = 1 - z sgn ẏ / g,
    decreases by |Δy|/g, which Lambert's function solves.
    Ranges: r from 0.1 to 1, v_s among the recording's speeds.

    Args:
        amplitude: initial a.
        presliding: initial λ.
        excess: initial r.
        speed: initial v_s.
        span: peak to peak of the response [response].

    Attributes:
        amplitude: a, one number [response].
        presliding: λ, one number [response].
        excess: r, by which share the static force exceeds the Coulomb force, one number,
            dimensionless.
        speed: v_s, the speed at which that excess is lost, one number [response/s].

    Source: Canudas de Wit, Olsson, Åström & Lischinsky, IEEE Trans. Autom. Control 40 (1995) 419.
    """

    amplitude: Parameter
    presliding: Parameter
    excess: Parameter
    speed: Parameter

    def __init__(
        self, amplitude: float, presliding: float, excess: float, speed: float, *, span: float
    ):
        self.amplitude = Parameter(
            amplitude,
            "response",
            lower=1e-6 * span,
            upper=span,
            plausible=(1e-5 * span, 0.2 * span),
            logarithmic=True,
        )
        self.presliding = CoulombFriction(amplitude, presliding, span=span).presliding
        self.excess = Parameter(excess, lower=0.0, upper=3.0, plausible=(0.0, 1.0))
        self.speed = Parameter(
            speed,
            "response/s",
            lower=1e-2 * speed,
            upper=1e2 * speed,
            plausible=(3e-2 * speed, 30 * speed),
            logarithmic=True,
        )

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: Grid) -> Array:
        moves = grid.changes(drive)
        slow = jnp.exp(-((moves / grid.step / self.speed.value) ** 2))
        stiffness = self.amplitude.value / self.presliding.value
        ways = jnp.abs(moves) / self.presliding.value

        steps = (jnp.sign(moves), ways, 1 + self.excess.value * slow)
        follow = settled if grid.history == "periodic" else recursion
        force = follow(_force_after_step, stiffness, jnp.zeros(()), steps)
        return drive - self.amplitude.value * force


def _force_after_step(stiffness: Array, z: Array, at: tuple[Array, Array, Array]) -> Array:
    """The force z after a step, from its direction, its length in presliding lengths and the
    largest force at its speed, all dimensionless."""
    direction, way, largest = at
    reserve = 1 - z * direction / largest
    scaled = stiffness * jnp.maximum(reserve, _LEAST)
    after = _lambert(jnp.log(scaled) + scaled - way / largest) / stiffness
    # The guide slips where motion has lowered the largest force below z, at once where it sticks.
    slipping = jnp.minimum(reserve, 0.0)
    room = jnp.maximum(1 + stiffness * slipping, _LEAST)
    after = jnp.where(reserve < 0, slipping * jnp.exp(-way / largest / room), after)
    return jnp.where(way > 0, direction * largest * (1 - after), z)


@jax.custom_jvp
def _lambert(logarithm: Array) -> Array:
    """Lambert's function of exp(logarithm): w > 0 with w + ln w = logarithm."""
    most = jnp.maximum(logarithm, 1.0)
    w = jnp.where(
        logarithm > 1, most - jnp.log(most), jnp.exp(jnp.clip(logarithm, -_FAR, 1.0) - 0.4)
    )
    for _ in range(_ITERATIONS):
        w = w * (1 + jnp.maximum(logarithm, -_FAR) - jnp.log(w)) / (1 + w)
    return w


@_lambert.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """The derivative of the equation, not of its iterations: dw = w/(1 + w) d(logarithm)."""
    w = _lambert(*primals)
    return w, w / (1 + w) * tangents[0]


def _trials(setting: Setting) -> list:
    span = setting.response_span
    block = CoulombFriction(0.01 * span, 0.05 * span, span=span)
    shares = np.geomspace(0.004, 0.4, 8)
    speed = 0.2 * span * setting.top_rate / setting.drive_span
    sticking = LuGreFriction(0.01 * span, 0.01 * span, 0.2, speed, span=span)
    return [
        *at_values(block, [{"presliding": share * span} for share in shares]),
        *at_values(sticking, [{"presliding": share * span} for share in (0.003, 0.02, 0.15)]),
    ]


EFFECT = Effect(
    name="coulomb_friction",
    site="force",
    sentence="dry friction of a guide resists the motion, so that after each reversal the "
    "displacement stays behind until the friction force has changed its direction",
    equation="x = y - a z, dz = (1 - z sgn(dy/dt)) dy/lambda, or dz = (1 - z sgn(dy/dt)/g) "
    "dx/lambda with g = 1 + r exp(-(dy/dt/v_s)^2)",
    source="Dahl, AIAA J. 14 (1976) 1675; Canudas de Wit et al., IEEE Trans. Autom. Control 40 "
    "(1995) 419",
    trials=_trials,
    separated_by={
        "backlash": "the same loop at very low speed, where friction sticks and slips; and "
        "reversals smaller than the dead zone, in which only friction still moves",
        "minor_loop_memory": "loops of two amplitudes: friction keeps its width, memory widens "
        "with the amplitude",
        "quantisation": "slow ramps: a converter's steps repeat at the same levels, friction "
        "follows the reversals",
    },
    concealed_by="the width of the hysteresis loop, if the drive has one amplitude",
    axes=("reversal", "phase", "harmonics"),
    one_sided=True,
    rate_independent=True,
)
