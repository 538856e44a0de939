"""Effects against oracles of another kind, at zero amplitude, and with the step halved."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lsim, lti

from .actuator import grid, rms
from .drives import Array
from .templates import TEMPLATES, floor_of, make_drive
from .truth import (
    BASES,
    EFFECTS,
    OUTSIDE,
    Scene,
    Sliding,
    drive_side,
    play,
    rayleigh,
    response_side,
)
from .truth.electric import clock_skew, slew_rate_limit
from .truth.material import cubic_nonlinearity, viscoelastic_layer
from .truth.mechanics import backlash, coulomb_friction, lost_contact, second_mode
from .truth.sensor import quantisation, sensor_lag, sensor_nonlinearity
from .truth.thermal import gain_drift

H = 1e-4
T = np.arange(0, 2, H)
Y = 4 * np.sin(2 * np.pi * 1.5 * T) * np.exp(-T / 3)
Y -= Y[0]
ALL = EFFECTS | OUTSIDE


def scene(keep: int = 8) -> tuple[Scene, Array]:
    return Scene.of(10 * Y, Y, H, keep * H), 10 * Y


@pytest.mark.parametrize("name", list(ALL))
def test_zero_amplitude_is_identity(name: str) -> None:
    e, (where, u) = ALL[name], scene()
    p = e.parameters(0.0, e.shape(np.random.default_rng(0)), where)
    drive = lambda t: np.interp(t, T, u)  # noqa: E731
    if e.side == "Q":
        assert np.array_equal(e.apply(Y, **p), Y)
    elif e.side == "I":
        assert np.max(np.abs(drive_side([(e, p)], drive, T) - u)) < 1e-3  # V: the op-amp's own lag
    else:
        assert np.max(np.abs(response_side([(e, p)], drive, T, Y) - Y)) < 1e-9


@pytest.mark.parametrize("name", [k for k, e in ALL.items() if e.side != "Q"])
@pytest.mark.parametrize("template", ["rich", "reversal_curves"])
def test_halving(name: str, template: str) -> None:
    """Halving the step changes an effect of at most 30 noise sd by under 2 % of the noise.

    On a static actuator of 0.1 um/V, so that the law alone is tested; noise 0.1 % of the range.
    """
    e = ALL[name]
    drive = make_drive(template, 4, 1000.0, 3000)
    out = []
    where, p, base = None, {}, None
    for over in (16, 8):
        t = grid(drive, over)
        u = drive(t)
        if where is None:
            where = Scene.of(u, 0.1 * (u - u[0]), t[1], 1 / drive.rate)
            p = e.parameters(e.typical, e.shape(np.random.default_rng(1)), where)
        v = drive_side([(e, p)], drive, t)
        out.append(response_side([(e, p)], drive, t, 0.1 * (v - u[0]))[::over])
        base = 0.1 * (u - u[0])[::over]
    change = out[0] - base
    unit = min(1.0, 0.03 * where.stroke / max(rms(change), 1e-9))  # at most 30 noise sd
    assert unit * rms(out[0] - out[1]) < 2e-5 * where.stroke


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_sensor_lag_is_a_bessel_filter(order: int) -> None:
    """Group delay tau at low frequency, unit gain: a ramp comes out tau late."""
    tau = 5e-3
    got = sensor_lag(T, T.copy(), tau, order)
    assert np.max(np.abs(got - (T - tau))[T > 0.2]) < 1e-9


def test_second_mode_against_lsim() -> None:
    w, mass, ratio, z1, z2 = 2 * np.pi * 100, 0.3, 1.2, 0.03, 0.02
    v = ratio * w
    # by hand, D = s^2 + 2 z2 v s + v^2: x (s^2 + 2 z1 w s + w^2 + m s^2 (D - s^2)/D) = w^2 y
    d2, low = np.array([1, 2 * z2 * v, v * v]), np.array([2 * z2 * v, v * v])
    first = np.polymul([1, 2 * z1 * w, w * w], d2)
    den = np.polyadd(first, mass * np.polymul([1, 0, 0], low))
    _, want, _ = lsim(lti(w * w * d2, den), Y, T)
    assert np.max(np.abs(second_mode(T, Y, 0.01, mass, ratio, [z1, z2]) - want)) < 1e-7


def test_viscoelastic_layer_against_ode() -> None:
    k, arms, taus = 0.2, [0.5, 0.3, 0.4], [0.01, 0.1, 0.6]
    g, tau = np.array(arms), np.array(taus)
    w = 2 * np.pi * 1.5

    def drive(t: float) -> float:
        return 4 * np.sin(w * t) * np.exp(-t / 3)

    def slope(t: float, q: Array) -> Array:  # q: dashpot strokes; arm force g (d - q)
        d = (k * drive(t) + g @ q) / (1 + k + g.sum())
        return (d - q) / tau

    found = solve_ivp(slope, (0, T[-1]), [0.0] * 3, "Radau", T[::50], rtol=1e-9, atol=1e-11)
    y = np.array([drive(t) for t in T[::50]])
    want = y - (k * y + g @ found.y) / (1 + k + g.sum())
    assert np.max(np.abs(viscoelastic_layer(T, Y, k, arms, taus)[::50] - want)) < 1e-6


def test_gain_drift_against_ode() -> None:
    core, case, share, power = 0.3, 1.1, 0.6, 500.0
    u = 10 * Y
    heat = np.abs(u * np.gradient(u, H)) / power

    def slope(t: float, x: Array) -> list[float]:
        flow, out = (x[0] - x[1]) / share, x[1] / (1 - share)
        return [(np.interp(t, T, heat) - flow) / core, (flow - out) / case]

    found = solve_ivp(slope, (0, T[-1]), [0.0, 0.0], "RK45", T[::50], rtol=1e-8, max_step=1e-3)
    got = gain_drift(T, Y, u, 0.05, power, core, case, share)[::50]
    assert np.max(np.abs(got - Y[::50] * (1 + 0.05 * found.y[0]))) < 1e-5


def test_backlash_is_play_where_engagement_is_sharp() -> None:
    sharp = backlash(T, Y, 0.2, 1.0, 200.0)
    assert np.max(np.abs(sharp - play(Y, 0.2))) < 0.01
    z = Sliding(12.0, 0.0).along(Y, 1 / 0.2)
    step = np.diff(z) * 0.2 / np.where(np.diff(Y) == 0, 1, np.diff(Y))
    assert np.abs(z).max() <= 1 + 1e-9
    assert step.min() > -1e-6
    assert step.max() < 1 + 1e-6


def test_friction_against_adaptive_ode() -> None:
    b, stick, vs, w = 0.05, 0.4, 3.0, 2 * np.pi * 1.5

    def slope(t: float, z: Array) -> Array:
        v = 4 * np.exp(-t / 3) * (w * np.cos(w * t) - np.sin(w * t) / 3)
        return v - abs(v) * z / (b * (1 + stick * np.exp(-((v / vs) ** 2))))

    found = solve_ivp(slope, (0, 1.0), [0.0], "LSODA", T[:10000:20], rtol=1e-8, max_step=1e-3)
    got = (Y - coulomb_friction(T, Y, 1.0, b, stick, vs))[:10000:20] * b
    assert np.max(np.abs(got - found.y[0])) < 2e-3 * b


def test_lost_contact_balances_its_forces() -> None:
    x = lost_contact(T, Y, -0.5, 0.01)
    assert np.array_equal(x[Y < -0.5], np.full(np.sum(Y < -0.5), x.min()))
    on = Y > -0.4
    assert np.allclose((Y - x)[on] ** 1.5 / 0.1, (x + 0.5)[on], rtol=1e-6)


def test_slew_rate_limit() -> None:
    """Below the limit the output is the input, above it moves at the limit until it catches up."""
    step = lambda t: np.where(t > 0.1, 10.0, 0.0) + 5 * t  # noqa: E731
    w = slew_rate_limit(step, T, 20.0, 2e-7)
    s = np.diff(w) / H
    assert np.max(np.abs(w - step(T))[(T < 0.1) | (T > 0.1 + 11 / 15 + H)]) < 1e-3
    assert np.max(s) < 20.0 * (1 + 1e-9)
    assert np.all(s[(T[1:] > 0.101) & (T[1:] < 0.75)] > 20 * 0.999)


def test_rayleigh_return_point_memory() -> None:
    """Madelung: a closed inner loop leaves no trace; branches are parabolas between their ends."""
    legs = [0, 5, -3, 4, 1, 4, -3, 2, 0, 2, -3, 5, 7]
    v = np.concatenate([np.linspace(a, b, 101)[:-1] for a, b in pairwise(legs)])
    r = rayleigh(v)
    assert r[100] == pytest.approx(25)
    assert r[200] == pytest.approx(25 - 2 * 16)
    assert r[300] == pytest.approx(25 - 32 + 2 * 3.5**2)
    assert r[500] == pytest.approx(r[300])  # the loop 4, 1, 4 closes
    assert r[600] == pytest.approx(r[200])
    assert r[1000] == pytest.approx(r[200])
    assert r[1100] == pytest.approx(25)
    assert r[-1] == pytest.approx(v[-1] ** 2)


def test_static_laws() -> None:
    x = Y / 10
    hard = cubic_nonlinearity(lambda t: x, T, 0.02, 0.0)
    assert np.max(np.abs(hard - x - 0.02 * x**3)) < 1e-5
    soft = cubic_nonlinearity(lambda t: x, T, -0.02, 0.0)
    assert np.max(np.abs(soft - x + 0.02 * x**3)) < 1e-5
    bent = sensor_nonlinearity(T, x, 0.01, 0.0, 1.0)
    assert np.max(np.abs(bent - x - 0.01 * x**2 - 1e-4 * x**3)) < 1e-6
    skew = clock_skew(lambda t: t, T, 1e-3, 0.2)
    assert skew[-1] == pytest.approx(T[-1] * (1 - 1e-3))
    assert np.max(np.abs(np.diff(skew) / H - 1)) < 1.3e-3


def test_quantisation_has_steps_and_size() -> None:
    y = np.random.default_rng(0).standard_normal(50_000)
    q = quantisation(y, 0.3, 0.37, 0.0, 1)
    codes = (q / 0.3 - 0.5 + 0.37).round(6)
    assert np.max(np.abs(codes - codes.round())) < 1e-5
    assert np.std(q - y) == pytest.approx(0.3 / np.sqrt(12), rel=0.02)
    assert np.max(np.abs(q - y)) <= 0.15 + 1e-12


@pytest.mark.parametrize("name", list(TEMPLATES))
@pytest.mark.parametrize(("samples", "rate"), [(2000, 200.0), (8000, 20_000.0)])
def test_templates(name: str, samples: int, rate: float) -> None:
    """Every template fits its samples, stays in range, repeats exactly, shows rests that rest."""
    d = make_drive(name, 9, rate, samples)
    u = d(d.times)
    assert 0.98 * samples <= len(u) <= samples
    assert u.min() > -25
    assert u.max() < 115
    if d.period:
        n = round(d.period * rate)
        assert np.max(np.abs(u[n : 2 * n] - u[:n])) < 1e-9
    for a, b in d.rests:
        inside = u[(d.times > a + 1e-9) & (d.times < b - 1e-9)]
        assert inside.size == 0 or np.ptp(inside) < 1e-9
    assert floor_of(d) in ("rest", "periods", "none")


@pytest.mark.parametrize("base", list(BASES))
@pytest.mark.parametrize("template", ["bursts", "steps"])
def test_base_on_the_exams_grid(base: str, template: str) -> None:
    """At 8 steps per sample, halving changes a base by under 2 % of the noise after a gain fit."""
    d, law = make_drive(template, 2, 1000.0, 2000), BASES[base].draw(np.random.default_rng(1))
    y = []
    for over in (8, 16):
        t = grid(d, over)
        y.append(BASES[base].response(d(t), t[1], law)[::over])
    assert rms(y[0] - y[1]) < 2e-5 * np.ptp(y[1])
