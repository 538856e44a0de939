"""Effects of the stage that the actuator pushes: inertia, clearance, friction, contact."""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from ..drives import Array
from .branches import Sliding
from .linear import state_space


def resonance(t: Array, y: Array, period: float, zeta: float) -> Array:
    """Mass-spring-damper x'' + 2 zeta w x' + w^2 x = w^2 y, w = 2 pi/period, from rest."""
    if period <= 0:
        return y
    w = 2 * np.pi / period
    a = np.array([[0.0, 1.0], [-w * w, -2 * zeta * w]])
    v = y - y[0]
    return y[0] + state_space(v, t[1] - t[0], a, np.array([0, w * w]), np.array([1.0, 0]))


def second_mode(
    t: Array, y: Array, period: float, mass: float, ratio: float, zetas: list[float]
) -> Array:
    """Two masses: the driven one (read by the sensor) carries `mass` times itself on a spring.

    x'' + 2 z1 w x' + w^2 (x - y) = mass (2 z2 v (p' - x') + v^2 (p - x)),
    p'' = -2 z2 v (p' - x') - v^2 (p - x), w = 2 pi/period, v = ratio w: two modes and a notch at v.
    """
    if period <= 0:
        return y
    w = 2 * np.pi / period
    v, (z1, z2) = ratio * w, zetas
    k, c = v * v, 2 * z2 * v
    a = np.array(
        [
            [0, 1, 0, 0],
            [-w * w - mass * k, -2 * z1 * w - mass * c, mass * k, mass * c],
            [0, 0, 0, 1],
            [k, c, -k, -c],
        ]
    )
    read, b = np.array([1.0, 0, 0, 0]), np.array([0, w * w, 0, 0])
    return y[0] + state_space(y - y[0], t[1] - t[0], a, b, read)


def backlash(t: Array, y: Array, radius: float, weight: float, sharpness: float) -> Array:
    """y - weight z: the gap z in [-r, r] is taken up as dz = dy (1 - |z/r|^n) with n = sharpness.

    At n = infinity this is the play operator, y - z; engagement is rounded over about r/n (um).
    """
    if radius <= 0:
        return y
    return y - weight * radius * Sliding(sharpness, 0.0).along(y, 1 / radius)


def coulomb_friction(
    t: Array, y: Array, force: float, bristle: float, stick: float, stribeck: float
) -> Array:
    """y - force * F: LuGre friction on the response's velocity v, F = z/bristle in units of f_c.

    z' = v - |v| z/(bristle g(v)), g = 1 + stick exp(-(v/stribeck)^2); force = f_c/k and bristle in
    um, stribeck in um/s. v is constant in a fine step, which is then solved exactly.
    """
    dy, h = np.diff(y), t[1] - t[0]
    g = bristle * (1 + stick * np.exp(-((dy / (h * stribeck)) ** 2)))
    x = np.abs(dy) / g
    keep, enter = np.exp(-x).tolist(), (-np.expm1(-x) * np.sign(dy) * g).tolist()
    steps = zip(keep, enter, strict=True)
    z = list(accumulate(steps, lambda s, ab: ab[0] * s + ab[1], initial=0.0))
    return y - force / bristle * np.array(z)


def lost_contact(t: Array, y: Array, rest: float, dent: float) -> Array:
    """Stage lies on a stop at `rest` (um) until a Hertzian contact pushes it off: x >= rest.

    Balance dent^(-1/2) p^(3/2) = x - rest, x = y - p - and x = rest out of contact: the
    penetration p (um) is stiff for a small `dent`, the p at which contact and stage are equal.
    """
    if dent <= 0:
        return np.maximum(y, rest)
    gap = np.maximum(y - rest, 0.0)
    # s = sqrt(p/dent): s^2 + s^3 = gap/dent, by Newton from above (convex: it cannot overshoot)
    g = gap / dent
    s = np.minimum(np.sqrt(g), np.cbrt(g)) + 1e-12
    for _ in range(40):
        s = s - (s * s + s**3 - g) / (2 * s + 3 * s * s)
        s = np.maximum(s, 1e-12)
    return rest + dent * s**3
