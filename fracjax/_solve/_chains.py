"""A block as a sum of chains of linear blocks, the form in which its response can be compressed."""

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

# Made once, because a search separates a block into chains thousands of times.
_LINEAR, _OPERATOR = FOHLinear(), SingleOperator()
_OF_MODES = 3
"""Order of the quadrature of lightly damped modes (`_convolution_quadrature`)."""


class Chain(NamedTuple):
    """One summand of a response: `after`(|u̇| · `before`(u)), or `before`(u) where nothing follows.

    Attributes:
        before: a linear block, or linear blocks in series.
        rated: whether the response of `before` is multiplied by the drive's speed |u̇|.
        after: a linear block, or linear blocks in series, that follows the multiplication.
    """

    before: AbstractBlock
    rated: bool = False
    after: AbstractBlock | None = None


def chains_of(block: AbstractBlock) -> tuple[Chain, ...] | None:
    """The chains whose sum a block is, up to a constant; None where its structure is another."""
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
            if first is None or not _is_linear(block.second):
                return None
            return tuple(_append(chain, block.second) for chain in first)
    return None


def _rated(gain: Parameter, order: Parameter) -> Chain:
    """The chain k |u̇| D^μ u."""
    return Chain(replace_parameters(_OPERATOR, {"k": gain, "mu": order}), rated=True)


def _is_linear(block: AbstractBlock) -> bool:
    """Whether a block is linear blocks in series, each with its own quadrature."""
    if isinstance(block, Series):
        return _is_linear(block.first) and _is_linear(block.second)
    return isinstance(block, AbstractLinearBlock)


def _append(chain: Chain, block: AbstractBlock) -> Chain:
    """The chain with a linear block after it."""
    # Not by >>, which would compute both with the coarser of their quadratures.
    if not chain.rated:
        return chain._replace(before=Series(chain.before, block))
    return chain._replace(after=block if chain.after is None else Series(chain.after, block))


def oscillates(block: AbstractBlock) -> bool:
    """Whether a linear block has a lightly damped mode, by the quadrature that it asks for."""
    if isinstance(block, Series):
        return oscillates(block.first) or oscillates(block.second)
    assert isinstance(block, AbstractLinearBlock)
    return block.accuracy == _OF_MODES


def transfer(block: AbstractBlock, zeta: Any, grid: Grid) -> Any:
    """The factor by which a linear block, discretised on the grid, multiplies transforms at ζ (F,).

    If the block's parameters are arrays (…, 1), the factors are (…, F).  The computation is in
    NumPy where all arguments are.
    """
    if isinstance(block, Series):
        return transfer(block.first, zeta, grid) * transfer(block.second, zeta, grid)
    assert isinstance(block, AbstractLinearBlock)
    if grid.history == "periodic":
        steady = -np.log(zeta) if isinstance(zeta, np.ndarray) else -jnp.log(zeta)
        s: Any = Laplace(steady, grid.step)
        return block.symbol(s)
    return quadrature_symbol(block.symbol, zeta, grid, block.accuracy)
