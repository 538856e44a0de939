"""Laws, path states and the oracle; a case, its seal and its files."""

import hashlib
import json
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ..actuator import rms
from ..drives import Array
from ..inexact.laws.law import FURTHEST, Params
from ..inexact.noises import Noise
from ..inexact.signals import make_drive
from ..inexact.stage import Stage, history
from ..inexact.test_laws import START, zigzag
from .case import build, together
from .design import EACH, Spec, design
from .drives import DRIVES, others
from .effects import FAMILIES, TRIED
from .exam import SEED_HASH, build_half, seed_of
from .grade import grade_all
from .laws import DEGRADING, FADING, HAS, LAWS, MEMORY, RETURNING, drawn, maxwell_slip
from .laws import krasnoselskii_pokrovskii as kp
from .oracle import JOINED, SMOOTH, LawFree, hats, nodes_of, path_columns, weights
from .paths import states
from .rivals import Rivals, look_alikes
from .session import Session, draw_session

SPEC = Spec(
    7, "development", "preisach_hills", None, "two", "protocol", "triangles", 150.0, 4000, 3
)


SEEDS = {"falling_sine": 5}  # one that does not grow again


def numbers(name: str, seed: int = 3) -> Params:
    return drawn(LAWS[name], np.random.default_rng(seed), 0.02, 0.3)[0]


def at(name: str, corners: list[float], params: Params | None = None) -> Array:
    path, places = zigzag(corners)
    return LAWS[name].response(path, 1.0, params or numbers(name), START)[places]


def stage_on(drive: str, name: str = "preisach_hills", over: int = 8, seed: int = 4) -> Stage:
    made = make_drive(drive, seed, 250.0, 4000, (5.0, 95.0), DRIVES)
    x0 = float(made(np.zeros(1))[0]) / 50 - 1
    params, swing = drawn(LAWS[name], np.random.default_rng(1), 0.02, 0.3)
    before = history("cycled", x0)
    return Stage(LAWS[name], params, 10 / swing, (0.0, 100.0), made, before, over)


def session_on(drive: str, name: str = "preisach_hills", seed: int = 4) -> Session:
    return Session(
        (stage_on(drive, name, seed=seed),), Noise("white", 0.01, 0.0), 0.0, MEMORY[name]
    )


@pytest.mark.parametrize("name", list(RETURNING))
def test_return_points(name: str) -> None:
    """Minor loops close, and are wiped out by what goes beyond them."""
    inner = at(name, [-0.9, 0.8, -0.3, 0.4, -0.3, 0.4, -0.3])
    assert inner[2::2] == pytest.approx(inner[2], abs=1e-9)
    looped, plain = at(name, [-0.9, 0.2, -0.4, 0.1, -0.4, 0.7, 0.0]), at(name, [-0.9, 0.7, 0.0])
    assert looped[-2:] == pytest.approx(plain[-2:], abs=1e-9)


def test_other_memories_have_no_return_points() -> None:
    for name in FADING | DEGRADING:
        y = at(name, [-0.9, 0.8, *[-0.3, 0.4] * 6])
        assert abs(y[2] - y[-2]) > 1e-5, name


def test_nonlinear_preisach_is_not_congruent() -> None:
    y = at("nonlinear_preisach", [-0.9, 0.3, 0.0, 0.3, 0.9, 0.0, 0.3, 0.0])
    assert abs((y[1] - y[2]) - (y[6] - y[7])) > 1e-4


def test_kernel_of_krasnoselskii_and_pokrovskii(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two thresholds: sample by sample, the three kernels by their rule."""
    params = numbers("krasnoselskii_pokrovskii") | {"slope": 0.0, "bend": 0.0, "share": 1.0}
    monkeypatch.setattr(kp, "GRID", 2)
    path, _ = zigzag([-1.0, 0.9, -1.1, 1.3, -0.6, 0.2])
    got = kp.response(path, params)

    def ramp(z: float) -> float:
        return min(max(2 * z / params["width"] - 1, -1), 1)

    kernels = []
    for down, up in ((-1.2, -1.2), (-1.2, 1.0), (1.0, 1.0)):
        k = 0.5 * (ramp(path[0] - up) + ramp(path[0] - down))
        k_all = [k]
        for before, x in pairwise(path.tolist()):
            k = max(k, ramp(x - up)) if x > before else min(k, ramp(x - down))
            k_all.append(k)
        kernels.append(k_all)
    k = np.array(kernels)
    mix, *_ = np.linalg.lstsq(k.T, got, rcond=None)
    assert np.allclose(mix @ k, got, rtol=0, atol=1e-9)
    assert mix.sum() == pytest.approx(1.0)
    assert mix.min() > 0


def test_maxwell_slip_against_its_springs() -> None:
    """Springs moved with the response give back the drive."""
    params = numbers("maxwell_slip") | {"bend": 0.0}
    path, _ = zigzag([-FURTHEST, 0.9, -0.7, 0.5, -0.2, 0.6, -0.9], 0.002)
    y = maxwell_slip.response(path, params)
    stiff, reach = maxwell_slip.springs(params)
    stretch, force = -reach, []
    for step in np.diff(y):
        stretch = np.clip(stretch + step, -reach, reach)
        force.append(float(stiff @ stretch))
    drive = y[1:] + np.array(force)
    assert np.ptp(drive - path[1:]) < 1e-9


def test_bouc_wen_against_adaptive_solver() -> None:
    params = numbers("bouc_wen")
    x = np.linspace(-0.5, 0.9, 400)
    got = LAWS["bouc_wen"].response(x, 1.0, params, np.full(2, -0.5))
    h = (x + params["bend"] * x**2 + params["kink"] * x**3 - got) / params["share"]

    def slope(_: float, h: Array) -> Array:
        size, n, sigma = np.abs(h), params["n"], params["sigma"]
        return params["rho"] * (1 - sigma * size ** (n - 1) * h + (sigma - 1) * size**n)

    want = solve_ivp(slope, (-0.5, 0.9), [0.0], "LSODA", x, rtol=1e-10, atol=1e-12).y[0]
    assert np.max(np.abs(h - want)) < 1e-6


@pytest.mark.parametrize("name", list(DEGRADING))
def test_degradation_follows_the_path(name: str) -> None:
    """None while the drive rests; of the rate there is none; without wear the loops repeat."""
    params, law = numbers(name), LAWS[name]
    corners = [-0.9, 0.8, *[-0.8, 0.8] * 5]
    y = at(name, corners, params)
    loops = y[3::2] - y[2::2][: len(y[3::2])]
    assert np.all(np.abs(np.diff(loops)) > 1e-6)
    still = at(name, corners, {**params, "worn": 0.0})
    assert still[-2:] == pytest.approx(still[-4:-2], abs=1e-5)
    path, _ = zigzag(corners)
    held = np.concatenate([path, np.full(500, path[-1])])
    held_y = law.response(held, 1.0, params, START)
    assert np.ptp(held_y[len(path) - 1 :]) == 0
    assert np.array_equal(held_y, law.response(held, 1e-4, params, START))


@pytest.mark.parametrize("name", list(LAWS))
def test_halving_the_step_of_laws(name: str) -> None:
    """Halving the step changes a record by under a sixth of the least noise (.02 % of the stroke),
    on corners between samples too."""
    for drive in ("protocol", "steps"):
        whole, half = (stage_on(drive, name, over).recorded([]) for over in (8, 16))
        assert rms(whole - half) < 3.3e-5 * np.ptp(whole)


@pytest.mark.parametrize("key", list(TRIED))
def test_halving_the_step_of_effects(key: str) -> None:
    """By under a sixth of the least noise, at typical amplitudes; without amplitude nothing."""
    e = TRIED[key]
    shape = e.shape(np.random.default_rng(0))
    params = e.parameters(e.typical, shape, stage_on("protocol").scene)
    whole, half = (stage_on("protocol", over=over).recorded([(e, params)]) for over in (8, 16))
    assert rms(whole - half) < 3.3e-5 * np.ptp(whole)
    assert rms(whole - stage_on("protocol").recorded([])) > 1e-4 * np.ptp(whole)


@pytest.mark.parametrize("name", list(DRIVES))
def test_drives(name: str) -> None:
    for seed in (0, 1, 2):
        drive = make_drive(name, seed, 200.0, 4000, (-20.0, 80.0), DRIVES)
        u = drive(drive.times)
        assert 0.9 * 4000 <= len(u) <= 1.1 * 4000
        assert u.min() >= -20 - 1e-9
        assert u.max() <= 80 + 1e-9
        assert np.ptp(u) > 50
        again = make_drive(name, seed, 200.0, 4000, (-20.0, 80.0), DRIVES)
        assert np.array_equal(u, again(again.times))
    for other in others(name):
        beside = make_drive(other, 9, 200.0, 3000, (-20.0, 80.0), DRIVES)
        assert float(beside(np.zeros(1))[0]) == pytest.approx(float(u[0]))


def test_protocol_meets_its_turning_points_at_rates_eightfold_apart() -> None:
    drive = make_drive("protocol", 5, 200.0, 8000, (-1.0, 1.0), DRIVES)
    u = drive(np.arange(8 * 8000) / 1600)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(u))) != 0)
    peaks = [k for k in turns if u[k] > 0.999]
    assert len(peaks) >= 2
    speed = np.abs(np.diff(u[::8])) * 200
    moving = speed[(speed > 1e-6) & (np.abs(u[:-8:8]) > 0.3)]
    assert np.percentile(moving, 97) / np.percentile(moving, 30) > 6
    assert drive.rests[0][0] == 0
    assert max(b - a for a, b in drive.rests) / min(b - a for a, b in drive.rests) > 30


def test_path_states_of_a_repeated_triangle() -> None:
    """Up, and then the same two branches over and over; an inner loop has two of its own."""
    once = np.concatenate([np.linspace(1, -1, 101)[1:], np.linspace(-1, 1, 101)[1:]])
    u = np.concatenate([np.linspace(0, 1, 51), once, once])
    met = states([u])
    sizes = sorted(len(np.concatenate(v)) for v in met.branches.values())
    assert sum(sizes) == len(u)
    assert [k for k in met.branches if k == (-1.0, -1.0, 1.0)]
    twice = np.concatenate(met.branches[(1.0, 1.0, -1.0)])
    assert np.allclose(np.sort(u[twice])[::2], np.sort(u[twice])[1::2])
    looped = np.concatenate([u, np.linspace(1, 0.2, 41)[1:], np.linspace(0.2, 0.6, 21)[1:],
                             np.linspace(0.6, -1, 81)[1:]])  # fmt: skip
    inside = states([looped]).branches
    assert len(np.concatenate(inside[(1.0, -1.0, 1.0, 0.2)])) == 20
    below = np.concatenate(inside[(-1.0, -1.0, 1.0)])
    assert looped[below].min() == pytest.approx(-1)


def test_path_states_are_shared_between_recordings() -> None:
    leg = np.linspace(-1, 1, 101)
    u = np.concatenate([leg, leg[-2::-1], leg[1:]])
    met = states([u, u])
    assert len(np.concatenate(met.branches[(-1.0, -1.0, 1.0)])) == 200
    assert len(np.concatenate(met.branches[(1.0, 1.0, -1.0)])) == 200


def test_hats() -> None:
    nodes = nodes_of(0.5)
    x = np.array([0.0, 0.001, 0.123, 0.5])
    k, part = hats(x, nodes)
    assert np.allclose((1 - part) * nodes[k] + part * nodes[k + 1], x)


@pytest.mark.parametrize("name", list(RETURNING))
def test_every_law_with_return_points_is_a_function_of_the_path_state(name: str) -> None:
    for drive in ("protocol", "random_walk"):
        session = session_on(drive, name)
        residual = session.law_free.off(session.plain[:, None])
        assert rms(residual) < 0.3  # noise floors of .1 % of the stroke


def test_oracle_of_what_a_drive_shows() -> None:
    """Drift and creep on the protocol, not on amplitudes that are met once; a lag on both."""

    def detectability(drive: str, key: str) -> float:
        session, e = session_on(drive, seed=SEEDS.get(drive, 4)), TRIED[key]
        params = e.parameters(e.typical, e.shape(np.random.default_rng(2)), session.first.scene)
        change = session.recorded([(e, params)]) - session.plain
        return float(np.linalg.norm(session.law_free.off(change[:, None])))

    for key in ("creep", "thermal_drift"):
        assert detectability("protocol", key) > 30
        assert detectability("falling_sine", key) < 5
    assert detectability("protocol", "sensor_lag") > 30


def test_oracle_against_dense_least_squares() -> None:
    """Coloured noise, columns of memory with their prior: all in one dense least-squares fit."""
    u = np.concatenate([np.linspace(0, 1, 200), np.linspace(1, -1, 300), np.linspace(-1, 1, 300)])
    noise, n = Noise("ar", 0.02, 0.7), len(u)
    dense = 0.05 * np.random.default_rng(0).standard_normal((n, 2))
    d = 0.1 * np.sin(np.linspace(0, 20, n)) + 0.05 * dense[:, 0]
    w = weights(u, 1.0, noise.total)
    white = LawFree([u], 1, noise, 1.0, None).whiten(np.eye(n))
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    inverse = np.linalg.inv(noise.sd**2 * noise.order**lag)
    plain = white / w[:, None]  # its first sample is weighed as the others are
    assert np.allclose((plain.T @ plain)[1:, 1:], inverse[1:, 1:], atol=1e-6)
    columns, joints, curved = (x.toarray() for x in path_columns(u, states([u])))
    many = columns.shape[1]
    paths = np.vstack([white @ columns, JOINED * joints, SMOOTH * curved, np.zeros((2, many))])
    memory = np.zeros((len(paths), 2))
    memory[:n], memory[-2:] = white @ dense, np.eye(2)
    wanted = np.append(white @ d, np.zeros(len(paths) - n))
    for beside, free in ((memory[:, :0], None), (memory, dense)):
        fit = np.column_stack([paths, beside])
        misfit = wanted - fit @ np.linalg.lstsq(fit, wanted, rcond=None)[0]
        residual = LawFree([u], 1, noise, 1.0, free).off(d[:, None])
        assert np.sum(residual**2) == pytest.approx(np.sum(misfit**2), rel=1e-3)


def test_weights_fall_only_where_the_drive_is_not_known() -> None:
    w = weights(np.array([0.0, 0, 0, 0, 1, 1, 1, 1]), 1.0, 0.01)
    assert w[0] == w[-1] == 1
    assert w[3:5].max() < 0.1
    assert weights(np.sin(np.linspace(0, 6, 2000)), 1.0, 0.001).min() > 0.99


def test_design_is_balanced() -> None:
    for half, each in EACH.items():
        specs = design(half, 1)
        assert specs == design(half, 1)
        assert [s.number for s in specs] == list(range(1, len(specs) + 1))
        assert set(Counter(s.law for s in specs).values()) == {each}
        assert Counter(s.content for s in specs) == {
            "none": len(specs) // 4, "one": len(specs) // 2, "two": len(specs) // 4
        }  # fmt: skip
        assert sum(s.believed is None for s in specs) == len(specs) // 2
        assert all(s.law not in HAS.get(s.believed or "", ()) for s in specs)
        assert 0.25 < np.mean([s.drive == "protocol" for s in specs]) < 0.35
        assert all(22 <= s.samples / s.rate <= 61 for s in specs if s.drive == "protocol")
    assert len(design("sealed", 1)) >= 150


@pytest.fixture(scope="module")
def case() -> tuple[list[Array], dict]:
    return build(SPEC)


def test_case_is_what_its_label_says(case: tuple[list[Array], dict]) -> None:
    recordings, label = case
    session, _ = draw_session(SPEC)
    assert [len(r) for r in recordings] == [len(s.drive.times) for s in session.stages]
    assert label["files"] == ["recording.csv", "second.csv"]
    pairs = [(TRIED[e["key"]], e["parameters"]) for e in label["effects"]]
    clean = session.recorded(pairs)
    noise = np.concatenate([r[:, 2] for r in recordings]) - clean
    assert rms(noise) == pytest.approx(label["noise"]["sensor_um"], rel=0.1)
    first, second = label["effects"]
    assert first["family"] != second["family"]
    for e, other in ((first, pairs[1]), (second, pairs[0])):
        change = clean - session.recorded([other])
        assert np.ptp(change) == pytest.approx(e["size_um"])
        assert rms(change) == pytest.approx(e["raw_level"] * label["noise"]["total_um"])
        assert e["detectability"] <= e["alone"] + 1e-9
        assert e["accepted"][0] == e["name"]


def test_separation_and_pairs() -> None:
    """A drift is not cases from itself drawn anew; beside itself nothing is left of an effect."""
    session = session_on("protocol")
    rivals, e = Rivals(session, 1), TRIED["thermal_drift"]
    params = e.parameters(0.02, {"tau": 0.4, "slope": 0.1}, session.first.scene)
    change = session.recorded([(e, params)]) - session.plain
    power = float(np.sum(session.law_free.off(change[:, None]) ** 2))
    apart = rivals.apart(change, "", session.law_free, None)
    assert apart["thermal_drift"] < 0.02 * power
    assert apart["mains_interference"] > 0.9 * power
    assert "degradation" in rivals.apart(change, "thermal_drift", session.law_free, None)
    gone = rivals.apart(change, "thermal_drift", session.law_free, change)
    assert max(gone.values()) < 1e-6 * power
    assert look_alikes({"a": 10.0, "b": 30.0, "c": 24.0}, 30.0) == ["a"]
    assert look_alikes({"a": 0.0}, 20.0) == []
    assert together(session, []) == []


def test_folders_and_seals(tmp_path: Path) -> None:
    """Recordings, what is cases and the seal in one place, labels in another; the sealed seed."""
    out, hidden = tmp_path / "exam", tmp_path / "labels"
    build_half("development", out, hidden, 5, slice(0, 2), 1)
    labels = json.loads((hidden / "labels.json").read_text())
    cases = json.loads((out / "cases.json").read_text())
    assert not (out / "labels.json").exists()
    assert [x["case"] for x in labels] == [x["case"] for x in cases] == ["001", "002"]
    assert set(cases[0]) == {"case", "files", "believed", "samples", "noise_um"}
    for x in cases:
        assert all((out / x["case"] / file).exists() for file in x["files"])
    assert (out / "labels.sha256").read_text() == (hidden / "labels.sha256").read_text()
    grade_all(hidden, tmp_path / "nothing", tmp_path / "marks", slice(None))
    assert "no answer,0,1.0000" in (tmp_path / "marks" / "grade.csv").read_text()
    with pytest.raises(SystemExit, match="needs its seed"):
        seed_of("sealed", None)
    with pytest.raises(SystemExit, match="has not the hash"):
        seed_of("sealed", 1)
    assert len(SEED_HASH.read_text().split()[0]) == len(hashlib.sha256(b"").hexdigest())


def test_families_hold_every_effect() -> None:
    assert sorted(k for keys in FAMILIES.values() for k in keys) == sorted(TRIED)
    assert replace(SPEC, number=8).law in LAWS
