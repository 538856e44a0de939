"""What a block is, and how blocks are joined: `a >> b` in series, `a + b` in parallel."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._operators import Grid, convolve
from .._parameters import named_parameters


class AbstractBlock(eqx.Module):
    """One physical law: drive (N,) on a grid → response (N,)."""

    @property
    @abc.abstractmethod
    def linear(self) -> bool:
        """Whether superposition holds, so that gains before this block stay gains after it."""

    @abc.abstractmethod
    def __call__(self, drive: Array, grid: Grid) -> Array: ...

    def __rshift__(self, other: AbstractBlock) -> AbstractBlock:
        if isinstance(self, AbstractLinearBlock) and isinstance(other, AbstractLinearBlock):
            return LinearSeries(self, other)
        return Series(self, other)

    def __add__(self, other: AbstractBlock) -> AbstractBlock:
        if isinstance(self, AbstractLinearBlock) and isinstance(other, AbstractLinearBlock):
            return LinearParallel(self, other)
        return Parallel(self, other)


class AbstractLinearBlock(AbstractBlock):
    """A law given by its transfer function G(s); its response is one convolution."""

    @abc.abstractmethod
    def symbol(self, s: Array) -> Array:
        """G(s) at complex s [1/s]: by arithmetic and powers of s; others need jnp.asarray(s)."""

    @abc.abstractmethod
    def static_gain(self) -> ArrayLike:
        """G(0): what a drive held for ever is multiplied by (0 where a power law has none)."""

    @property
    def accuracy(self) -> int:
        """Order of the quadrature: 4, or 3 where G has poles near the imaginary axis."""
        return 4

    @property
    def linear(self) -> bool:
        return True

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return convolve(self.symbol, self.static_gain(), drive, grid, self.accuracy)

    def inverse(self) -> Inverse:
        """The law from response back to drive."""
        return Inverse(self)


class Inverse(AbstractLinearBlock):
    r"""The law that undoes another, used as feed-forward [L 10]:

        U/Y = 1 / G(s)

    The drive is what the other law shall respond with, the response what it must be driven by.
    A held value is divided by G(0), or not transmitted where the other law transmits none.  It
    amplifies noise where G attenuates, and grows without bound where G has zeros in the right
    half-plane.  No parameter is a gain of it: fit the law itself, or InverseLFDH.
    Joined by >> the two are the identity; as two passes they are to rounding at quadratures of one
    kernel (orders 1, 2, 4), and to the discretisation error at order 3.
    Source: Zhu & Zhou (2012), equation (10).
    """

    block: AbstractLinearBlock

    @property
    def accuracy(self) -> int:
        return self.block.accuracy

    def symbol(self, s: Array) -> Array:
        return 1 / self.block.symbol(s)

    def static_gain(self) -> ArrayLike:
        gain = jnp.asarray(self.block.static_gain())
        # The quotient must be finite in the branch not taken too, for its derivative.
        return jnp.where(gain == 0, 0.0, 1 / jnp.where(gain == 0, 1.0, gain))


class LinearSeries(AbstractLinearBlock):
    """Linear laws one after the other: their symbols multiply before the one inverse transform."""

    first: AbstractLinearBlock
    second: AbstractLinearBlock

    @property
    def accuracy(self) -> int:
        return min(self.first.accuracy, self.second.accuracy)

    def symbol(self, s: Array) -> Array:
        return self.first.symbol(s) * self.second.symbol(s)

    def static_gain(self) -> ArrayLike:
        return self.first.static_gain() * jnp.asarray(self.second.static_gain())


class LinearParallel(AbstractLinearBlock):
    """Linear laws side by side: their symbols add."""

    first: AbstractLinearBlock
    second: AbstractLinearBlock

    @property
    def accuracy(self) -> int:
        return min(self.first.accuracy, self.second.accuracy)

    def symbol(self, s: Array) -> Array:
        return self.first.symbol(s) + self.second.symbol(s)

    def static_gain(self) -> ArrayLike:
        return self.first.static_gain() + jnp.asarray(self.second.static_gain())


class Series(AbstractBlock):
    """The response of `first` drives `second`."""

    first: AbstractBlock
    second: AbstractBlock

    @property
    def linear(self) -> bool:
        return self.first.linear and self.second.linear

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.second(self.first(drive, grid), grid)


class Parallel(AbstractBlock):
    """Both blocks see the same drive; their responses add."""

    first: AbstractBlock
    second: AbstractBlock

    @property
    def linear(self) -> bool:
        return self.first.linear and self.second.linear

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.first(drive, grid) + self.second(drive, grid)


def linear_gains(block: AbstractBlock) -> tuple[str, ...]:
    """Names of the parameters the whole block's output is proportional to, its shape held.

    A gain counts while every block after its own is linear.  Of two gains in a row only the first
    counts: their product is linear in one of them.
    """
    if isinstance(block, Inverse):
        return ()
    if isinstance(block, Series | LinearSeries):
        first = linear_gains(block.first) if block.second.linear else ()
        return _prefixed("first", first) or _prefixed("second", linear_gains(block.second))
    if isinstance(block, Parallel | LinearParallel):
        first, second = linear_gains(block.first), linear_gains(block.second)
        return _prefixed("first", first) + _prefixed("second", second)
    return tuple(n for n, p in named_parameters(block).items() if p.gain and not p.fixed)


def _prefixed(prefix: str, names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{prefix}.{name}" for name in names)
