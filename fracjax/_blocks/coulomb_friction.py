"""Dry friction of a guide, with presliding (Dahl), and sticking, weaker in fast motion (LuGre)."""

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

_LEAST, _FAR, _ITERATIONS = 1e-12, 600.0, 4


class CoulombFriction(AbstractBlock):
    r"""A guide's dry friction holds the motion back by what its force bends the actuator:

        x = y - a z(y),    dz = (1 - z sgn ẏ) dy / λ,    -1 ≤ z ≤ 1

    y [response] is the motion without friction, z the friction force over the Coulomb force f_c,
    a = f_c/k [response] the deflection by that force on the actuator's stiffness k, and
    λ = f_c/σ [response] the presliding length in which, after a reversal, the force builds up again
    on the stiffness σ of the contacts.  The law is rate-independent; between samples y counts as
    monotone, and then z goes to ±1 exactly as exp(-|Δy|/λ).  z starts from 0, and is steady with
    `periodic` history.
    Ranges: published presliding lengths go from 50 nm (ball on flat) to 10 µm (LuGre's standard
    parameters), 0.1 % to half of a piezo's stroke.
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
    r"""Dry friction that sees the motion it holds back, and is larger while that is slow (LuGre):

        x = y - a z,    dz = (1 - z sgn ẏ / g) dx / λ,    g = 1 + r exp(-(ẏ/v_s)²)

    a, λ and z as `CoulombFriction` has them, there with dy for dx: the same where a ≪ λ.  Where
    a ≫ λ the guide sticks until the actuator has pushed with f_c, and x is a play of y.  r: by how
    much of the Coulomb force the static one is larger, dimensionless; v_s [response/s] the speed at
    which that is lost.  LuGre's viscous share is that of a linear law, and left to the model.
    Over a grid's step ẏ counts as constant: then λ ln q + a q falls by |Δy|/g, q = 1 - z sgn ẏ / g,
    which is Lambert's function.
    Ranges: r a tenth to once, v_s where the recording's speeds lie.
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
        return drive - self.amplitude.value * follow(_pulled, stiffness, jnp.zeros(()), steps)


def _pulled(stiffness: Array, z: Array, at: tuple[Array, Array, Array]) -> Array:
    """The force after a step in a direction, by its way in presliding lengths and the largest force
    at its speed."""
    direction, way, largest = at
    left = 1 - z * direction / largest
    pulled = stiffness * jnp.maximum(left, _LEAST)
    after = _lambert(jnp.log(pulled) + pulled - way / largest) / stiffness
    # Above a force that motion has made smaller it slips, at once where the guide sticks.
    slipping = jnp.minimum(left, 0.0)
    room = jnp.maximum(1 + stiffness * slipping, _LEAST)
    after = jnp.where(left < 0, slipping * jnp.exp(-way / largest / room), after)
    return jnp.where(way > 0, direction * largest * (1 - after), z)


@jax.custom_jvp
def _lambert(logarithm: Array) -> Array:
    """w > 0 with w + ln w = logarithm."""
    most = jnp.maximum(logarithm, 1.0)
    w = jnp.where(
        logarithm > 1, most - jnp.log(most), jnp.exp(jnp.clip(logarithm, -_FAR, 1.0) - 0.4)
    )
    for _ in range(_ITERATIONS):
        w = w * (1 + jnp.maximum(logarithm, -_FAR) - jnp.log(w)) / (1 + w)
    return w


@_lambert.defjvp
def _(primals: tuple[Array], tangents: tuple[Array]) -> tuple[Array, Array]:
    """Of the equation, not of the steps that solve it: dw = w/(1 + w) d(logarithm)."""
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
    sentence="dry friction of a guide holds the motion back, so that after each reversal the "
    "displacement stays behind until the friction force has turned round",
    equation="x = y - a z, dz = (1 - z sgn(dy/dt)) dy/lambda, or dz = (1 - z sgn(dy/dt)/g) "
    "dx/lambda with g = 1 + r exp(-(dy/dt/v_s)^2)",
    source="Dahl, AIAA J. 14 (1976) 1675; Canudas de Wit et al., IEEE Trans. Autom. Control 40 "
    "(1995) 419",
    trials=_trials,
    separated_by={
        "backlash": "the same loop at creeping speed, where friction sticks and slips; and "
        "reversals smaller than the dead zone, to which friction still gives way",
        "minor_loop_memory": "loops of two amplitudes: friction's width stays, memory's grows with "
        "the amplitude",
        "quantisation": "slow ramps: a converter's steps repeat at the same levels, what friction "
        "holds back follows the reversals",
    },
    concealed_by="the width of the hysteresis loop, while one amplitude is driven",
    axes=("reversal", "phase", "harmonics"),
    one_sided=True,
)
