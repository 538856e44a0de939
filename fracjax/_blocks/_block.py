"""What a block is, and how blocks are joined: `a >> b` in series, `a + b` in parallel."""

from __future__ import annotations

import abc
from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.flatten_util import ravel_pytree
from jax.typing import ArrayLike

from .._computing import compiled
from .._operators import Grid, convolve
from .._parameters import named_parameters, set_values

_AT_ONCE = 4

Columns = dict[str, np.ndarray]
"""Per parameter the derivative (N, size) of a response (N,) with respect to it."""


class AbstractBlock(eqx.Module):
    """One physical law: drive (N,) on a grid → response (N,).

    Drive and response are in the units of the recording; each parameter says its own unit.
    """

    # A Module makes every method it is asked for a new Module, which takes longer than the method.
    __getattribute__ = object.__getattribute__

    @property
    @abc.abstractmethod
    def linear(self) -> bool:
        """Whether superposition holds, so that gains before this block stay gains after it."""

    @abc.abstractmethod
    def __call__(self, drive: Array, grid: Grid) -> Array: ...

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        """The response (N,), each law in it compiled on its own.

        A law then compiles once and serves every model it is part of: for models that are put
        together while one looks for what is missing, compilation would cost far more than running.
        Between the laws all is NumPy's, whose smallest operation costs a hundredth of JAX's.
        """
        return np.asarray(_respond(self, drive, grid))

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        """Response (N,), its derivatives with respect to the named parameters, and along each of
        the changes `along` (N,) of the drive; compiled law by law, as in `respond`."""
        if names:
            columns, response = map(np.asarray, _columns(self, tuple(names), drive, grid))
        else:
            columns, response = np.zeros((0, 0)), self.respond(drive, grid)
        parameters, found, at = named_parameters(self), {}, 0
        for name in names:
            size = jnp.size(parameters[name].value)
            found[name] = columns[:, at : at + size]
            at += size
        return response, found, _changes(self, drive, along, grid)

    def __rshift__(self, other: AbstractBlock) -> AbstractBlock:
        if isinstance(self, AbstractLinearBlock) and isinstance(other, AbstractLinearBlock):
            return LinearSeries(self, other)
        return Series(self, other)

    def __add__(self, other: AbstractBlock) -> AbstractBlock:
        if isinstance(self, AbstractLinearBlock) and isinstance(other, AbstractLinearBlock):
            return LinearParallel(self, other)
        return Parallel(self, other)


@compiled
def _respond(block: AbstractBlock, drive: ArrayLike, grid: Grid) -> Array:
    return block(jnp.asarray(drive), grid)


def _changes(
    block: AbstractBlock, drive: np.ndarray, along: Sequence[np.ndarray], grid: Grid
) -> list[np.ndarray]:
    """The response's changes along each change of the drive."""
    if not along:
        return []
    # In fours, so that few numbers of them are compiled for.
    nothing = [np.zeros_like(drive)] * (-len(along) % _AT_ONCE)
    passed = _passed(block, drive, np.stack([*along, *nothing]), grid)
    return list(np.asarray(passed)[: len(along)])


@compiled
def _passed(block: AbstractBlock, drive: ArrayLike, along: np.ndarray, grid: Grid) -> Array:
    """Changes (K, N) of the response along changes (K, N) of the drive."""
    change = jax.linearize(lambda d: block(d, grid), jnp.asarray(drive))[1]
    return jax.vmap(change)(along)


@compiled
def _columns(
    block: AbstractBlock, names: tuple[str, ...], drive: ArrayLike, grid: Grid
) -> tuple[Array, Array]:
    """Derivatives (N, Σ size) with respect to the named parameters, in order, and the response."""
    u, parameters = jnp.asarray(drive), named_parameters(block)
    flat, unravel = ravel_pytree([jnp.asarray(parameters[name].value) for name in names])

    def respond(vector: Array) -> Array:
        return set_values(block, dict(zip(names, unravel(vector), strict=True)))(u, grid)

    response, change = jax.linearize(respond, flat)
    return jax.vmap(change)(jnp.eye(flat.size)).T, response


def _within(names: Sequence[str], part: str) -> list[str]:
    """The names that lie in one part of a composed block, as that part calls them."""
    return [name.removeprefix(f"{part}.") for name in names if name.startswith(f"{part}.")]


def _outside(columns: Columns, part: str) -> Columns:
    return {f"{part}.{name}": column for name, column in columns.items()}


class AbstractLinearBlock(AbstractBlock):
    """A law given by its transfer function G(s), s [1/s]; its response is one convolution.

    G is in response unit per drive unit, or dimensionless where the law passes a signal on.
    """

    @abc.abstractmethod
    def symbol(self, s: Array) -> Array:
        """G(s) at complex s [1/s]: by arithmetic and powers of s; others need jnp.asarray(s).

        Elementwise in s, so that parameters (…, 1) give (…, F)."""

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

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        if names or not along:
            return super().linearise(drive, grid, names, along)
        # A change passes as a drive does: all in one transform.
        response, *changes = _changes(self, drive, [drive, *along], grid)
        return response, {}, changes

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

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        return self.second.respond(self.first.respond(drive, grid), grid)

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        between, first, changes = self.first.linearise(drive, grid, _within(names, "first"), along)
        moved = [column for columns in first.values() for column in columns.T]
        response, second, changes = self.second.linearise(
            between, grid, _within(names, "second"), [*moved, *changes]
        )
        passed = iter(changes)
        first = {
            name: np.stack([next(passed) for _ in columns.T], axis=1)
            for name, columns in first.items()
        }
        return response, _outside(first, "first") | _outside(second, "second"), list(passed)


class Parallel(AbstractBlock):
    """Both blocks see the same drive; their responses add."""

    first: AbstractBlock
    second: AbstractBlock

    @property
    def linear(self) -> bool:
        return self.first.linear and self.second.linear

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.first(drive, grid) + self.second(drive, grid)

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        return self.first.respond(drive, grid) + self.second.respond(drive, grid)

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        one, first, changes = self.first.linearise(drive, grid, _within(names, "first"), along)
        other, second, more = self.second.linearise(drive, grid, _within(names, "second"), along)
        columns = _outside(first, "first") | _outside(second, "second")
        return one + other, columns, [a + b for a, b in zip(changes, more, strict=True)]


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
