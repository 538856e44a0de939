"""Parameters: value, unit, physical bounds and plausible range in one tree node."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

_HALF_WIDTH = 1.96
"""Half the width of the central 95 % of a normal distribution, in standard deviations."""


def _array(value: ArrayLike) -> Any:
    """A value as float64 in NumPy, which keeps its precision when JAX is set to float32."""
    return np.asarray(value, dtype=np.float64)


@jax.tree_util.register_pytree_with_keys_class
@dataclass(init=False, eq=False)
class Parameter:
    """One physical parameter of a block, never changed in place.

    Attributes:
        value: The present value, a scalar or a vector (P,) of like quantities [unit].
        lower: Lower physical bound, which no fit crosses [unit]; -∞ without bounds.  A parameter
            has both bounds or neither.
        upper: Upper physical bound [unit]; ∞ without bounds.
        plausible: Range expected from the literature [unit], by default the bounds.  Starts are
            drawn from it, and a fit that ends outside it warns.
        unit: The unit as text, in which `drive` and `response` stand for the recording's units;
            "1" if dimensionless.
        logarithmic: Whether it is fitted on a logarithmic scale, which needs lower > 0.
        gain: Whether the model's output is proportional to it if all that follows is linear; it is
            then eliminated by variable projection instead of iterated.
        fixed: Whether it keeps its value in a fit.
        per_recording: Whether each of several recordings that are fitted together has its own
            value, as for a phase.
        bounded: Whether it has bounds.

    Raises:
        ValueError: When only one bound is finite, the value is outside the bounds, or the lower
            bound of a logarithmic parameter is not above 0.
    """

    # This is a pytree node of its own and no equinox Module, because access to attributes and
    # methods of a Module takes time: a third of that of a short fit.

    # NumPy arrays until a transformation traces them, so that float64 survives without x64.
    value: Array
    lower: Array
    upper: Array
    plausible: tuple[Array, Array]
    unit: str
    logarithmic: bool
    gain: bool
    fixed: bool
    per_recording: bool
    bounded: bool

    def __init__(
        self,
        value: ArrayLike,
        unit: str = "1",
        *,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        plausible: tuple[ArrayLike, ArrayLike] | None = None,
        logarithmic: bool = False,
        gain: bool = False,
        fixed: bool = False,
        per_recording: bool = False,
    ):
        self.value = _array(value)
        self.lower, self.upper = _array(lower), _array(upper)
        low, high = (lower, upper) if plausible is None else plausible
        self.plausible = (_array(low), _array(high))
        self.unit, self.logarithmic, self.gain, self.fixed = unit, logarithmic, gain, fixed
        self.per_recording = per_recording
        finite = np.isfinite(self.lower), np.isfinite(self.upper)
        self.bounded = bool(np.all(finite))
        if np.any(finite) and not self.bounded:
            raise ValueError(
                f"expected two finite bounds or none, found [{lower}, {upper}] {unit}; "
                "give the widest range that makes sense"
            )
        if not (np.all(self.lower <= self.value) and np.all(self.value <= self.upper)):
            raise ValueError(
                f"expected a value within [{lower}, {upper}] {unit}, found {value}; "
                "widen the bounds or change the value"
            )
        if logarithmic and not np.all(self.lower > 0):
            raise ValueError(
                f"expected a lower bound above 0 for a logarithmic parameter, found {lower}"
            )

    def tree_flatten_with_keys(self) -> tuple[Iterable[tuple[Any, Any]], tuple]:
        """The arrays by name, and the static fields."""
        arrays, static = self.tree_flatten()
        return zip(_KEYS, arrays, strict=True), static

    def tree_flatten(self) -> tuple[tuple[Any, ...], tuple]:
        """The arrays, and the static fields."""
        arrays = (self.value, self.lower, self.upper, self.plausible)
        kind = (self.unit, self.logarithmic, self.gain, self.fixed, self.per_recording)
        return arrays, (*kind, self.bounded)

    @classmethod
    def tree_unflatten(cls, static: tuple, arrays: Iterable[Any]) -> Parameter:
        """The parameter from its leaves: arrays, or what a transformation replaces them by."""
        parameter = object.__new__(cls)
        parameter.value, parameter.lower, parameter.upper, parameter.plausible = arrays
        parameter.unit, parameter.logarithmic, parameter.gain, *others = static
        parameter.fixed, parameter.per_recording, parameter.bounded = others
        return parameter

    def _scale(self, x: Any) -> Any:
        """A value on the parameter's scale: its logarithm if `logarithmic`, else itself."""
        if not self.logarithmic:
            return x
        return jnp.log(x) if isinstance(x, Array) else np.log(x)

    def component(self, values: ArrayLike, k: int) -> float:
        """Component k of values that are broadcast to the parameter's shape.

        Args:
            values: Numbers of the parameter's shape, or one for all.
            k: The component's place.

        Returns:
            The number, in the values' unit.
        """
        if np.size(values) == 1:
            return float(np.asarray(values).item())
        return float(np.ravel(np.broadcast_to(values, np.shape(self.value)))[k])

    def to_share(self, value: ArrayLike) -> Array:
        """The position of a value between the bounds, from 0 at `lower` to 1 at `upper`.

        Args:
            value: A value of the parameter's shape [unit].

        Returns:
            Its share of the way, on the parameter's scale; without bounds the value itself.
        """
        if not self.bounded:
            return jnp.asarray(value)
        low, high = self._scale(self.lower), self._scale(self.upper)
        return (self._scale(value) - low) / (high - low)

    def from_share(self, share: ArrayLike) -> Array:
        """The value at a position between the bounds: the inverse of `to_share`.

        Args:
            share: The share of the way from `lower` to `upper`; without bounds the value itself.

        Returns:
            The value [unit].
        """
        if not self.bounded:
            return jnp.asarray(share)
        low, high = self._scale(self.lower), self._scale(self.upper)
        scaled = low + (high - low) * share
        if not self.logarithmic:
            return scaled
        return jnp.exp(scaled) if isinstance(scaled, Array) else np.exp(scaled)

    def slope(self) -> Any:
        """The derivative of the value with respect to its share, at the present value.

        Returns:
            The derivative, of the parameter's shape [unit]; 1 without bounds.
        """
        if not self.bounded:
            return np.ones_like(self.value)
        low, high = self._scale(self.lower), self._scale(self.upper)
        return (high - low) * (self.value if self.logarithmic else np.ones_like(self.value))

    @property
    def is_plausible(self) -> bool:
        """Whether the value lies in the range expected from the literature."""
        low, high = self.plausible
        return bool(np.all(self.value >= low) and np.all(self.value <= high))

    @property
    def expected_sd(self) -> np.ndarray:
        """Standard deviation that gives a normal distribution 95 % in the plausible range [unit].

        It holds at the present value and is infinite without a plausible range.
        """
        low, high = (np.asarray(end) for end in self.plausible)
        width = np.log(high / low) * self.value if self.logarithmic else high - low
        return width / (2 * _HALF_WIDTH) + np.zeros(np.shape(self.value))

    def with_value(self, value: ArrayLike) -> Parameter:
        """The same parameter at another value.

        Args:
            value: A value of the parameter's shape [unit].

        Returns:
            A new parameter, all else as in this one.
        """
        traced = isinstance(value, jax.Array)
        (_, *others), static = self.tree_flatten()
        return self.tree_unflatten(static, (value if traced else _array(value), *others))

    def as_shape(self) -> Parameter:
        """The same parameter where the output is not proportional to it.

        Returns:
            A new parameter that is iterated in a fit and not eliminated.
        """
        arrays, (unit, logarithmic, _, *others) = self.tree_flatten()
        return self.tree_unflatten((unit, logarithmic, False, *others), arrays)

    def freed(self) -> Parameter:
        """The same parameter, which a fit moves.

        Returns:
            A new parameter, all else as in this one.
        """
        arrays, (unit, logarithmic, gain, _, *others) = self.tree_flatten()
        return self.tree_unflatten((unit, logarithmic, gain, False, *others), arrays)

    def kept_plausible(self, beyond: float = 0.0) -> Parameter:
        """The same parameter with its plausible range as bounds.

        Args:
            beyond: How far they lie beyond the range at both ends, over its width on the
                parameter's scale; never beyond the present bounds.

        Returns:
            A new parameter whose value is clipped to the range; this one without a range.
        """
        low, high = self.plausible
        if not np.all(np.isfinite(np.subtract(high, low))):
            return self
        more = beyond * (self._scale(high) - self._scale(low))
        if self.logarithmic:
            low, high = low * np.exp(-more), high * np.exp(more)
        else:
            low, high = low - more, high + more
        low, high = np.maximum(low, self.lower), np.minimum(high, self.upper)
        (_, _, _, *others), structure = jax.tree_util.tree_flatten(self)
        return structure.unflatten([np.clip(self.value, low, high), low, high, *others])

    def draw(self, generator: np.random.Generator) -> Any:
        """A random start value, for a search from several points.

        Args:
            generator: The source of random numbers.

        Returns:
            A value [unit], uniform in the plausible range on the parameter's scale; the present
            value without a plausible range.
        """
        low, high = self.plausible
        if not np.all(np.isfinite(np.subtract(high, low))):
            return np.asarray(self.value)
        share = generator.uniform(size=np.shape(self.value))
        if self.logarithmic:
            return np.exp(np.log(low) + share * (np.log(high) - np.log(low)))
        return low + share * (high - low)


_KEYS = [jax.tree_util.GetAttrKey(name) for name in ("value", "lower", "upper", "plausible")]


def is_parameter(node: object) -> bool:
    """Whether a node of a tree is a parameter."""
    return isinstance(node, Parameter)


def named_parameters(tree: Any) -> dict[str, Parameter]:
    """All parameters of a block or model by dotted path, in tree order."""
    kept = _kept.get(id(tree))
    if kept is not None and kept[0]() is tree:
        return kept[1].copy()
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_parameter)
    pairs = zip(_paths(structure), leaves, strict=True)
    parameters = {path: leaf for path, leaf in pairs if is_parameter(leaf)}
    if isinstance(tree, eqx.Module):  # which never changes
        place = id(tree)
        _kept[place] = weakref.ref(tree, lambda _: _kept.pop(place, None)), parameters.copy()
    return parameters


_kept: dict[int, tuple[weakref.ref, dict[str, Parameter]]] = {}
"""The parameters of each living tree that was asked for them, because each stage of a fit asks."""


@lru_cache(maxsize=1024)
def _paths(structure: Any) -> tuple[str, ...]:
    """Dotted paths of a structure's leaves.

    They are cached because determining them takes as long as a short simulation.
    """
    numbered = structure.unflatten(range(structure.num_leaves))
    return tuple(
        ".".join(str(getattr(key, "name", getattr(key, "idx", key))) for key in path)
        for path, _ in jax.tree_util.tree_leaves_with_path(numbered)
    )


def replace_parameters(tree: Any, parameters: Mapping[str, Parameter]) -> Any:
    """The same tree with other parameters, given by dotted path."""
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_parameter)
    pairs = zip(_paths(structure), leaves, strict=True)
    return structure.unflatten([parameters.get(path, leaf) for path, leaf in pairs])


def set_values(tree: Any, values: Mapping[str, ArrayLike]) -> Any:
    """The same tree with other values of parameters, given by dotted path, each in its unit."""
    parameters = named_parameters(tree)
    return replace_parameters(tree, {n: parameters[n].with_value(v) for n, v in values.items()})
