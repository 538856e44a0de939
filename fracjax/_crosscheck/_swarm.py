"""Particle swarm optimisation, the search of the 2024 paper."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._box import AT_ONCE, Found, Objective

_INERTIA = 0.7298
_ATTRACTION = 1.49618


class _Draws(NamedTuple):
    """First places and velocities (P, n); both attractions' weights, (T, P, n) each."""

    places: Array
    velocities: Array
    own: Array
    common: Array


class ParticleSwarm(eqx.Module):
    r"""Particles drawn to their own best point p and to the best of all, g:

        v ← w v + c r₁ (p - x) + c r₂ (g - x),     x ← x + v,     r₁, r₂ uniform in [0, 1]ⁿ

    A particle that would leave the cube stops at its face and turns back with half its velocity
    (Clerc, Standard Particle Swarm Optimisation, 2012); one that only stopped would often stay.
    The 2024 paper [F §4.2] names the search and prints neither its constants nor its size: w = χ
    and c = χ φ/2 are Clerc & Kennedy's constriction at φ = 4.1 (IEEE Trans. Evol. Comput. 6 (2002)
    58); the size is ours.
    """

    particles: int = eqx.field(default=40, static=True)
    iterations: int = eqx.field(default=200, static=True)

    def draw(self, size: int, generator: np.random.Generator) -> _Draws:
        """All chance of a search over so many dimensions."""
        places, aims = jnp.asarray(generator.uniform(size=(2, self.particles, size)))
        weights = generator.uniform(size=(2, self.iterations, self.particles, size))
        own, common = jnp.asarray(weights)
        return _Draws(places, (aims - places) / 2, own, common)

    def __call__(self, objective: Objective, draws: _Draws) -> Found:
        """The least of `objective` that was seen over the unit cube."""

        def step(state: tuple, weights: tuple[Array, Array]) -> tuple[tuple, None]:
            x, v, best, cost = state
            own, common = weights
            found = jax.lax.map(objective, x, batch_size=AT_ONCE)
            better = found < cost
            best, cost = jnp.where(better[:, None], x, best), jnp.where(better, found, cost)
            leader = best[jnp.argmin(cost)]
            v = _INERTIA * v + _ATTRACTION * (own * (best - x) + common * (leader - x))
            inside = jnp.clip(x + v, 0, 1)
            return (inside, jnp.where(inside == x + v, v, -v / 2), best, cost), None

        # Nothing has been seen yet, so that the first step looks at the points as drawn.
        x, v = draws.places, draws.velocities
        unseen = jnp.full(self.particles, jnp.inf)
        (_, _, best, cost), _ = jax.lax.scan(step, (x, v, x, unseen), (draws.own, draws.common))
        leader = jnp.argmin(cost)
        return Found(best[leader], cost[leader], jnp.asarray(self.particles * self.iterations))
