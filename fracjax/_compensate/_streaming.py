r"""The linear inverse sample by sample, for a real-time loop.

1/G(s) is written as a rational transfer function (`_systems`) in partial fractions
d + Σ r_k/(s - λ_k).  Each term is one difference equation, exact for a motion that is linear
between samples, with E = exp(λ h) and the step h:

    x_n = E x_{n-1} + before · v_{n-1} + now · v_n,      v = desired - datum
    u_n = direct · v_n + Σ x_n + static · (datum - offset)

Real poles give first-order sections; a complex pair gives one of second order, whose x is complex
and of which u takes twice the real part.  The datum is the motion held before the first sample; a
stage at rest has the model's zero, `offset`, as its datum.
Source: Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000) 25.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy.signal import lfilter

from .._models import Model
from .._recording import UNSTATED, InputError
from .._show import Shown
from .._systems import Band, rational
from ._inverse import linear_part_of

SCHEMA = "fracjax.inverse/1"
_FREQUENCIES = 200
"""Frequencies in the band at which the stated error is evaluated; chosen by judgement."""
_MARGIN = 300.0
"""Powers of s are followed over a band wider by this factor at either end; chosen by judgement."""
_SOUND = 1e-6
"""Partial fractions must agree with the state space to this relative error; else poles are too
close to each other to be separated.  Chosen by judgement."""


@dataclass(frozen=True, eq=False, repr=False)
class StreamingInverse(Shown):
    """Difference equations from desired response to drive, at a step of `step` [s].

    Attributes:
        model: Name of the model.
        units: Units of drive and response.
        step: The time step [s].
        band: Lowest and highest frequency between which the inverse holds [Hz].
        error: Largest relative error of the equations' frequency response within the band,
            compared with the exact inverse.
        complete: Whether the model is linear, so that this is the inverse of the whole model.
        offset: What the sensor reads where the model's response is zero [response].
        static: Drive per datum at rest [drive/response].
        direct: Gain of the present sample [drive/response].
        decay: Factor of each section's state per step (n,), complex, dimensionless; only one of a
            conjugate pair is held.
        before: Gain of each section from the previous sample (n,), complex [drive/response].
        now: Gain of each section from the present sample (n,), complex [drive/response].
    """

    model: str
    units: tuple[str, str]
    step: float
    band: tuple[float, float]
    error: float
    complete: bool
    offset: float
    static: float
    direct: float
    decay: np.ndarray
    before: np.ndarray
    now: np.ndarray

    @property
    def paired(self) -> np.ndarray:
        """Whether each section is of second order (n,)."""
        return np.imag(self.decay) != 0

    def run(self, desired: np.ndarray, *, settled: bool = True) -> np.ndarray:
        """The drive for a desired response.

        Args:
            desired: The desired response (N,) [response].
            settled: Whether the first value was held before, or else the stage was at rest.

        Returns:
            The drive (N,) [drive].
        """
        datum = desired[0] if settled else self.offset
        v = np.asarray(desired) - datum
        drive = self.direct * v + self.static * (datum - self.offset)
        for weight, e, b, n in zip(1 + self.paired, self.decay, self.before, self.now, strict=True):
            drive = drive + weight * np.real(lfilter([n, b], [1, -e], v))
        return drive

    def frequency_response(self, frequencies: np.ndarray) -> np.ndarray:
        """The frequency response of the equations from response to drive.

        Args:
            frequencies: Frequencies (F,) [Hz] below half the sampling rate.

        Returns:
            Drive over response, complex (F,) [drive/response].
        """
        z = np.exp(2j * np.pi * np.asarray(frequencies) * self.step)[:, None]

        def sections(e: np.ndarray, b: np.ndarray, n: np.ndarray) -> np.ndarray:
            return np.sum((n * z + b) / (z - e), axis=1)

        pairs = self.paired
        coefficients = (self.decay, self.before, self.now)
        conjugates = (np.conj(values[pairs]) for values in coefficients)
        return self.direct + sections(*coefficients) + sections(*conjugates)

    def to_dict(self) -> dict[str, Any]:
        """The equations as plain data, as in inverse.json.

        Returns:
            The coefficients by key; "step_s" in seconds, "band_Hz" in hertz.
        """
        one, two = (np.flatnonzero(self.paired == pair) for pair in (False, True))
        coefficients = {"decay": self.decay, "before": self.before, "now": self.now}
        return {
            "schema": SCHEMA,
            "model": self.model,
            "units": {"drive": self.units[0], "response": self.units[1]},
            "step_s": self.step,
            "band_Hz": list(self.band),
            "relative_error": self.error,
            "whole_model": self.complete,
            "equations": "v = desired - datum; x = decay x + before v_previous + now v; "
            "drive = direct v + sum of first_order x + 2 sum of second_order Re x "
            "+ static (datum - offset)",
            "offset": self.offset,
            "static": self.static,
            "direct": self.direct,
            "first_order": [{k: float(v[at].real) for k, v in coefficients.items()} for at in one],
            "second_order": [
                {k: [float(v[at].real), float(v[at].imag)] for k, v in coefficients.items()}
                for at in two
            ],
        }

    def save(self, path: str | Path) -> None:
        """Write the equations as JSON.

        Args:
            path: The file, usually inverse.json.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")

    def save_header(self, path: str | Path) -> None:
        """Write the equations as a C99 header that needs no library.

        Args:
            path: The file, usually inverse.h.
        """
        Path(path).write_text(header_of(self), encoding="utf-8")


def streaming_inverse(
    model: Model,
    step: float,
    band: tuple[float, float],
    *,
    offset: float = 0.0,
    units: tuple[str, str] = (UNSTATED["drive"], UNSTATED["response"]),
) -> StreamingInverse:
    """The inverse of a model's linear part as difference equations [L 10, 12].

    Args:
        model: The model to invert; of a nonlinear one the linear part is inverted.
        step: The time step of the real-time loop [s].
        band: Lowest and highest frequency [Hz] between which the inverse holds, the highest below
            half the sampling rate.  Powers of s are approximated over a band 300 times wider at
            either end.
        offset: What the sensor reads where the model's response is zero [response].
        units: Units of drive and response.

    Returns:
        The difference equations, with their error within the band.

    Raises:
        InputError: When the band is out of order, the model has no linear part or one that is not
            made of powers of s, or the inverse is unstable.

    Source: [L 10, 12]; Oustaloup, Levron, Mathieu & Nanot, IEEE Trans. Circuits Syst. I 47 (2000)
    25.
    """
    low, high = band
    if not (step > 0 and 0 < low < high < 0.5 / step):
        raise InputError.at(
            "streaming inverse",
            f"a band 0 < low < high below {0.5 / step:.4g} Hz",
            f"{low:.4g} to {high:.4g} Hz",
            "correct it",
        )
    part, complete = linear_part_of(model.block)
    if part is None:
        raise InputError.at(
            "streaming inverse", "a model with a linear part", model.name, "use compensate instead"
        )
    inverse = part.inverse()
    edges = Band(2 * np.pi * low / _MARGIN, 2 * np.pi * high * _MARGIN)
    system = rational(inverse, edges)
    poles, residues = system.modes()
    frequencies = np.geomspace(low, high, _FREQUENCIES)
    s = 2j * np.pi * frequencies
    modal = system.d + np.sum(residues / (s[:, None] - poles), axis=1)
    sound = np.allclose(modal, system.at(s), rtol=_SOUND, atol=0)
    if not (sound and np.all(np.real(poles) < 0)):
        raise InputError.at(
            "streaming inverse",
            "a model whose inverse is stable and has distinct poles",
            f"{np.sum(np.real(poles) >= 0)} unstable poles of {poles.size}",
            "use compensate instead",
        )
    one = np.imag(poles) >= 0
    with jax.enable_x64(True):
        exact = np.asarray(inverse.symbol(jax.numpy.asarray(s)))
        static = float(np.asarray(inverse.static_gain()))
    decay, before, now = _sections(poles[one], residues[one], step)
    inverse_filter = StreamingInverse(
        model=model.name,
        units=units,
        step=float(step),
        band=(float(low), float(high)),
        error=np.inf,
        complete=complete,
        offset=float(offset),
        static=static,
        direct=system.d,
        decay=decay,
        before=before,
        now=now,
    )
    error = np.abs(inverse_filter.frequency_response(frequencies) / exact - 1).max()
    return replace(inverse_filter, error=float(error))


def _sections(
    poles: np.ndarray, residues: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """decay, before and now (n,) of residues/(s - poles), for a motion linear between samples."""
    x = poles.astype(complex) * step
    decay = np.exp(x)
    # ∫ e^(x(1-τ)) τ dτ and ∫ e^(x(1-τ)) (1-τ) dτ over 0..1; as series where differences cancel.
    # Below |x| = 0.01 the series is accurate to 1e-13, above it the closed form to 1e-11.
    small = np.where(np.abs(x) < 1e-2, x, 0)
    large = np.where(np.abs(x) < 1e-2, 1, x)
    near = [1 / 2 + small * (1 / 6 + small * (1 / 24 + small * (1 / 120 + small / 720)))]
    near += [1 / 2 + small * (1 / 3 + small * (1 / 8 + small * (1 / 30 + small / 144)))]
    far = [(decay - 1 - large) / large**2, (1 - decay + large * decay) / large**2]
    now, before = (
        np.where(np.abs(x) < 1e-2, n, f) * residues * step for n, f in zip(near, far, strict=True)
    )
    return decay, before, now


def header_of(inverse: StreamingInverse) -> str:
    """The equations as a C header."""
    pair = inverse.paired
    parts = {
        "decay": inverse.decay, "before": inverse.before, "now": inverse.now,
    }  # fmt: skip
    one = {name: np.real(values[~pair]) for name, values in parts.items()}
    two = {
        f"{name}_{part}": kind(values[pair])
        for name, values in parts.items()
        for part, kind in (("re", np.real), ("im", np.imag))
    }
    count, pairs = int((~pair).sum()), int(pair.sum())
    low, high = inverse.band
    text = _HEADER.replace("@MODEL@", inverse.model.replace("*/", "")).replace(
        "@ABOUT@",
        f"step {inverse.step:.9g} s; desired in {inverse.units[1]}, drive in {inverse.units[0]};\n"
        f" * relative error {inverse.error:.2g} from {low:.4g} to {high:.4g} Hz",
    )
    fields = {
        "@STATE1@": f"    double x[{count}];\n" if count else "",
        "@STATE2@": f"    double re[{pairs}], im[{pairs}];\n" if pairs else "",
        "@TABLE1@": _tables("x", one) if count else "",
        "@TABLE2@": _tables("z", two) if pairs else "",
        "@START1@": _lines(f"for (int k = 0; k < {count}; ++k) s->x[k] = 0.0;") if count else "",
        "@START2@": _lines(f"for (int k = 0; k < {pairs}; ++k) s->re[k] = s->im[k] = 0.0;")
        if pairs
        else "",
        "@STEP1@": _FIRST.replace("@N@", str(count)) if count else "",
        "@STEP2@": _SECOND.replace("@N@", str(pairs)) if pairs else "",
        "@DIRECT@": repr(inverse.direct),
        "@STATIC@": repr(inverse.static),
        "@OFFSET@": repr(inverse.offset),
    }
    for name, value in fields.items():
        text = text.replace(name, value)
    return text


def _lines(statement: str) -> str:
    """A statement as an indented line of C."""
    return f"    {statement}\n"


def _tables(prefix: str, columns: dict[str, np.ndarray]) -> str:
    """The coefficients (n,) by name as constant C arrays, with every digit."""
    return "".join(
        f"static const double fracjax_inverse_{prefix}_{name}[{values.size}] = {{\n"
        + "".join(f"    {float(value)!r},\n" for value in values)
        + "};\n"
        for name, values in columns.items()
    )


_HEADER = """/* Linear inverse of @MODEL@, written by fracjax.
 * @ABOUT@.
 * Once: fracjax_inverse_start(&state, held), held being the motion before the first sample, or
 * FRACJAX_INVERSE_OFFSET for a stage at rest.  Then for every sample, the first included:
 * drive = fracjax_inverse_step(&state, desired).
 */
#ifndef FRACJAX_INVERSE_H
#define FRACJAX_INVERSE_H

#define FRACJAX_INVERSE_OFFSET (@OFFSET@)

typedef struct {
@STATE1@@STATE2@    double datum, previous;
} fracjax_inverse;

@TABLE1@@TABLE2@
static inline void fracjax_inverse_start(fracjax_inverse *s, double held)
{
@START1@@START2@    s->datum = held;
    s->previous = 0.0;
}

static inline double fracjax_inverse_step(fracjax_inverse *s, double desired)
{
    const double v = desired - s->datum;
    double drive = (@DIRECT@) * v + (@STATIC@) * (s->datum - FRACJAX_INVERSE_OFFSET);
@STEP1@@STEP2@    s->previous = v;
    return drive;
}

#endif
"""
_FIRST = """    for (int k = 0; k < @N@; ++k) {
        s->x[k] = fracjax_inverse_x_decay[k] * s->x[k]
            + fracjax_inverse_x_before[k] * s->previous + fracjax_inverse_x_now[k] * v;
        drive += s->x[k];
    }
"""
_SECOND = """    for (int k = 0; k < @N@; ++k) {
        const double re = s->re[k], im = s->im[k];
        s->re[k] = fracjax_inverse_z_decay_re[k] * re - fracjax_inverse_z_decay_im[k] * im
            + fracjax_inverse_z_before_re[k] * s->previous + fracjax_inverse_z_now_re[k] * v;
        s->im[k] = fracjax_inverse_z_decay_im[k] * re + fracjax_inverse_z_decay_re[k] * im
            + fracjax_inverse_z_before_im[k] * s->previous + fracjax_inverse_z_now_im[k] * v;
        drive += 2.0 * s->re[k];
    }
"""
