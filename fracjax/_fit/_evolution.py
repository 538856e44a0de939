"""Differential evolution, the search of the 2012 paper."""

from __future__ import annotations

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from ._box import Found, Objective

_SCALE = 0.5
_CROSSOVER = 0.9
_AT_ONCE = 8


class DifferentialEvolution(eqx.Module):
    r"""A population whose members are challenged by mixtures of three others, DE/rand/1/bin:

        v = x_a + F (x_b - x_c),     u_j = v_j with probability CR, and for one j always; else x_j

    u takes x's place where it is no worse.  A mutant that leaves the cube is drawn anew between its
    base x_a and the face it passed (Price, Storn & Lampinen, Differential Evolution, 2005).  The
    2012 paper [L §4.2] names an "improved" evolution and does not describe it; this is the original
    with its first choices F = 0.5, CR = 0.9 (Storn & Price, J. Global Optim. 11 (1997) 341).
    """

    members: int = eqx.field(default=40, static=True)
    generations: int = eqx.field(default=200, static=True)

    def __call__(self, objective: Objective, size: int, key: Array) -> Found:
        """The least of `objective` that was seen over the unit cube of so many dimensions."""
        draw, walk = jax.random.split(key)
        indices = jnp.arange(self.members)

        def challenger(x: Array, index: Array, key: Array) -> Array:
            choose, bounce, cross, always = jax.random.split(key, 4)
            others = jax.random.choice(choose, self.members - 1, (3,), replace=False)
            a, b, c = jnp.unstack(x[others + (others >= index)])
            mutant = a + _SCALE * (b - c)
            share = jax.random.uniform(bounce, (size,))
            mutant = jnp.where(mutant < 0, share * a, mutant)
            mutant = jnp.where(mutant > 1, a + share * (1 - a), mutant)
            always_taken = jnp.arange(size) == jax.random.randint(always, (), 0, size)
            taken = always_taken | (jax.random.uniform(cross, (size,)) < _CROSSOVER)
            return jnp.where(taken, mutant, x[index])

        def generation(state: tuple, key: Array) -> tuple[tuple, None]:
            x, cost, trial = state
            found = jax.lax.map(objective, trial, batch_size=_AT_ONCE)
            better = found <= cost
            x, cost = jnp.where(better[:, None], trial, x), jnp.where(better, found, cost)
            keys = jax.random.split(key, self.members)
            return (x, cost, jax.vmap(challenger, (None, 0, 0))(x, indices, keys)), None

        # Nothing has been seen yet, so that the first generation is the drawn one.
        unseen = jnp.full(self.members, jnp.inf)
        x = jax.random.uniform(draw, (self.members, size))
        keys = jax.random.split(walk, self.generations)
        (x, cost, _), _ = jax.lax.scan(generation, (x, unseen, x), keys)
        best = jnp.argmin(cost)
        return Found(x[best], cost[best], jnp.asarray(self.members * self.generations))
