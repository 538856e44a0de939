"""The inverse and the model of a fit, sample by sample, for a real-time loop."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._blocks import AbstractBlock
from .._compensate import without_disturbances
from .._fit import Fit
from .._models import Model
from .._recording import InputError, parse_quantity
from .._show import Shown, Table, View, figure, quantity
from .._systems import Band
from ._adaptive import Adaptation, Learning
from ._chain import chain_of
from ._program import InverseProgram, Limits, ModelProgram, Output, Program, revived_step
from ._promise import Promised, promised
from ._sections import Linear, Sampling, Section, State, section_of
from ._stages import Filtered, Solved

_MARGIN = 300.0
"""Powers of s are followed over a band wider by this factor at either end; chosen by judgement."""
_REACH = 20.0
"""A derivative rolls off at this factor above the band; chosen by judgement."""
_TOP, _PERIODS = 0.02, 0.1
"""The band by default: up to this share of the sampling rate, and from this many periods in the
recording; chosen by judgement."""
_SHORTEST = 1e-3
"""The band starts at this share of its end where no recording is known; chosen by judgement."""
SCHEMA = "fracjax.stream/1"
EPS = float(np.finfo(float).eps)


class Streamed(NamedTuple):
    """What a stream gave for N samples.

    Attributes:
        output: The drive of an inverse, the response of a model (N,), in its unit.
        predicted: The response that the model predicts (N,) [response].
        flags: What happened at each sample (N,), a sum of the keys of `FLAGS`; 0 for nothing.
        state: The state after the last sample, from which the stream goes on.
    """

    output: np.ndarray
    predicted: np.ndarray
    flags: np.ndarray
    state: State


@dataclass(frozen=True, eq=False, repr=False)
class _Streaming(Shown):
    """What an inverse and a model share.

    Attributes:
        model: Name of the model.
        units: Units of drive and response.
        step: The time step [s].
        band: Lowest and highest frequency between which the linear parts hold [Hz].
        error: Largest relative error of the linear parts within the band, compared with their
            transfer functions.
        limits: Lowest and highest drive [drive].
        slew: Fastest change of the drive [drive/s]; None for no limit.
        offset: What the sensor reads where the model's response is zero [response].
        left_out: Names of the blocks left out because they belong to the recorded run alone.
        whole: The model without the blocks left out.
    """

    model: str
    units: tuple[str, str]
    step: float
    band: tuple[float, float]
    error: float
    limits: tuple[float, float]
    slew: float | None
    offset: float
    left_out: tuple[str, ...]
    whole: Model
    program: Program

    def start(self, drive: float = 0.0) -> State:
        """The state of a stage that has rested at a drive for long.

        Args:
            drive: The drive [drive], within the limits.  Where the history of a stage is not known,
                go to a limit and to 0 twice, and start there.

        Returns:
            The state, a tree of arrays of fixed sizes.
        """
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, self.program.start(jnp.asarray(float(drive))))

    @cached_property
    def _scan(self) -> Any:
        """The compiled recursion over samples (N, inputs)."""

        def step(state: State, sample: tuple) -> tuple[State, Output]:
            output, state = revived_step(self.program, jnp.asarray(EPS), state, sample)
            return state, output

        return jax.jit(lambda state, samples: jax.lax.scan(step, state, samples))

    def _stream(self, samples: tuple[np.ndarray, ...], state: State) -> Streamed:
        """The outputs for samples, each (N,), from a state."""
        with jax.enable_x64(True):
            after, out = self._scan(state, tuple(jnp.asarray(x, float) for x in samples))
            return Streamed(
                np.asarray(out.output),
                np.asarray(out.predicted),
                np.asarray(out.flags),
                jax.tree.map(np.asarray, after),
            )

    def write_c(self, folder: str | Path, name: str = "stage", real: str = "double") -> list[Path]:
        """Write the stream as C99: NAME.c and NAME.h, a test vector, and a Makefile that checks it.

        Args:
            folder: Where to write; it is made where missing.
            name: The prefix of files, types and functions, a C identifier.
            real: "double" or "float".

        Returns:
            The files.

        Raises:
            InputError: When the name is no C identifier or the type is another one.
        """
        from ._c import write_c

        return write_c(self, Path(folder), name, real)

    def to_dict(self) -> dict[str, Any]:
        """What the stream is, as plain data.

        Returns:
            The content by key, with the units in the keys or under "units".
        """
        return {
            "schema": SCHEMA,
            "model": self.model,
            "units": {"drive": self.units[0], "response": self.units[1]},
            "step_s": self.step,
            "band_Hz": list(self.band),
            "relative_error": self.error,
            "limits": list(self.limits),
            "slew_per_s": self.slew,
            "offset": self.offset,
            "left_out": list(self.left_out),
        }

    def _view(self) -> View:
        drive, _ = self.units
        low, high = self.limits
        slew = "" if self.slew is None else f", {quantity(self.slew, f'{drive}/s')} at most"
        rows = [
            ["step", quantity(self.step, "s")],
            ["band", f"{figure(self.band[0])} to {quantity(self.band[1], 'Hz')}"],
            ["linear parts within", f"{figure(100 * self.error)} % in the band"],
            ["drive", f"{figure(low)} to {quantity(high, drive)}{slew}"],
            *([["left out", ", ".join(self.left_out)]] if self.left_out else []),
        ]
        return View(f"{type(self).__name__} of {self.model}.", [Table([], rows)])


@dataclass(frozen=True, eq=False, repr=False)
class StreamingInverse(_Streaming):
    """The inverse of a model sample by sample: from desired response to drive.

    `start` gives the state of a stage at rest, `run` the drive; `write_c` writes both as C.

    Attributes:
        adaptation: How the gains follow the stage in the loop; None where they are fixed.
    """

    adaptation: Adaptation | None = None

    def settled(self, response: float) -> State:
        """The state of a stage that has rested at a response for long.

        Args:
            response: The response [response].

        Returns:
            The state, at the drive within the limits whose response at rest is nearest.
        """
        program = self.program
        assert isinstance(program, InverseProgram)
        with jax.enable_x64(True):
            drives = jnp.linspace(*self.limits, 257)
            rests = jax.vmap(lambda u: program.chain.start(u)[0])(drives) + program.offset
            sign = 1.0 if rests[-1] > rests[0] else -1.0
            drive = jnp.interp(sign * response, sign * rests, drives)
        return self.start(float(drive))

    def promise(self) -> list[Promised]:
        """The errors to expect of the inverse along sines, by frequency and height.

        They are simulated by the whole model off the loop, and count what the stream approximates
        and where its limits bind.  What the model itself lacks comes on top.

        Returns:
            A row for each sine, with its frequency [Hz], height [response] and error.
        """
        ends = [float(self.start(drive)["desired"]) for drive in self.limits]
        return promised(self, self.whole, (ends[0], ends[1]))

    def run(
        self,
        desired: np.ndarray,
        state: State | None = None,
        *,
        measured: np.ndarray | None = None,
    ) -> Streamed:
        """The drive for a desired response, sample by sample.

        Args:
            desired: The desired response (N,) [response].
            state: The state before the first sample; by default that of a stage which has rested at
                the first value.
            measured: The measured response (N,) [response], for an adaptive inverse only: each is
                used for the samples after it.

        Returns:
            The drive (N,), the predicted response, the flags and the state at the end.

        Raises:
            InputError: When measured samples are missing, or given to an inverse that is fixed.
        """
        desired = np.asarray(desired, float)
        if (measured is None) != (self.adaptation is None):
            raise InputError.at(
                "streaming inverse, measured",
                "the measured response of an adaptive inverse, and of no other",
                "none" if measured is None else "one for a fixed inverse",
                "give measured=… with adaptive=…, or neither",
            )
        if state is None:
            state = self.settled(float(desired[0]))
        samples = (desired,) if measured is None else (desired, np.asarray(measured, float))
        return self._stream(samples, state)


@dataclass(frozen=True, eq=False, repr=False)
class StreamingModel(_Streaming):
    """A model sample by sample: from the drive that was applied to the response.

    It observes the hysteresis of a driven stage, for a feed-forward or a Smith predictor.
    """

    def run(self, drive: np.ndarray, state: State | None = None) -> Streamed:
        """The response to a drive, sample by sample.

        Args:
            drive: (N,) [drive].
            state: The state before the first sample; by default that of a stage which has rested at
                the first value.

        Returns:
            The response (N,), the flags and the state at the end.
        """
        drive = np.asarray(drive, float)
        state = self.start(float(drive[0])) if state is None else state
        return self._stream((drive,), state)


class _Given(NamedTuple):
    """What a stream is made of."""

    block: AbstractBlock
    sampling: Sampling
    shared: dict[str, Any]
    limits: Limits
    offset: float


def _given(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None,
    limits: tuple[float, float] | None,
    slew: float | None,
    offset: float | None,
    units: tuple[str, str] | None,
) -> _Given:
    """The block with everything that a stream of it needs, checked."""
    duration, where = None, "streaming"
    if isinstance(model, Fit):
        setting, recording = model.preparation.setting, model.preparation.takes[0].recording
        limits = limits or (setting.drive_low, setting.drive_high)
        offset = model.offsets[0] if offset is None else offset
        units = units or (recording.drive_unit, recording.response_unit)
        duration, model = setting.duration, model.model
    if not isinstance(model, Model):
        raise InputError.at(where, "a fit or a model", type(model).__name__, "give fj.fit(…)")
    step = parse_quantity(step, "s", f"{where}, step")
    if not 0 < step < np.inf:
        raise InputError.at(f"{where}, step", "a time above 0 s", f"{step:g} s", "correct it")
    if limits is None or not -np.inf < limits[0] < limits[1] < np.inf:
        raise InputError.at(
            f"{where}, limits",
            "lowest and highest drive, which a loop must never leave",
            "none" if limits is None else f"{limits[0]} and {limits[1]}",
            "give limits=(low, high), or a fit, whose recorded range is taken",
        )
    if slew is not None and not 0 < slew < np.inf:
        raise InputError.at(f"{where}, slew", "a rate above 0", f"{slew}", "correct it")
    band = usual_band(step, duration) if band is None else band
    bottom, top = map(float, band)
    if not 0 < bottom < top < 0.5 / step:
        raise InputError.at(
            f"{where}, band",
            f"0 < low < high below {0.5 / step:.4g} Hz",
            f"{bottom:.4g} to {top:.4g} Hz",
            "correct it",
        )
    block, left_out = without_disturbances(model.block)
    if block is None:
        raise InputError.at(where, "a model with a drive", model.name, "choose another model")
    low, high = map(float, limits)
    omega = 2 * np.pi * bottom, 2 * np.pi * top
    edges = Band(omega[0] / _MARGIN, omega[1] * _MARGIN, _REACH * omega[1])
    sampling = Sampling(step, edges, *omega, low, high)
    change = high - low if slew is None else min(slew * step, high - low)
    shared = {
        "model": model.name,
        "units": units or ("V", "um"),
        "step": step,
        "band": (bottom, top),
        "limits": (low, high),
        "slew": slew,
        "offset": offset or 0.0,
        "left_out": left_out,
        "whole": Model(block, model.name),
    }
    return _Given(block, sampling, shared, Limits(low, high, change), offset or 0.0)


def usual_band(step: float, duration: float | None) -> tuple[float, float]:
    """The band [Hz] for a loop's step [s], and a recording of a duration [s] if there is one."""
    top = _TOP / step
    return (min(_PERIODS / duration, _SHORTEST * top) if duration else _SHORTEST * top), top


def streaming_inverse(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    slew: float | None = None,
    offset: float | None = None,
    units: tuple[str, str] | None = None,
    adaptive: Adaptation | None = None,
) -> StreamingInverse:
    """The inverse of a whole model, hysteresis included, sample by sample for a real-time loop.

    A nonlinear law is solved for its drive at every sample, and remembers the drive that was
    applied; linear laws in series with it are difference equations of 1/G(s).  One step takes a
    bounded time and a fixed memory.

    Args:
        model: A fit, or a model, which needs limits.
        step: The time step of the loop [s], or a text such as "50 us".
        band: Lowest and highest frequency [Hz] between which linear parts hold, the highest below
            half the sampling rate; by default up to 2 % of the sampling rate.
        limits: Lowest and highest drive [drive]; by default the range of the fit's recording.
        slew: Fastest change of the drive [drive/s]; None for no limit.
        offset: What the sensor reads where the model's response is zero [response]; by default
            that of the fit, or 0.
        units: Units of drive and response; by default those of the fit, or V and um.
        adaptive: How the gains follow the stage by its measured motion; None for fixed gains.

    Returns:
        The inverse, with the error of its linear parts.

    Raises:
        InputError: When a value is out of order, a law does not run sample by sample, or the model
            has no inverse.

    Source: Krejci & Kuhnen, IEE Proc. Control Theory Appl. 148 (2001) 185; Hanus, Kinnaert &
    Henrotte, Automatica 23 (1987) 729, for the limits.
    """
    given = _given(model, step, band, limits, slew, offset, units)
    chain = chain_of(given.block, given.sampling)
    learning = None if adaptive is None else Learning(chain, adaptive, given.sampling.step)
    sections = [
        stage.inverse if isinstance(stage, Filtered) else stage.section
        for stage in chain.stages
        if isinstance(stage, Filtered | Solved)
    ]
    return StreamingInverse(
        **given.shared,
        error=_error(sections, given.shared["band"]),
        program=InverseProgram(chain, given.offset, given.limits, learning),
        adaptation=adaptive,
    )


def streaming_model(
    model: Fit | Model,
    step: float | str,
    band: tuple[float, float] | None = None,
    *,
    limits: tuple[float, float] | None = None,
    offset: float | None = None,
    units: tuple[str, str] | None = None,
) -> StreamingModel:
    """A whole model sample by sample: the response to the drive that was applied.

    Args:
        model: A fit, or a model, which needs limits.
        step: The time step of the loop [s], or a text such as "50 us".
        band: Lowest and highest frequency [Hz] between which linear parts hold, as in
            `streaming_inverse`.
        limits: Lowest and highest drive [drive]; by default the range of the fit's recording.
        offset: What the sensor reads where the model's response is zero [response]; by default
            that of the fit, or 0.
        units: Units of drive and response; by default those of the fit, or V and um.

    Returns:
        The model, with the error of its linear parts.

    Raises:
        InputError: When a value is out of order, or a law does not run sample by sample.

    Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25, for
    fractional powers.
    """
    given = _given(model, step, band, limits, None, offset, units)
    section = section_of(given.block, given.sampling)
    return StreamingModel(
        **given.shared,
        error=_error([section], given.shared["band"]),
        program=ModelProgram(section, given.offset, given.limits),
    )


def _error(sections: list[Section], band: tuple[float, float]) -> float:
    """The largest error of linear sections, and of those within others, in a band [Hz]."""
    errors = [0.0]
    for section in sections:
        if isinstance(section, Linear):
            errors.append(section.error(band))
        if section.parts:
            errors.append(_error(list(section.parts), band))
    return max(errors)
