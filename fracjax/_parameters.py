"""Parameters: value, unit, physical bounds and plausible range in one tree node."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.typing import ArrayLike

_HALF_WIDTH = 1.96  # of 95 % of a normal distribution, in its sd


def _array(value: ArrayLike) -> Any:
    return np.asarray(value, dtype=np.float64)


@jax.tree_util.register_pytree_with_keys_class
@dataclass(init=False, eq=False)
class Parameter:
    """One physical parameter of a block, never changed in place.

    - `value`: its present value, in `unit` (scalar, or a vector of like quantities).
    - `lower`, `upper`: physical bounds, never left by a fit; both or neither.
    - `plausible`: the range expected from the literature; starts are drawn from it, and a fit that
      ends outside it says so.
    - `unit`: text in which `drive` and `response` stand for the recording's units.
    - `logarithmic`: fitted on a logarithmic scale (needs lower > 0).
    - `gain`: the model's output is proportional to it, when all that follows it is linear; then it
      is eliminated by variable projection instead of iterated.
    - `fixed`: not fitted.
    - `per_recording`: it begins anew with every recording, as a phase does: of several that are
      fitted together each has its own value.

    A tree node of its own and no Module: of these every access to an attribute runs through Python,
    and every method is made anew, which were a third of a short fit.
    """

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
        """The arrays by name, and what is static."""
        arrays, static = self.tree_flatten()
        return zip(_KEYS, arrays, strict=True), static

    def tree_flatten(self) -> tuple[tuple[Any, ...], tuple]:
        """The arrays, and what is static."""
        arrays = (self.value, self.lower, self.upper, self.plausible)
        kind = (self.unit, self.logarithmic, self.gain, self.fixed, self.per_recording)
        return arrays, (*kind, self.bounded)

    @classmethod
    def tree_unflatten(cls, static: tuple, arrays: Iterable[Any]) -> Parameter:
        """The parameter again, of arrays or of whatever a transformation puts in their place."""
        made = object.__new__(cls)
        made.value, made.lower, made.upper, made.plausible = arrays
        made.unit, made.logarithmic, made.gain, made.fixed, *others = static
        made.per_recording, made.bounded = others
        return made

    def _scale(self, x: Any) -> Any:
        if not self.logarithmic:
            return x
        return jnp.log(x) if isinstance(x, Array) else np.log(x)

    def to_share(self, value: ArrayLike) -> Array:
        """How much of the way from `lower` to `upper` a value is, on the parameter's scale; of one
        without bounds the value itself."""
        if not self.bounded:
            return jnp.asarray(value)
        low, high = self._scale(self.lower), self._scale(self.upper)
        return (self._scale(value) - low) / (high - low)

    def from_share(self, share: ArrayLike) -> Array:
        """The value that lies this share of the way from `lower` to `upper`."""
        if not self.bounded:
            return jnp.asarray(share)
        low, high = self._scale(self.lower), self._scale(self.upper)
        scaled = low + (high - low) * share
        if not self.logarithmic:
            return scaled
        return jnp.exp(scaled) if isinstance(scaled, Array) else np.exp(scaled)

    def slope(self) -> Any:
        """Derivative of the value with respect to its share, at the present value."""
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
        """The sd of which the plausible range holds 95 %, at the present value; infinite without a
        range."""
        low, high = (np.asarray(end) for end in self.plausible)
        width = np.log(high / low) * self.value if self.logarithmic else high - low
        return width / (2 * _HALF_WIDTH) + np.zeros(np.shape(self.value))

    def with_value(self, value: ArrayLike) -> Parameter:
        """The same parameter at another value."""
        traced = isinstance(value, jax.Array)
        (_, *others), structure = jax.tree_util.tree_flatten(self)
        return structure.unflatten([value if traced else _array(value), *others])

    def kept_plausible(self) -> Parameter:
        """The same parameter with its plausible range, where it has one, for bounds."""
        low, high = self.plausible
        if not np.all(np.isfinite(np.subtract(high, low))):
            return self
        (_, _, _, *others), structure = jax.tree_util.tree_flatten(self)
        return structure.unflatten([np.clip(self.value, low, high), low, high, *others])

    def draw(self, generator: np.random.Generator) -> Any:
        """A start, uniform in the plausible range on its scale; without one as it is."""
        low, high = self.plausible
        if not np.all(np.isfinite(np.subtract(high, low))):
            return np.asarray(self.value)
        share = generator.uniform(size=np.shape(self.value))
        if self.logarithmic:
            return np.exp(np.log(low) + share * (np.log(high) - np.log(low)))
        return low + share * (high - low)


_KEYS = [jax.tree_util.GetAttrKey(name) for name in ("value", "lower", "upper", "plausible")]


def is_parameter(node: object) -> bool:
    return isinstance(node, Parameter)


def named_parameters(tree: Any) -> dict[str, Parameter]:
    """All parameters of a block or model by dotted path, in tree order."""
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_parameter)
    pairs = zip(_paths(structure), leaves, strict=True)
    return {path: leaf for path, leaf in pairs if is_parameter(leaf)}


@lru_cache(maxsize=1024)
def _paths(structure: Any) -> tuple[str, ...]:
    """Dotted paths of a structure's leaves; to find them takes as long as a short simulation."""
    numbered = structure.unflatten(range(structure.num_leaves))
    return tuple(
        ".".join(str(getattr(key, "name", getattr(key, "idx", key))) for key in path)
        for path, _ in jax.tree_util.tree_leaves_with_path(numbered)
    )


def replace_parameters(tree: Any, parameters: Mapping[str, Parameter]) -> Any:
    """The same tree with parameters exchanged by dotted path."""
    leaves, structure = jax.tree_util.tree_flatten(tree, is_leaf=is_parameter)
    pairs = zip(_paths(structure), leaves, strict=True)
    return structure.unflatten([parameters.get(path, leaf) for path, leaf in pairs])


def set_values(tree: Any, values: Mapping[str, ArrayLike]) -> Any:
    """The same tree with the named parameters' values exchanged."""
    known = named_parameters(tree)
    return replace_parameters(tree, {n: known[n].with_value(v) for n, v in values.items()})
