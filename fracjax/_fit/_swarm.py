"""Particle swarm optimisation, the search of the 2024 paper."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from ._box import Found, Objective

_INERTIA = 0.7298
_ATTRACTION = 1.49618
_AT_ONCE = 8


class ParticleSwarm(eqx.Module):
    r"""Particles drawn to their own best point p and to the best of all, g:

        v ← w v + c r₁ (p - x) + c r₂ (g - x),     x ← x + v,     r₁, r₂ uniform in [0, 1]ⁿ

    A particle that would leave the cube stops at its face.  The 2024 paper [F §4.2] names the
    search and prints neither its constants nor its size: w = χ and c = χ φ/2 are Clerc & Kennedy's
    constriction at φ = 4.1 (IEEE Trans. Evol. Comput. 6 (2002) 58); the size is ours.
    """

    particles: int = eqx.field(default=40, static=True)
    iterations: int = eqx.field(default=200, static=True)

    def __call__(self, objective: Objective, size: int, key: Array) -> Found:
        """The least of `objective` that was seen over the unit cube of so many dimensions."""
        draw, aim, walk = jax.random.split(key, 3)
        shape = (self.particles, size)
        x = jax.random.uniform(draw, shape)
        v = (jax.random.uniform(aim, shape) - x) / 2

        def step(state: tuple, key: Array) -> tuple[tuple, None]:
            x, v, best, cost = state
            found = jax.lax.map(objective, x, batch_size=_AT_ONCE)
            better = found < cost
            best, cost = jnp.where(better[:, None], x, best), jnp.where(better, found, cost)
            leader = best[jnp.argmin(cost)]
            own, common = jax.random.uniform(key, (2, *shape))
            v = _INERTIA * v + _ATTRACTION * (own * (best - x) + common * (leader - x))
            inside = jnp.clip(x + v, 0, 1)
            return (inside, jnp.where(inside == x + v, v, 0), best, cost), None

        # Nothing has been seen yet, so that the first step looks at the points as drawn.
        unseen = jnp.full(self.particles, jnp.inf)
        keys = jax.random.split(walk, self.iterations)
        (_, _, best, cost), _ = jax.lax.scan(step, (x, v, x, unseen), keys)
        leader = jnp.argmin(cost)
        return Found(best[leader], cost[leader], jnp.asarray(self.particles * self.iterations))
