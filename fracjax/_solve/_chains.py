"""A block as a sum of chains of linear laws, the form in which its response can be compressed."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from .._blocks import (
    FOH,
    AbstractBlock,
    AbstractLinearBlock,
    FOHLinear,
    FOHRateTerm,
    Parallel,
    Series,
    SingleOperator,
)
from .._operators import Grid, Laplace, quadrature_symbol
from .._parameters import Parameter, replace_parameters

# Made once: a search takes a block apart thousands of times.
_LINEAR, _OPERATOR = FOHLinear(), SingleOperator()


class Chain(NamedTuple):
    """One summand of a response: `after`(|u̇| · `before`(u)), or `before`(u) where nothing follows.

    Both are linear laws, or such in series.
    """

    before: AbstractBlock
    rated: bool = False
    after: AbstractBlock | None = None


def chains_of(block: AbstractBlock) -> tuple[Chain, ...] | None:
    """The chains whose sum a block is, up to a constant; None where it has another structure."""
    match block:
        case AbstractLinearBlock():
            return (Chain(block),)
        case FOHRateTerm():
            return (_rated(block.k_p, block.beta),)
        case FOH():
            linear = {"k_l": block.k_l, "k_h": block.k_h, "alpha": block.alpha}
            return Chain(replace_parameters(_LINEAR, linear)), _rated(block.k_p, block.beta)
        case Parallel():
            first, second = chains_of(block.first), chains_of(block.second)
            return None if first is None or second is None else first + second
        case Series():
            first = chains_of(block.first)
            if first is None or not _is_law(block.second):
                return None
            return tuple(_followed(chain, block.second) for chain in first)
    return None


def _rated(gain: Parameter, order: Parameter) -> Chain:
    """The chain k |u̇| D^μ u."""
    return Chain(replace_parameters(_OPERATOR, {"k": gain, "mu": order}), rated=True)


def _is_law(block: AbstractBlock) -> bool:
    """Whether a block is linear laws in series, each with its own quadrature."""
    if isinstance(block, Series):
        return _is_law(block.first) and _is_law(block.second)
    return isinstance(block, AbstractLinearBlock)


def _followed(chain: Chain, law: AbstractBlock) -> Chain:
    # Not by >>: one law of both would run on the coarser one's quadrature.
    if not chain.rated:
        return chain._replace(before=Series(chain.before, law))
    return chain._replace(after=law if chain.after is None else Series(chain.after, law))


def transfer(law: AbstractBlock, zeta: Any, grid: Grid) -> Any:
    """What a law multiplies a signal's transform by at ζ (F,), as it is discretised on the grid.

    Of a law whose parameters are arrays (…, 1) the values (…, F), in NumPy where all is NumPy.
    """
    if isinstance(law, Series):
        return transfer(law.first, zeta, grid) * transfer(law.second, zeta, grid)
    assert isinstance(law, AbstractLinearBlock)
    if grid.history == "periodic":
        steady = -np.log(zeta) if isinstance(zeta, np.ndarray) else -jnp.log(zeta)
        s: Any = Laplace(steady, grid.step)
        return law.symbol(s)
    return quadrature_symbol(law.symbol, zeta, grid, law.accuracy)
