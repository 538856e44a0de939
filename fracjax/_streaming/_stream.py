"""A stream, and what it gives: inverse and model sample by sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._models import Model
from .._recording import InputError
from .._show import Shown, Table, View, figure, quantity
from ._adaptive import Adaptation
from ._c import write_c, write_fmu
from ._program import Described, InverseProgram, Output, Program, revived_step
from ._promise import Promise, Sine, promised
from ._sections import State
from ._stages import Filtered

SCHEMA = "fracjax.stream/1"
_FAR = 0.1
"""The inverse fails where its linear parts have a larger relative error; chosen by judgement."""
_FREQUENCIES = 400
"""Frequencies at which that is looked for; chosen by judgement."""
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
        draws: Draws of the parameters by name, from a fit's covariance; None where no fit is known.
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
    draws: Mapping[str, np.ndarray] | None
    program: Program

    def start(self, drive: float = 0.0) -> State:
        """The state of a stage that has rested at a drive for long.

        Args:
            drive: The drive [drive], within the limits.  Where the history of a stage is not known,
                start there and follow a slow motion over the whole range twice: stage and state
                then remember that alone.

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
        return write_c(self._described, Path(folder), name, real)

    def write_fmu(self, folder: str | Path, name: str = "stage") -> Path:
        """Write the stream as NAME.fmu, for co-simulation by FMI 3.0, in double precision.

        It holds the sources, for tools that compile them, and a library for this machine where
        there is a C compiler.  A communication step is a multiple of the loop's; its outputs are
        those of its last sample.  The parameter `rest` is the drive at which the stage has rested.

        Args:
            folder: Where to write; it is made where missing.
            name: The name of file and model, a C identifier.

        Returns:
            The file.

        Raises:
            InputError: When the name is no C identifier, or the compiler does not work.
        """
        return write_fmu(self._described, Path(folder), name)

    @cached_property
    def _described(self) -> Described:
        """The stream, as code is written from it."""
        return Described(
            self.program,
            self.model,
            self.units,
            self.step,
            self.limits,
            str(self.summary()),
            self.start,
            lambda inputs, state: self._stream(inputs, state)[:3],
        )

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
    """The inverse of a model sample by sample: from desired response [response] to drive [drive].

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

    def promise(self, draws: Mapping[str, np.ndarray] | None = None) -> Promise:
        """The errors to expect of the inverse along sines, by frequency and height.

        They are simulated by the whole model off the loop, and count what the stream approximates
        and where its limits bind.  What the model itself lacks comes on top.

        Args:
            draws: Values (D,) of the model's free parameters by name, such as `Posterior.samples`,
                for intervals; by default from the covariance of the fit.

        Returns:
            The error along each sine, and sentences on where the inverse must fail.

        Raises:
            InputError: When the draws lack a parameter.
        """
        ends = [float(self.start(drive)["desired"]) - self.offset for drive in self.limits]

        def drive(desired: np.ndarray) -> Sine:
            streamed = self.run(desired + self.offset, measured=self._unmeasured(desired))
            return Sine(streamed.output, streamed.flags)

        rows = promised(
            drive,
            self._linear_error,
            self.whole,
            self.step,
            (ends[0], ends[1]),
            self.draws if draws is None else draws,
        )
        return Promise(self.model, self.units[1], self.step, rows, tuple(self._failures()))

    def _unmeasured(self, desired: np.ndarray) -> np.ndarray | None:
        """No measured motion (N,), by which the gains of an adaptive inverse stay those of the
        fit."""
        return None if self.adaptation is None else np.full(desired.size, np.nan)

    def _linear_error(self, frequencies: np.ndarray) -> np.ndarray:
        """The largest relative error of the inverted linear parts at frequencies (F,) [Hz]."""
        program = self.program
        assert isinstance(program, InverseProgram)
        parts = [stage.inverse for stage in program.chain.stages if isinstance(stage, Filtered)]
        errors = [np.zeros(len(frequencies)), *(part.errors(frequencies) for part in parts)]
        return np.max(errors, axis=0)

    def _failures(self) -> list[str]:
        """Where the inverse must fail."""
        drive, sentences = self.units[0], []
        low, high = self.limits
        sentences.append(
            f"A motion that needs a drive beyond {figure(low)} to {quantity(high, drive)} ends at "
            "the limit."
        )
        if self.slew is not None:
            fastest = self.slew / (np.pi * (high - low))
            sentences.append(
                f"A sine over the whole range of the drive is followed up to "
                f"{quantity(float(fastest), 'Hz')}: beyond, it changes by more than "
                f"{quantity(self.slew, f'{drive}/s')}."
            )
        frequencies = np.geomspace(self.band[0], 0.499 / self.step, _FREQUENCIES)
        far = frequencies[self._linear_error(frequencies) > _FAR]
        if far.size:
            sentences.append(
                f"From {quantity(float(far[0]), 'Hz')} on the linear parts miss by more than "
                f"{figure(100 * _FAR)} %: a mode, a lag or a delay is inverted up to there only."
            )
        return sentences

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
    """A model sample by sample: from the applied drive [drive] to the response [response].

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
