"""The laws against closed forms, brute force, other solvers and halved steps."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ..drives import Array
from ..truth import play
from . import stage as stage_module
from .design import design
from .laws import LAWS, drawn, duhem, jiles_atherton, lugre, opening, preisach, recursion
from .laws.law import FURTHEST, Params
from .laws.memory import along
from .laws.prandtl_ishlinskii import generalised_play
from .laws.ramberg_osgood import RAMBERG_OSGOOD
from .signals import SHAPES, make_drive, others
from .stage import HISTORIES, Stage, history

START = np.array([-1.0, -0.9])
REMEMBER = ("preisach_random", "preisach_hills", "ramberg_osgood", "prandtl_ishlinskii")


def zigzag(corners: list[float], spacing: float = 0.005) -> tuple[Array, list[int]]:
    """A path through the corners, and the corners' places in it."""
    legs = [np.linspace(a, b, 2 + round(abs(b - a) / spacing))[1:] for a, b in pairwise(corners)]
    path = np.concatenate([np.array(corners[:1]), *legs])
    return path, np.cumsum([0, *map(len, legs)]).tolist()


def numbers(name: str, seed: int = 3) -> Params:
    return drawn(LAWS[name], np.random.default_rng(seed))[0]


def test_play_loop() -> None:
    """A play of radius r on an amplitude A encloses 4 r (A - r)."""
    x, r = 0.8 * np.sin(np.linspace(0, 6 * np.pi, 30001)), 0.3
    p = generalised_play(x, x, r, x)
    assert np.allclose(p, play(x, r), rtol=0, atol=1e-12)
    once = slice(20000, 30001)
    assert abs(np.trapezoid(p[once], x[once])) == pytest.approx(4 * r * (0.8 - r), rel=1e-6)


def test_recursions() -> None:
    """Blocks against one step after the other; a play whose limits rest is a play."""
    rng = np.random.default_rng(0)
    keep, enter = rng.uniform(0.5, 1, (2, 1001)), rng.standard_normal((2, 1001))
    z, p, linear, clamped = np.array([1.0, -2.0]), np.zeros(2), [], []
    for k in range(1001):
        z = keep[:, k] * z + enter[:, k]
        p = np.maximum(enter[:, k], np.minimum(enter[:, k] + keep[:, k], p))
        linear.append(z)
        clamped.append(p)
    got = recursion.linear(keep, enter, np.array([1.0, -2.0]))
    assert np.allclose(got, np.array(linear).T, rtol=0, atol=1e-12)
    got = recursion.clamped(enter, enter + keep, np.zeros(2))
    assert np.allclose(got, np.array(clamped).T, rtol=0, atol=1e-12)
    x = 0.8 * np.sin(np.linspace(0, 6 * np.pi, 3001))
    got = recursion.clamped(x[None] - 0.3, x[None] + 0.3, x[:1])[0]
    assert np.allclose(got, play(x, 0.3), rtol=0, atol=1e-12)


def test_everett_of_even_density() -> None:
    """Density 1: the triangle's area (a - b)²/2, also within one cell."""
    rng = np.random.default_rng(0)
    high, low = np.sort(rng.uniform(-FURTHEST, FURTHEST, (2, 500)), axis=0)[::-1]
    low[:100] = high[:100] - 0.1 * preisach.CELL * rng.uniform(size=100)
    got = preisach.Plane(np.ones((preisach.CELLS, preisach.CELLS))).everett(high, low)
    assert np.allclose(got, (high - low) ** 2 / 2, rtol=0, atol=1e-12)


def test_plane_against_relays() -> None:
    """Relays switched one by one at every corner of the path give the plane's output."""
    density = preisach.random_density(numbers("preisach_random"))
    corners = [-FURTHEST, 0.9, -0.5, 0.6, -0.2, 0.75, -0.8, 0.3]
    path, at = zigzag(corners)
    got = along(path, preisach.Plane(density).everett)[at]
    fine = (np.arange(640) + 0.5) / 640 * 2 * FURTHEST - FURTHEST
    weight = np.repeat(np.repeat(density, 10, axis=0), 10, axis=1) * (fine[1] - fine[0]) ** 2
    weight = np.tril(weight, -1) + np.diag(np.diag(weight)) / 2
    up = np.zeros((640, 640), bool)
    want = []
    for x in corners:
        up = (up | (fine[:, None] < x)) & (fine[None, :] < x)
        want.append(float(weight[up].sum()))
    assert np.allclose(got, want, rtol=0, atol=0.004 * max(want))


@pytest.mark.parametrize("name", REMEMBER)
def test_return_points_wiping_out_and_congruency(name: str) -> None:
    law, params = LAWS[name], numbers(name)

    def at(corners: list[float]) -> Array:
        path, places = zigzag(corners)
        return law.response(path, 1.0, params, START)[places]

    stroke = opening(law, params)[1]
    inner = at([-0.9, 0.8, -0.3, 0.4, -0.3, 0.4, -0.3])
    assert inner[2::2] == pytest.approx(inner[2], abs=1e-9 * stroke)
    looped, plain = at([-0.9, 0.2, -0.4, 0.1, -0.4, 0.7, 0.0]), at([-0.9, 0.7, 0.0])
    assert looped[-2:] == pytest.approx(plain[-2:], abs=1e-9 * stroke)
    early, late = at([-0.9, 0.3, 0.0, 0.3]), at([-0.9, 0.9, 0.0, 0.3, 0.0])
    if name != "prandtl_ishlinskii":  # its plays start in their middles, which a loop must leave
        assert early[1] - early[2] == pytest.approx(late[3] - late[4], abs=1e-9 * stroke)
        assert abs(early[2] - late[2]) > 0.003 * stroke


def test_ramberg_osgood_branch() -> None:
    """With power 2 and no bend a falling branch from 1 is f - 2 (s + k s²), s = (1 - x)/2."""
    params = {"bend": 0.0, "kink": 0.0, "stiffening": 0.4, "power": 2.0}
    path, at = zigzag([-0.9, 1.0, -0.2])
    y = RAMBERG_OSGOOD.response(path, 1.0, params, START)
    s = (1 - path[at[1] :]) / 2
    assert np.allclose(y[at[1] :], y[at[1]] - 2 * (s + 0.4 * s**2), rtol=0, atol=1e-12)


def test_jiles_atherton_against_adaptive_solver() -> None:
    params = numbers("jiles_atherton")
    field = np.linspace(-1.0, 1.2, 500)
    got = jiles_atherton.polarisation(field, params)
    a, pinning, mean_field = (params[k] for k in ("a", "pinning", "mean_field"))

    def slope(e: float, p: Array) -> list[float]:
        gap = jiles_atherton.langevin((e + mean_field * p[0]) / a) - p[0]
        return [max(gap, 0.0) / (pinning - mean_field * gap)]

    start = [jiles_atherton.langevin(-1.0 / a)]
    want = solve_ivp(slope, (-1.0, 1.2), start, "LSODA", field, rtol=1e-9, atol=1e-11)
    assert np.max(np.abs(got - want.y[0])) < 5e-6
    path = np.concatenate([field, field[::-1] * 0.7, field])
    half = jiles_atherton.polarisation(path, params, jiles_atherton.STEP / 2)
    assert np.max(np.abs(half - jiles_atherton.polarisation(path, params))) < 1e-5


def test_lugre_bristle() -> None:
    """One straight leg: z = l (1 - exp(-x/l)); slow legs hold on longer by 1 + stick."""
    x = np.linspace(0, 1, 400)
    z = np.append(0.0, lugre.bristles(np.diff(x), np.full((1, 399), 0.2), np.zeros(1))[0])
    assert np.allclose(z, 0.2 * -np.expm1(-x / 0.2), rtol=0, atol=1e-12)
    params = {"bend": 0.0, "force": 0.1, "longest": 0.2, "ratio": 0.3, "fading": 0.0,
              "stick": 0.4, "stribeck": 1.0}  # fmt: skip
    rest = np.zeros(2)
    slow, fast = (x - lugre.response(x, h, params, rest) for h in (1.0, 1e-6))
    assert fast[-1] == pytest.approx(0.1 * -np.expm1(-1 / 0.2), rel=1e-9)
    assert slow[-1] == pytest.approx(0.1 * 1.4 * -np.expm1(-1 / 0.28), rel=1e-4)


def test_duhem_against_adaptive_solver() -> None:
    x = np.linspace(-0.5, 0.9, 3000)
    goal = np.tanh(1.2 * (x - 0.1)) + 0.2 * x
    got = duhem.along(x, goal, 3.0, 0.25)

    def slope(x: float, w: Array) -> Array:
        return 3.0 * (np.tanh(1.2 * (x - 0.1)) + 0.2 * x - w) + 0.25

    want = solve_ivp(slope, (-0.5, 0.9), goal[:1], "LSODA", x, rtol=1e-10, atol=1e-12)
    assert np.max(np.abs(got - want.y[0])) < 1e-7


@pytest.mark.parametrize("name", list(LAWS))
@pytest.mark.parametrize("drive", ["two_sines", "staircase"])
def test_halving(name: str, drive: str) -> None:
    """Halving the step changes the record by under a sixth of the least noise (.02 % of stroke)."""
    law = LAWS[name]
    params, swing = drawn(law, np.random.default_rng(1))
    made = make_drive(drive, 4, 1000.0, 2000, (5.0, 95.0))
    x0 = float(made(np.zeros(1))[0]) / 50 - 1
    whole = Stage(law, params, 1 / swing, (0.0, 100.0), made, history("cycled", x0))
    half = Stage(law, params, 1 / swing, (0.0, 100.0), made, history("cycled", x0), 16)
    change = whole.recorded([]) - half.recorded([])
    assert np.sqrt(np.mean(change**2)) < 3.3e-5


@pytest.mark.parametrize("name", list(LAWS))
def test_openings(name: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        params, _ = drawn(LAWS[name], rng)
        assert 0.03 <= opening(LAWS[name], params)[0] <= 0.2


def test_still_laws_have_no_rate() -> None:
    path = zigzag([-0.9, 0.8, -0.5, 0.3])[0]
    for name, law in LAWS.items():
        params = {**numbers(name), **law.still}
        slow, fast = (law.response(path, h, params, START) for h in (1.0, 1e-5))
        assert np.allclose(slow, fast, rtol=0, atol=1e-12), name
        if law.still:
            slow, fast = (law.response(path, h, numbers(name), START) for h in (1.0, 1e-5))
            assert np.max(np.abs(slow - fast)) > 1e-3, name


@pytest.mark.parametrize("name", list(SHAPES))
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_drives(name: str, seed: int) -> None:
    """Length, range, repetition and where held-out drives start."""
    rate = (200.0, 1000.0, 5000.0)[seed]
    drive = make_drive(name, seed, rate, 2000, (-20.0, 80.0))
    u = drive(drive.times)
    assert 0.95 * 2000 <= len(u) <= 1.25 * 2000
    assert u.min() >= -20 - 1e-9
    assert u.max() <= 80 + 1e-9
    assert np.ptp(u) > 50
    for low, high in drive.rests:
        still = drive(np.linspace(low, high, 9)[:-1])
        assert np.ptp(still) < 1e-9
    if drive.period:
        later = drive(drive.times + drive.period)[: round(len(u) / 2) - 1]
        assert np.allclose(later, u[: len(later)], rtol=0, atol=1e-6)
    for other in others(name):
        again = make_drive(other, seed + 1, rate, 2000, (-20.0, 80.0))
        assert again(np.zeros(1))[0] == pytest.approx(u[0], abs=1e-9)


@pytest.mark.parametrize("kind", HISTORIES)
def test_histories_end_where_the_record_begins(kind: str) -> None:
    path = history(kind, 0.35)
    assert path[-1] == pytest.approx(0.35)
    assert np.max(np.abs(np.diff(path))) < 0.021


def test_grid_holds_every_sample() -> None:
    made = make_drive("sine", 1, 500.0, 2000, (0.0, 80.0))
    law = LAWS["duhem"]
    one = Stage(law, numbers("duhem"), 1.0, (0.0, 100.0), made, history("fresh", -0.2))
    assert np.allclose(one.t[:: stage_module.OVER], made.times, rtol=0, atol=1e-12)
    assert len(one.coarse().recorded([])) == len(made.times)
    assert {s.law for s in design(1)} == set(LAWS)
