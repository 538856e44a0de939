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
"""Changes of the drive are propagated in groups of so many; chosen by judgement."""

Columns = dict[str, np.ndarray]
"""By parameter: the derivative (N, size) of a response (N,) with respect to it."""


class AbstractBlock(eqx.Module):
    """A model or a part of one: drive (N,) on a grid → response (N,).

    Drive and response are in the units of the recording; each parameter states its own unit.
    `a >> b` is the series and `a + b` the parallel connection of two blocks.
    """

    # A Module wraps each method in a new Module at every access, which takes longer than the call.
    __getattribute__ = object.__getattribute__

    @property
    @abc.abstractmethod
    def linear(self) -> bool:
        """Whether superposition holds, so that gains before this block stay gains after it."""

    @property
    def leads(self) -> bool:
        """Whether its response may lead its drive, as a force leads the motion that it causes."""
        return False

    @abc.abstractmethod
    def __call__(self, drive: Array, grid: Grid) -> Array:
        """The response, as a JAX program.

        Args:
            drive: (N,), in drive units.
            grid: step [s] and history.

        Returns:
            The response (N,), in response units.
        """

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        """The response, each part of the block compiled on its own.

        A part then compiles once and serves every model that contains it: in a search for missing
        effects, which composes many models, compiling them all would cost far more than running
        them.  The parts are joined in NumPy, whose smallest operation costs a hundredth of JAX's.

        Args:
            drive: (N,), in drive units.
            grid: step [s] and history.

        Returns:
            The response (N,), in response units.
        """
        return np.asarray(_respond(self, drive, grid))

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        """The response and its derivatives, each part of the block compiled on its own.

        Args:
            drive: (N,), in drive units.
            grid: step [s] and history.
            names: parameters with respect to which the response is differentiated.
            along: changes of the drive, each (N,), in drive units.

        Returns:
            The response (N,), in response units; its derivative (N, size) with respect to each
            parameter, in response units per unit of the parameter; and its change (N,) for each
            change of the drive, to first order, in response units.
        """
        if names:
            columns, response = map(np.asarray, _columns(self, tuple(names), drive, grid))
        else:
            columns, response = np.zeros((0, 0)), self.respond(drive, grid)
        parameters, derivatives, at = named_parameters(self), {}, 0
        for name in names:
            size = jnp.size(parameters[name].value)
            derivatives[name] = columns[:, at : at + size]
            at += size
        return response, derivatives, _changes(self, drive, along, grid)

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
    """The response (N,) of a whole block, as one compiled program."""
    return block(jnp.asarray(drive), grid)


def _changes(
    block: AbstractBlock, drive: np.ndarray, along: Sequence[np.ndarray], grid: Grid
) -> list[np.ndarray]:
    """The response's change (N,) for each change (N,) of the drive, in response units."""
    if not along:
        return []
    # Padded to a multiple of four, so that programs of few shapes are compiled.
    padding = [np.zeros_like(drive)] * (-len(along) % _AT_ONCE)
    changes = _propagate(block, drive, np.stack([*along, *padding]), grid)
    return list(np.asarray(changes)[: len(along)])


@compiled
def _propagate(block: AbstractBlock, drive: ArrayLike, along: np.ndarray, grid: Grid) -> Array:
    """Changes (K, N) of the response for changes (K, N) of the drive, to first order."""
    change = jax.linearize(lambda d: block(d, grid), jnp.asarray(drive))[1]
    return jax.vmap(change)(along)


@compiled
def _columns(
    block: AbstractBlock, names: tuple[str, ...], drive: ArrayLike, grid: Grid
) -> tuple[Array, Array]:
    """Derivatives (N, Σ size) with respect to the named parameters, in order, and the response."""
    u, parameters = jnp.asarray(drive), named_parameters(block)
    flat, unravel = ravel_pytree([jnp.asarray(parameters[name].value) for name in names])

    def respond(vector: Array) -> tuple[Array, Array]:
        response = set_values(block, dict(zip(names, unravel(vector), strict=True)))(u, grid)
        return response, response

    # `jax.linearize` gives the same, and takes twice as long to trace.
    return jax.jacfwd(respond, has_aux=True)(flat)


def _names_within(names: Sequence[str], part: str) -> list[str]:
    """The parameters' names that lie in one part of a composed block, without its prefix."""
    return [name.removeprefix(f"{part}.") for name in names if name.startswith(f"{part}.")]


def _with_prefix(columns: Columns, part: str) -> Columns:
    """The derivatives of one part of a composed block, by their names in the whole."""
    return {f"{part}.{name}": column for name, column in columns.items()}


class AbstractLinearBlock(AbstractBlock):
    """A linear block with the transfer function G(s), s [1/s]; its response is one convolution.

    G is in response unit per drive unit, or dimensionless if the block only filters a signal.
    """

    @abc.abstractmethod
    def symbol(self, s: Array) -> Array:
        """The transfer function G(s), by arithmetic and powers of s; others need jnp.asarray(s).

        Args:
            s: complex (F,) [1/s].

        Returns:
            G(s) (F,), complex, in response unit per drive unit; (…, F) for parameters (…, 1).
        """

    @abc.abstractmethod
    def static_gain(self) -> ArrayLike:
        """The factor G(0) for a drive that does not change.

        Returns:
            One number, in response unit per drive unit; 0 for a power of s, which has none.
        """

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
        # The block is linear: a change propagates as a drive does, all of them in one transform.
        response, *changes = _changes(self, drive, [drive, *along], grid)
        return response, {}, changes

    def inverse(self) -> Inverse:
        """The block from response back to drive.

        Returns:
            The block with the transfer function 1/G(s), in drive unit per response unit.
        """
        return Inverse(self)


class Inverse(AbstractLinearBlock):
    r"""The inverse of a linear block, used as feed-forward [L 10]:

        U/Y = 1 / G(s)

    Its drive is the desired response of the other block, its response the drive that the other
    block needs.  A constant value is divided by G(0), or becomes 0 if G(0) = 0.  The inverse
    amplifies noise where G attenuates, and grows without bound if G has zeros in the right
    half-plane.  None of its parameters is a gain: fit the block itself, or InverseLFDH.
    The series of both by >> is the identity.  One after the other they are the identity to rounding
    for quadratures of one kernel (orders 1, 2, 4), and to the discretisation error for order 3.

    Attributes:
        block: the block with the transfer function G(s), in response unit per drive unit.

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
        # The quotient must be finite in the unused branch too, for its derivative.
        return jnp.where(gain == 0, 0.0, 1 / jnp.where(gain == 0, 1.0, gain))


class LinearSeries(AbstractLinearBlock):
    """Linear blocks in series: their transfer functions are multiplied before the convolution.

    Attributes:
        first: the block that the drive enters, in response unit per drive unit.
        second: the block that the response of `first` enters, in the same kind of unit.

    Source: Oppenheim & Willsky, Signals and Systems (1997), section 1.5.2, interconnections.
    """

    first: AbstractLinearBlock
    second: AbstractLinearBlock

    @property
    def accuracy(self) -> int:
        return min(self.first.accuracy, self.second.accuracy)

    @property
    def leads(self) -> bool:
        return self.first.leads or self.second.leads

    def symbol(self, s: Array) -> Array:
        return self.first.symbol(s) * self.second.symbol(s)

    def static_gain(self) -> ArrayLike:
        return self.first.static_gain() * jnp.asarray(self.second.static_gain())


class LinearParallel(AbstractLinearBlock):
    """Linear blocks in parallel: their transfer functions are added.

    Attributes:
        first: one block, in response unit per drive unit.
        second: the other block, in the same unit.

    Source: Oppenheim & Willsky, Signals and Systems (1997), section 1.5.2, interconnections.
    """

    first: AbstractLinearBlock
    second: AbstractLinearBlock

    @property
    def accuracy(self) -> int:
        return min(self.first.accuracy, self.second.accuracy)

    @property
    def leads(self) -> bool:
        return self.first.leads or self.second.leads

    def symbol(self, s: Array) -> Array:
        return self.first.symbol(s) + self.second.symbol(s)

    def static_gain(self) -> ArrayLike:
        return self.first.static_gain() + jnp.asarray(self.second.static_gain())


class Series(AbstractBlock):
    """Blocks in series.

    Attributes:
        first: the block that the drive enters, in the drive's unit.
        second: the block that the response of `first` enters, in the unit of that response.

    Source: Oppenheim & Willsky, Signals and Systems (1997), section 1.5.2, interconnections.
    """

    first: AbstractBlock
    second: AbstractBlock

    @property
    def linear(self) -> bool:
        return self.first.linear and self.second.linear

    @property
    def leads(self) -> bool:
        return self.first.leads or self.second.leads

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.second(self.first(drive, grid), grid)

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        return self.second.respond(self.first.respond(drive, grid), grid)

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        between, first, changes = self.first.linearise(
            drive, grid, _names_within(names, "first"), along
        )
        by_parameter = [column for columns in first.values() for column in columns.T]
        response, second, changes = self.second.linearise(
            between, grid, _names_within(names, "second"), [*by_parameter, *changes]
        )
        propagated = iter(changes)
        first = {
            name: np.stack([next(propagated) for _ in columns.T], axis=1)
            for name, columns in first.items()
        }
        columns = _with_prefix(first, "first") | _with_prefix(second, "second")
        return response, columns, list(propagated)


class Parallel(AbstractBlock):
    """Blocks in parallel: the same drive enters both, and their responses are added.

    Attributes:
        first: one block, in response units.
        second: the other block, in the same units.

    Source: Oppenheim & Willsky, Signals and Systems (1997), section 1.5.2, interconnections.
    """

    first: AbstractBlock
    second: AbstractBlock

    @property
    def linear(self) -> bool:
        return self.first.linear and self.second.linear

    @property
    def leads(self) -> bool:
        return self.first.leads or self.second.leads

    def __call__(self, drive: Array, grid: Grid) -> Array:
        return self.first(drive, grid) + self.second(drive, grid)

    def respond(self, drive: np.ndarray, grid: Grid) -> np.ndarray:
        return self.first.respond(drive, grid) + self.second.respond(drive, grid)

    def linearise(
        self, drive: np.ndarray, grid: Grid, names: Sequence[str], along: Sequence[np.ndarray]
    ) -> tuple[np.ndarray, Columns, list[np.ndarray]]:
        one, first, changes = self.first.linearise(
            drive, grid, _names_within(names, "first"), along
        )
        other, second, more = self.second.linearise(
            drive, grid, _names_within(names, "second"), along
        )
        columns = _with_prefix(first, "first") | _with_prefix(second, "second")
        return one + other, columns, [a + b for a, b in zip(changes, more, strict=True)]


def linear_gains(block: AbstractBlock) -> tuple[str, ...]:
    """The parameters that enter the response of the whole block linearly, if all others are fixed.

    A gain is listed if every block after its own is linear.  If two gains are in series, only the
    first is listed: their product is linear in one of them.

    Args:
        block: any block.

    Returns:
        The dotted names of these gains, as in the block's parameters.
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
    """Names of one part of a composed block, as names in the whole."""
    return tuple(f"{prefix}.{name}" for name in names)
