"""Dry friction of a guide, with presliding (Dahl)."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from .._operators import Grid
from .._parameters import Parameter
from ._block import AbstractBlock
from ._effect import Effect, Setting, at_values
from ._relaxation import relax


class CoulombFriction(AbstractBlock):
    r"""A guide's dry friction holds the motion back by what its force bends the actuator:

        x = y - a z(y),    dz = (1 - z sgn ẏ) dy / λ,    -1 ≤ z ≤ 1

    y [response] is the motion without friction, z the friction force over the Coulomb force f_c,
    a = f_c/k [response] the deflection by that force on the actuator's stiffness k, and
    λ = f_c/σ [response] the presliding length in which, after a reversal, the force builds up again
    on the stiffness σ of the contacts.  The law is rate-independent; between samples y counts as
    monotone, and then z goes to ±1 exactly as exp(-|Δy|/λ).  z starts from 0, and is steady with
    `periodic` history.  Velocity's own share (Stribeck, viscous) is left out.
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
        before = {"rest": 0.0, "constant": drive[0], "periodic": drive[-1]}[grid.history]
        moves = jnp.diff(drive, prepend=before)
        force = relax(jnp.sign(moves), jnp.abs(moves) / self.presliding.value, grid.history)
        return drive - self.amplitude.value * force


def _trials(setting: Setting) -> list:
    span = setting.response_span
    block = CoulombFriction(0.01 * span, 0.05 * span, span=span)
    shares = np.geomspace(0.004, 0.4, 8)
    return at_values(block, [{"presliding": share * span} for share in shares])


EFFECT = Effect(
    name="coulomb_friction",
    site="force",
    sentence="dry friction of a guide holds the motion back, so that after each reversal the "
    "displacement stays behind until the friction force has turned round",
    equation="y - a z(y), dz = (1 - z sgn(dy/dt)) dy/lambda",
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
