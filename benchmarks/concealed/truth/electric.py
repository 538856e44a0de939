"""Effects between the command and the actuator's electrodes: amplifier, wiring, clocks."""

from __future__ import annotations

from bisect import bisect_left

import numpy as np

from ..drives import Array, Signal
from .linear import relax


def drive_lag(drive: Signal, t: Array, tau: float) -> Array:
    """Amplifier RC: tau dw/dt + w = u, exact for piecewise-linear u; tau in s."""
    v = drive(t)
    return v[0] + relax(v - v[0], t[1] - t[0], tau)


def delay(drive: Signal, t: Array, dead: float) -> Array:
    """Pure delay: u(t - dead), dead in s; the drive is constant before t = 0."""
    return drive(t - dead)


def saturation(drive: Signal, t: Array, u_max: float, width: float) -> Array:
    """Amplifier limit min(u, u_max), rounded: u - w ln(1 + exp((u - u_max)/w)); in V."""
    v = drive(t)
    if width <= 0:
        return np.minimum(v, u_max)
    return v - width * np.logaddexp(0.0, (v - u_max) / width)


def slew_rate_limit(drive: Signal, t: Array, rate: float, tau: float) -> Array:
    """Op-amp: dw/dt = S tanh((u - w)/(S tau)), S in V/s; a differential pair feeds an integrator.

    Backward Euler, whose step x = dw/(S h) solves S tau atanh(x) + S h x = u - w(before): the
    inverse is tabulated once. tau (s) is far under a step, so the limit is sharp.
    """
    v, h = drive(t), t[1] - t[0]
    x = np.tanh(np.linspace(-15, 15, 4001))  # towards +-1 the steps shrink as atanh grows
    d = rate * (tau * np.arctanh(x) + h * x)
    xs, ds, top = x.tolist(), d.tolist(), len(x) - 1
    w, out = float(v[0]), [float(v[0])]
    for u in v[1:].tolist():
        gap = u - w
        k = min(max(bisect_left(ds, gap), 1), top)
        part = min(max((gap - ds[k - 1]) / (ds[k] - ds[k - 1]), 0.0), 1.0)
        w += rate * h * (xs[k - 1] + part * (xs[k] - xs[k - 1]))
        out.append(w)
    return np.array(out)


def clock_skew(drive: Signal, t: Array, skew: float, bend: float) -> Array:
    """Recorder's clock against the amplifier's: u(t - skew (t + bend t (t/T - 1))), T the record.

    `skew` without unit (1e-4 is 100 ppm), `bend` the relative curvature of the drift.
    """
    return drive(t - skew * t * (1 + bend * (t / t[-1] - 1)))
