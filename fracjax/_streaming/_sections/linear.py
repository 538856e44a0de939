r"""Linear laws: creep, lags, resonances and fractional powers as difference equations.

G(s) is written as a rational transfer function (`_systems`) in partial fractions d + Σ r_k/(s-λ_k).
Each term is one difference equation, exact for a drive that is linear between samples, with
E = exp(λ h) and the step h:

    x_n = E x_{n-1} + before · v_{n-1} + now · v_n,      v = drive - datum
    y_n = d v_n + Σ x_n + G(0) datum

Real poles give first-order sections; a complex pair gives one of second order, whose x is complex
and of which y takes twice the real part.  The datum is the drive held before the first sample.

An inverse may respond to derivatives of its drive, up to the K-th.  A straight line between samples
has none at its corners: what poles much faster than the step add is therefore their Taylor series
a_0 + a_1 s + … + a_K s^K, with

    s v ≈ (3 v_n - 4 v_{n-1} + v_{n-2})/(2 h),      s^k v ≈ ∇^k v_n/h^k for k > 1

The first keeps stable what is stable in continuous time.  The others are k/2 samples late, which is
little as their share is, and ask for half as much or less of a sudden motion.
Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25; Franklin,
Powell & Workman, Digital Control of Dynamic Systems (1998), section 6.3; Hairer & Wanner, Solving
Ordinary Differential Equations II (1996), section V.1, for the difference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from ..._blocks import AbstractLinearBlock
from ..._recording import InputError
from ..._systems import System, rational
from ._section import Response, Sampling, Section, State, section_of

_SERIES_BELOW = 1e-2
"""|λ h| below which a series is accurate to 1e-13, and above which the closed form is to 1e-11."""
_SOUND = 1e-6
"""Partial fractions must agree with the state space to this relative error; else poles are too
close to each other to be separated.  Chosen by judgement."""
FAST = 2.0
"""|λ h| above which what an inverse's pole adds is its Taylor series; chosen by judgement."""
_SLOPE = np.array([1.5, -2.0, 0.5])
"""The backward difference of second order, times the step."""
_TRACE = 1e-30
"""A smaller coefficient is 0, as that of a pole which is far faster than the step."""
_FREQUENCIES = 200
"""Frequencies in the band at which the stated error is evaluated; chosen by judgement."""

Symbol = Callable[[Array], Array]
"""G(s) (F,) for s (F,) [1/s]."""


class Modes(NamedTuple):
    """decay, before and now (n,) of difference equations, complex; one of a conjugate pair."""

    decay: np.ndarray
    before: np.ndarray
    now: np.ndarray

    @property
    def paired(self) -> np.ndarray:
        """Whether each is of second order (n,)."""
        return np.imag(self.decay) != 0


class Linear(Section):
    """A rational transfer function; its one gain is a factor of the whole.

    `derivatives` is the highest derivative of the drive that it responds to.
    """

    def __init__(
        self,
        system: System,
        static: float,
        step: float,
        label: str,
        exact: Symbol,
        derivatives: int = 0,
    ):
        poles, residues = system.modes()
        s = 2j * np.pi * np.geomspace(1e-3, 0.3, 7) / step
        modal = system.d + np.sum(residues / (s[:, None] - poles), axis=1)
        sound = np.allclose(modal, system.at(s), rtol=_SOUND, atol=0)
        if not (sound and np.all(np.real(poles) < 0)):
            raise InputError.at(
                f"streaming, {label}",
                "a stable transfer function with distinct poles",
                f"{np.sum(np.real(poles) >= 0)} unstable poles of {poles.size}",
                "use compensate for a motion that is known ahead",
            )
        fast = (np.abs(poles) * step > FAST) & (derivatives > 0)
        self.taps = _differences(system.d, poles[fast], residues[fast], step, derivatives)
        one = (np.imag(poles) >= 0) & ~fast
        self.step, self.static, self.derivatives = step, static, derivatives
        self.modes = discretised(poles[one], residues[one], step)
        factors = 1 + self.modes.paired
        self.direct = float(self.taps[0] + np.sum(factors * np.real(self.modes.now)))
        self.gains, self.labels, self.exact = np.ones(1), (label,), exact

    def error(self, band: tuple[float, float]) -> float:
        """The largest relative error of the equations' frequency response within a band [Hz]."""
        return float(self.errors(np.geomspace(*band, _FREQUENCIES)).max())

    def errors(self, frequencies: np.ndarray) -> np.ndarray:
        """The relative errors of the frequency response at frequencies (F,) [Hz]."""
        with jax.enable_x64(True):
            exact = np.asarray(self.exact(jnp.asarray(2j * np.pi * frequencies)))
        return np.abs(self.frequency_response(frequencies) / exact - 1)

    def frequency_response(self, frequencies: np.ndarray) -> np.ndarray:
        """Response over drive, complex (F,), of the difference equations at frequencies (F,) [Hz]
        below half the sampling rate."""
        z = np.exp(2j * np.pi * np.asarray(frequencies) * self.step)[:, None]
        modes, pairs = self.modes, self.modes.paired

        def terms(decay: np.ndarray, before: np.ndarray, now: np.ndarray) -> np.ndarray:
            return np.sum((now * z + before) / (z - decay), axis=1)

        ahead = np.polynomial.polynomial.polyval(1 / z[:, 0], self.taps)
        return ahead + terms(*modes) + terms(*(np.conj(each[pairs]) for each in modes))

    def start(self, drive: Array) -> State:
        pairs = int(np.sum(self.modes.paired))
        singles = self.modes.decay.size - pairs
        state = {"datum": drive}
        if self.taps.size > 1:
            state["past"] = jnp.zeros(self.taps.size - 1)
        if self.modes.decay.size:
            state["last"] = jnp.zeros(())
        if singles:
            state["x"] = jnp.zeros(singles)
        if pairs:
            state["re"], state["im"] = jnp.zeros(pairs), jnp.zeros(pairs)
        return state

    def begin(self, state: State) -> Response:
        pairs = self.modes.paired
        singles = [np.real(each[~pairs]) for each in self.modes]
        doubles = [each[pairs] for each in self.modes]
        datum, last = state["datum"], state.get("last")
        held, moved = self.static * datum, {}
        if "past" in state:
            held = held + jnp.sum(self.taps[1:] * state["past"])
        if "x" in state:
            decay, before, now = singles
            moved["x"] = decay * state["x"] + before * last, now
            held = held + jnp.sum(moved["x"][0])
        if "re" in state:
            e, b, n = doubles
            re, im = state["re"], state["im"]
            moved["re"] = np.real(e) * re - np.imag(e) * im + np.real(b) * last, np.real(n)
            moved["im"] = np.imag(e) * re + np.real(e) * im + np.imag(b) * last, np.imag(n)
            held = held + 2 * jnp.sum(moved["re"][0])

        def respond(drive: Array) -> tuple[Array, State]:
            v = drive - datum
            after = {name: x + now * v for name, (x, now) in moved.items()}
            if moved:
                after["last"] = v
            if "past" in state:
                after["past"] = jnp.concatenate([jnp.reshape(v, (1,)), state["past"][:-1]])
            return jnp.reshape(held + self.direct * v, (1,)), {"datum": datum, **after}

        return respond

    def advance(
        self, state: State, response: Array, wanted: Array, close: Array
    ) -> tuple[Array, State]:
        """The drive for an actual response [response], and the state after it.

        It is the wanted drive, where the response to that differs by no more than `close`.  From
        the second derivative on, an unwanted drive counts as slow, and derivatives stay those of
        the wanted one.
        """
        datum, respond = state["datum"], self.begin(state)
        held, direct = respond(datum)[0][0], self.direct
        ahead = self.derivatives > 1
        if ahead:
            held = held - jnp.sum(self.taps[1:] * state["past"])
            direct = direct + float(np.sum(self.taps[1:]))
        asked, as_wanted = respond(wanted)
        missed = jnp.abs(asked[0] - response) > close
        followed: Array = datum + (response - held) / direct
        drive = jnp.where(missed, followed, wanted)
        after = respond(drive)[1]
        return drive, {**after, "past": as_wanted["past"]} if ahead else after


def _differences(
    direct: float, poles: np.ndarray, residues: np.ndarray, step: float, derivatives: int
) -> np.ndarray:
    """Factors of this sample and of those before it, for direct + Σ residues/(s - poles) as its
    Taylor series up to s^K."""
    taps = np.zeros(max(derivatives + 1, _SLOPE.size if derivatives else 1))
    taps[0] = direct
    for order in range(derivatives + 1):
        coefficient = -np.sum(np.real(residues / poles ** (order + 1)))
        difference = _SLOPE if order == 1 else np.atleast_1d(np.poly(np.ones(order)))
        taps[: difference.size] += coefficient * difference / step**order
    return taps


def discretised(poles: np.ndarray, residues: np.ndarray, step: float) -> Modes:
    """The difference equations of residues/(s - poles), for a drive linear between samples."""
    x = poles.astype(complex) * step
    decay = np.exp(x)
    # ∫ e^(x(1-τ)) τ dτ and ∫ e^(x(1-τ)) (1-τ) dτ over 0..1; as series where differences cancel.
    near = np.abs(x) < _SERIES_BELOW
    small, large = np.where(near, x, 0), np.where(near, 1, x)
    series = [1 / 2 + small * (1 / 6 + small * (1 / 24 + small * (1 / 120 + small / 720)))]
    series += [1 / 2 + small * (1 / 3 + small * (1 / 8 + small * (1 / 30 + small / 144)))]
    closed = [(decay - 1 - large) / large**2, (1 - decay + large * decay) / large**2]
    now, before = (
        np.where(near, n, f) * residues * step for n, f in zip(series, closed, strict=True)
    )
    return Modes(*(_without_traces(each) for each in (decay, before, now)))


def _without_traces(values: np.ndarray) -> np.ndarray:
    """Values (n,), with 0 for those that single precision cannot hold."""
    real, imaginary = (
        np.where(np.abs(x) < _TRACE, 0.0, x) for x in (np.real(values), np.imag(values))
    )
    return real + 1j * imaginary


def static_gain(block: AbstractLinearBlock) -> float:
    """G(0) of a block, one number."""
    with jax.enable_x64(True):
        return float(np.asarray(block.static_gain()))


@section_of.register
def _(block: AbstractLinearBlock, sampling: Sampling) -> Section:
    system, name = rational(block, sampling.band), type(block).__name__
    return Linear(system, static_gain(block), sampling.step, name, block.symbol)
