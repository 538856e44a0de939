"""Differential evolution, the search of the 2012 paper."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._box import AT_ONCE, Found, Objective

_SCALE = 0.5
_CROSSOVER = 0.9


class _Draws(NamedTuple):
    """First members (P, n), and of every generation each member's three others (G, P, 3), what it
    takes from its mutant (G, P, n) and how far back from a face that one falls (G, P, n)."""

    members: Array
    others: Array
    taken: Array
    back: Array


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

    def draw(self, size: int, generator: np.random.Generator) -> _Draws:
        """All chance of a search over so many dimensions."""
        shape = (self.generations, self.members, size)
        always = np.arange(size) == generator.integers(size, size=(*shape[:2], 1))
        return _Draws(
            members=jnp.asarray(generator.uniform(size=shape[1:])),
            others=jnp.asarray(self._others(generator)),
            taken=jnp.asarray(always | (generator.uniform(size=shape) < _CROSSOVER)),
            back=jnp.asarray(generator.uniform(size=shape)),
        )

    def _others(self, generator: np.random.Generator) -> np.ndarray:
        """For every member of every generation three others, all different."""
        shape = (self.generations, self.members)
        chosen = np.broadcast_to(np.arange(self.members), (1, *shape))
        for k in range(1, 4):
            drawn = generator.integers(self.members - k, size=shape)
            for taken in np.sort(chosen, axis=0):
                drawn = drawn + (drawn >= taken)
            chosen = np.concatenate([chosen, drawn[None]])
        return np.moveaxis(chosen[1:], 0, -1)

    def __call__(self, objective: Objective, draws: _Draws) -> Found:
        """The least of `objective` that was seen over the unit cube."""

        def generation(state: tuple, drawn: tuple[Array, Array, Array]) -> tuple[tuple, None]:
            x, cost, trial = state
            others, taken, back = drawn
            found = jax.lax.map(objective, trial, batch_size=AT_ONCE)
            better = found <= cost
            x, cost = jnp.where(better[:, None], trial, x), jnp.where(better, found, cost)
            a, b, c = jnp.unstack(x[others], axis=1)
            mutant = a + _SCALE * (b - c)
            mutant = jnp.where(mutant < 0, back * a, mutant)
            mutant = jnp.where(mutant > 1, a + back * (1 - a), mutant)
            return (x, cost, jnp.where(taken, mutant, x)), None

        # Nothing has been seen yet, so that the first generation is the drawn one.
        x, unseen = draws.members, jnp.full(self.members, jnp.inf)
        drawn = (draws.others, draws.taken, draws.back)
        (x, cost, _), _ = jax.lax.scan(generation, (x, unseen, x), drawn)
        best = jnp.argmin(cost)
        return Found(x[best], cost[best], jnp.asarray(self.members * self.generations))
