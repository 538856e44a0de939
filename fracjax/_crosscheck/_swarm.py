"""Particle swarm optimisation, the search of the 2024 paper."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._box import BATCH_SIZE, Objective, SearchResult

_INERTIA = 0.7298
"""w = χ, Clerc & Kennedy's constriction at φ = 4.1."""
_ATTRACTION = 1.49618
"""c = χ φ/2, by the same constriction."""


class _Draws(NamedTuple):
    """All random numbers of a search, P particles and T iterations over n dimensions.

    `positions` and `velocities` (P, n) are the first ones; `own` and `common` (T, P, n) are the
    weights r₁ and r₂ of the two attractions.
    """

    positions: Array
    velocities: Array
    own: Array
    common: Array


class ParticleSwarm(eqx.Module):
    """Particles attracted to their own best point p and to the best point of all, g:

        v ← w v + c r₁ (p - x) + c r₂ (g - x),     x ← x + v,     r₁, r₂ uniform in [0, 1]ⁿ

    A particle that would leave the cube stops at its face and turns back with half its velocity
    (Clerc, Standard Particle Swarm Optimisation, 2012); without the latter it would often stay
    there. The 2024 paper [F §4.2] names the search and prints neither its constants nor its size.
    w = χ and c = χ φ/2 are Clerc & Kennedy's constriction at φ = 4.1 (IEEE Trans. Evol. Comput. 6
    (2002) 58); the size was chosen by judgement.
    """

    particles: int = eqx.field(default=40, static=True)
    iterations: int = eqx.field(default=200, static=True)

    def draw(self, size: int, generator: np.random.Generator) -> _Draws:
        """All random numbers of a search over `size` dimensions."""
        positions, targets = jnp.asarray(generator.uniform(size=(2, self.particles, size)))
        weights = generator.uniform(size=(2, self.iterations, self.particles, size))
        own, common = jnp.asarray(weights)
        return _Draws(positions, (targets - positions) / 2, own, common)

    def __call__(self, objective: Objective, draws: _Draws) -> SearchResult:
        """The best point of `objective` that the search evaluated in the unit cube."""

        def step(state: tuple, weights: tuple[Array, Array]) -> tuple[tuple, None]:
            x, v, best, cost = state
            own, common = weights
            costs = jax.lax.map(objective, x, batch_size=BATCH_SIZE)
            better = costs < cost
            best, cost = jnp.where(better[:, None], x, best), jnp.where(better, costs, cost)
            leader = best[jnp.argmin(cost)]
            v = _INERTIA * v + _ATTRACTION * (own * (best - x) + common * (leader - x))
            inside = jnp.clip(x + v, 0, 1)
            return (inside, jnp.where(inside == x + v, v, -v / 2), best, cost), None

        # Initial costs are infinite, so the first step evaluates the points as drawn.
        x, v = draws.positions, draws.velocities
        infinite = jnp.full(self.particles, jnp.inf)
        (_, _, best, cost), _ = jax.lax.scan(step, (x, v, x, infinite), (draws.own, draws.common))
        leader = jnp.argmin(cost)
        return SearchResult(
            best[leader], cost[leader], jnp.asarray(self.particles * self.iterations)
        )
