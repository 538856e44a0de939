"""A curved characteristic between two parts of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from jax import Array

from .._parameters import Parameter
from ._inside import AbstractForce, AbstractInside, InsideEffect, rms
from ._port import Motion


class Curvature(AbstractForce):
    r"""A stage's characteristic is no line but smooth:

        f = a (x² + b x³)

    Attributes:
        square: a, one number [drive · response^-2].
        cube: b, the cube over the square, one number [response^-1].

    Source: Schetzen, The Volterra and Wiener Theories of Nonlinear Systems (1980), chapter 3.
    """

    square: Parameter
    cube: Parameter
    kind = "signal"
    size = "square"

    def __init__(self, square: float = 1.0, cube: float = 0.0):
        self.square = Parameter(square, "drive*response^-2")
        self.cube = Parameter(cube, "response^-1")

    def force(self, motion: Motion) -> Array:
        return self.square.value * motion.position**2 * (1 + self.cube.value * motion.position)


_CUBES = (0.0, 0.5, -0.5)
"""The cube over the square at the signal's rms; chosen by judgement."""


def _trials(motion: Motion) -> Sequence[AbstractInside]:
    level = rms(motion.position)
    square = 0.1 * rms(motion.drive) / level**2
    return [Curvature(square, cube / level) for cube in _CUBES]


INSIDE = InsideEffect(
    name="curvature",
    kind="signal",
    sentence="between two filters a stage's characteristic is smoothly curved",
    equation="f = a (x^2 + b x^3)",
    source="Schetzen, The Volterra and Wiener Theories of Nonlinear Systems (1980), chapter 3",
    trials=_trials,
    separated_by={
        "diode": "small amplitudes, at which a diode does nothing and a curve's square remains",
        "clipping": "small amplitudes, at which a limit does nothing and a cube remains",
    },
)
