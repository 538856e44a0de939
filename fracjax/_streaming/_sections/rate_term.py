"""The rate-weighted term of fractional-order hysteresis, k_p |u̇| D^β u, and FOH as a whole.

The rate is that of the drive against its own lag θ.  As the step tends to 0, the rate of one step
would outweigh the gain k_l beside it, and no drive would have a given response: θ is long enough
that the gain stays the greater, and well below a millisecond for measured actuators.
Source: Xu, Luo, Luo, Chen, Liu, Fractal Fract. 8 (2024) 3, equations (8) and (9).
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import FOH, FOHRateTerm, SingleOperator
from ._section import Response, Sampling, Section, State, Sum, section_of
from .linear import Linear

_OUTWEIGHED = 2.0
"""The gain of the linear terms outweighs that of the rate by this factor; chosen by judgement."""


class RateTerm(Section):
    """The absolute rate of the drive times a linear section of it."""

    labels = ("k_p",)

    def __init__(self, gain: float, power: Section, step: float, lag: float = 0.0):
        self.gains, self.power, self.step, self.lag = np.array([gain]), power, step, lag

    @property
    def parts(self) -> tuple[Section, ...]:
        return (self.power,)

    def start(self, drive: Array) -> State:
        return {"late": drive, "power": self.power.start(drive)}

    def begin(self, state: State) -> Response:
        late, power = state["late"], self.power.begin(state["power"])

        def respond(drive: Array) -> tuple[Array, State]:
            features, after = power(drive)
            rate = (drive - late) / (self.lag + self.step)
            later = {"late": late + self.step * rate, "power": after}
            return jnp.abs(rate) * features, later

        return respond


def _rate_term(block: FOHRateTerm, sampling: Sampling, lag: float) -> RateTerm:
    """The section of the term, with the lag θ [s]."""
    power = section_of(SingleOperator(1.0, float(block.beta.value)), sampling)
    return RateTerm(float(block.k_p.value), power, sampling.step, lag)


@section_of.register
def _(block: FOHRateTerm, sampling: Sampling) -> Section:
    return _rate_term(block, sampling, 0.0)


@section_of.register
def _(block: FOH, sampling: Sampling) -> Section:
    linear = section_of(block.linear_part, sampling)
    assert isinstance(linear, Linear)
    beta = float(block.beta.value)
    fast = sampling.top if beta > 0 else sampling.bottom
    steepest = abs(float(block.k_p.value)) * (sampling.high - sampling.low) * fast**beta
    lag = _OUTWEIGHED * steepest / abs(linear.direct)
    return Sum(linear, _rate_term(block.rate_term, sampling, lag))
