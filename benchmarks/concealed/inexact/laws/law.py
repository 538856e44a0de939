"""What a hysteresis law is here: a draw of its parameters and an exact response to a drive."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...drives import Array

Rng = np.random.Generator
Params = Mapping[str, Any]  # floating-point numbers, and whole ones and words
FURTHEST = 1.6  # laws answer to drives up to this many rated half ranges from the middle


@dataclass(frozen=True)
class Law:
    """A hysteresis law without units: x is the drive in rated half ranges from the middle.

    `response(x, h, params, before)` is the response at the instants of `x` (step `h` in s) of an
    actuator that was taken slowly along `before`, which ends where x begins.  Of the parameters
    the floating-point numbers are gains and shapes that a refit may change; whole numbers and
    words are the law itself.  `still` replaces parameters to make a rate-dependent law
    rate-independent, and is empty for laws that are so already.
    """

    draw: Callable[[Rng], Params]
    response: Callable[[Array, float, Params, Array], Array]
    still: Mapping[str, float] = field(default_factory=dict)


def rate_independent(
    path_law: Callable[[Array, Params], Array],
) -> Callable[[Array, float, Params, Array], Array]:
    """The response of a law to which only the path matters, not its speed."""

    def response(x: Array, h: float, params: Params, before: Array) -> Array:
        return path_law(np.concatenate([before, x]), params)[len(before) :]

    return response


def uniform(rng: Rng, **ranges: tuple[float, float]) -> dict[str, float]:
    """One number from each range, equally likely anywhere in it."""
    return {name: float(rng.uniform(*ends)) for name, ends in ranges.items()}


def opening(law: Law, params: Params) -> tuple[float, float]:
    """Opening of the rated major loop, driven slowly, over its stroke; and that stroke."""
    leg = np.linspace(-1.0, 1.0, 161)
    path = np.concatenate([leg, leg[-2::-1], leg[1:], leg[-2::-1]])
    y = law.response(path, 10.0, params, np.array([-1.0, -1.0]))
    up, down = y[320:481], y[480:][::-1]
    stroke = float(np.ptp(y[320:]))
    return float(np.max(down - up)) / stroke, stroke


def drawn(law: Law, rng: Rng, least: float = 0.03, most: float = 0.2) -> tuple[Params, float]:
    """Parameters whose rated major loop opens by a share of the stroke in range; its stroke."""
    while True:
        params = law.draw(rng)
        share, stroke = opening(law, params)
        if least <= share <= most:
            return params, stroke
