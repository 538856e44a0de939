"""The simulator against closed forms, against halved steps, and at zero amplitude."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from .cases import fine_grid, make_case
from .drives import DRIVES
from .truth import BASES, EFFECTS, Path, noise, play, power_derivative, relax, resonance, whiten

H = 1 / 16000
T = np.arange(0, 4 + H / 2, H)


@pytest.mark.parametrize("order", [-0.9, -0.5, -0.13, -0.01, -1e-17, 1e-9, 0.01, 0.14, 0.5, 0.9])
@pytest.mark.parametrize("k", [1.0, 2.0])
def test_operator_of_powers(order: float, k: float) -> None:
    got = Path(20 + T**k, H).derivative(order)
    want = power_derivative(T, k, order)
    assert np.max(np.abs(got - want)[3:]) < 2e-5 * want[-1]  # not right after the corner at 0


def test_operator_of_sine_against_mpmath() -> None:
    w, a, t = 2 * np.pi * 3, 0.3, 1.0
    with mpmath.workdps(25):
        cycles = mpmath.linspace(0, t, 13)
        value = mpmath.quad(lambda s: w * mpmath.cos(w * (t - s)) * s**-a, cycles)
        want = float(value / mpmath.gamma(1 - a))
    got = Path(np.sin(w * T), H).derivative(a)[16000]
    assert abs(got - want) < 1e-5 * w**a


def mittag_leffler(chi: float, mu: float, b: float, t: float) -> float:
    with mpmath.workdps(120):
        m = mpmath.mpf(mu)
        z = -(mpmath.mpf(t) ** m) / chi
        return float(sum(z**k / mpmath.gamma(m * k + b) for k in range(700)))


def test_lfdh_ramp_against_mittag_leffler() -> None:
    """Ramp through 1/(1 + chi s^mu): t - t E_{mu,2}(-t^mu/chi)."""
    chi, mu = 0.2, 0.4
    got = BASES["lfdh"].columns(Path(T, H), chi, mu, 0.08)
    for t in (0.01, 0.5):
        one, two = mittag_leffler(chi, mu, 2.0, t), mittag_leffler(chi, mu, 2 + mu - 0.08, t)
        i = round(t / H)
        assert got[0][i] == pytest.approx(t * (1 - one), rel=1e-5)
        assert got[1][i] == pytest.approx(t ** (1 + mu - 0.08) * two / chi, rel=1e-5)


def test_coupled_is_creep_after_foh() -> None:
    u = 40 + 30 * np.sin(2 * np.pi * T)
    law = BASES["foh"].draw(np.random.default_rng(0))
    y = BASES["foh"].response(u, H, law)
    want = Path(y, H).derivative(-0.02)
    got = BASES["coupled"].response(u, H, law | {"mu": 0.02})
    assert np.max(np.abs(got - want)) < 1e-5 * np.ptp(want)


def test_bouc_wen_against_adaptive_ode() -> None:
    rho, sigma, n, w = 0.05, 1.3, 1.6, 2 * np.pi

    def slope(t: float, h: np.ndarray) -> np.ndarray:
        du, a = 40 * w * np.cos(w * t), np.abs(h)
        return rho * (du - sigma * abs(du) * a ** (n - 1) * h + (sigma - 1) * du * a**n)

    want = solve_ivp(
        slope, (0, 2), [0.0], "LSODA", T[:32001:32], rtol=1e-10, atol=1e-12, max_step=0.01
    )
    got = BASES["bouc_wen"].columns(Path(40 * np.sin(w * T[:32001]), H, 32), rho, sigma, n)[1]
    assert np.max(np.abs(got - want.y[0])) < 1e-5


@pytest.mark.parametrize("base", list(BASES))
@pytest.mark.parametrize("drive", ["bursts", "reversal_curves"])
def test_halving(base: str, drive: str) -> None:
    """Halving the step changes the truth by under 2 % of the noise (0.1 % of range)."""
    d, law = DRIVES[drive](), BASES[base].draw(np.random.default_rng(1))
    y = []
    for over in (32, 64):
        t = fine_grid(d, over)
        y.append(BASES[base].response(d(t), t[1], law)[::over])
    assert np.sqrt(np.mean((y[0] - y[1]) ** 2)) < 2e-5 * np.ptp(y[1])


def test_effects_against_closed_forms() -> None:
    ramp = T.copy()
    tau = 3e-3
    assert np.allclose(relax(ramp, H, tau), T - tau * (1 - np.exp(-T / tau)), rtol=0, atol=1e-12)
    w, z = 2 * np.pi * 200, 0.05
    wd = w * np.sqrt(1 - z * z)
    ring = np.exp(-z * w * T) * (2 * z / w * np.cos(wd * T) + (2 * z * z - 1) / wd * np.sin(wd * T))
    assert np.allclose(resonance(T, ramp, 1 / 200, z), T - 2 * z / w + ring, rtol=0, atol=1e-9)
    t0, gain = 0.1, 0.02
    log = EFFECTS["creep"].apply(T, ramp, gain=gain, t0=t0)
    primitive = (T + t0) * np.log1p(T / t0) - T
    assert np.allclose(log, T + gain * primitive / np.log(10), rtol=0, atol=1e-9)
    v, slow = 50 * np.sin(7 * T) * np.exp(-T / 3), []
    p = v[0]
    for x in v:
        p = max(x - 8, min(x + 8, p))
        slow.append(p)
    assert np.allclose(play(v, 8.0), slow, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "colour", "tails", "swing"),
    [("white", 0, 3, 1), ("ar", 0.6, 3, 1), ("heavy", 0, 12, 1), ("varying", 0, 4.59, 4)],
)
def test_noise(kind: str, colour: float, tails: float, swing: float) -> None:
    """Size, correlation of neighbours, kurtosis, and the range of its local size."""
    x = noise(kind, 200_000, 0.01, np.random.default_rng(0))
    assert np.std(x) == pytest.approx(0.01, rel=0.03)
    assert np.mean(x[1:] * x[:-1]) / np.var(x) == pytest.approx(colour, abs=0.01)
    kurtosis = np.mean(x**4) / np.var(x) ** 2
    assert kurtosis > 5 if kind == "heavy" else kurtosis == pytest.approx(tails, rel=0.1)
    local = x.reshape(100, -1).std(axis=1)
    assert local.max() / local.min() == pytest.approx(swing, rel=0.35)
    white = whiten(kind, x, 0.01)[1:]
    assert np.std(white) == pytest.approx(1, rel=0.03)
    assert abs(np.mean(white[1:] * white[:-1])) < 0.01


@pytest.mark.slow
def test_case_reaches_its_level() -> None:
    label = make_case("foh", "electrostriction", "steps", 2.0, seed=3).label
    assert label["level"] == pytest.approx(2.0, rel=0.03)
    null = make_case("foh", "none", "steps", seed=3).label
    assert null["level"] < 0.01
