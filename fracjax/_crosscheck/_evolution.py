"""Differential evolution, the search of the 2012 paper."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ._box import BATCH_SIZE, Objective, SearchResult

_SCALE = 0.5
"""F, the factor of the difference of two members: Storn & Price's first choice."""
_CROSSOVER = 0.9
"""CR, the probability that a coordinate comes from the mutant: their first choice."""


class _Draws(NamedTuple):
    """All random numbers of a search, P members and G generations over n dimensions.

    `members` (P, n) are the first members, `others` (G, P, 3) the indices of the three members that
    form each mutant, `crossed` (G, P, n) which coordinates come from the mutant, and `back` (G, P,
    n) where a coordinate that left the cube is placed: its distance from the face, over that of the
    base x_a.
    """

    members: Array
    others: Array
    crossed: Array
    back: Array


class DifferentialEvolution(eqx.Module):
    """A population whose members are challenged by mixtures of three others, DE/rand/1/bin:

        v = x_a + F (x_b - x_c),     u_j = v_j with probability CR, and for one j always; else x_j

    u replaces x if its objective is not larger.  A coordinate of a mutant that leaves the cube is
    drawn between its base x_a and the face it passed (Price, Storn & Lampinen, Differential
    Evolution, 2005).  The 2012 paper [L §4.2] names an "improved" evolution without describing it;
    this is the original with its first choices F = 0.5, CR = 0.9 (Storn & Price, J. Global Optim.
    11 (1997) 341).
    """

    members: int = eqx.field(default=40, static=True)
    generations: int = eqx.field(default=200, static=True)

    def draw(self, size: int, generator: np.random.Generator) -> _Draws:
        """All random numbers of a search over `size` dimensions."""
        shape = (self.generations, self.members, size)
        always = np.arange(size) == generator.integers(size, size=(*shape[:2], 1))
        return _Draws(
            members=jnp.asarray(generator.uniform(size=shape[1:])),
            others=jnp.asarray(self._others(generator)),
            crossed=jnp.asarray(always | (generator.uniform(size=shape) < _CROSSOVER)),
            back=jnp.asarray(generator.uniform(size=shape)),
        )

    def _others(self, generator: np.random.Generator) -> np.ndarray:
        """Indices (G, P, 3) of three other members for each member, all different."""
        shape = (self.generations, self.members)
        chosen = np.broadcast_to(np.arange(self.members), (1, *shape))
        for k in range(1, 4):
            drawn = generator.integers(self.members - k, size=shape)
            for earlier in np.sort(chosen, axis=0):
                drawn = drawn + (drawn >= earlier)
            chosen = np.concatenate([chosen, drawn[None]])
        return np.moveaxis(chosen[1:], 0, -1)

    def __call__(self, objective: Objective, draws: _Draws) -> SearchResult:
        """The best point of `objective` that the search evaluated in the unit cube."""

        def generation(state: tuple, drawn: tuple[Array, Array, Array]) -> tuple[tuple, None]:
            x, cost, trial = state
            others, crossed, back = drawn
            costs = jax.lax.map(objective, trial, batch_size=BATCH_SIZE)
            better = costs <= cost
            x, cost = jnp.where(better[:, None], trial, x), jnp.where(better, costs, cost)
            a, b, c = jnp.unstack(x[others], axis=1)
            mutant = a + _SCALE * (b - c)
            mutant = jnp.where(mutant < 0, back * a, mutant)
            mutant = jnp.where(mutant > 1, a + back * (1 - a), mutant)
            return (x, cost, jnp.where(crossed, mutant, x)), None

        # Initial costs are infinite, so the first generation is the drawn one.
        x, infinite = draws.members, jnp.full(self.members, jnp.inf)
        drawn = (draws.others, draws.crossed, draws.back)
        (x, cost, _), _ = jax.lax.scan(generation, (x, infinite, x), drawn)
        best = jnp.argmin(cost)
        return SearchResult(x[best], cost[best], jnp.asarray(self.members * self.generations))
