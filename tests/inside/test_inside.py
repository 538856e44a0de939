"""Which physics is inside a machine: recordings of another integrator, posterior, columns."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import fracjax as fj
from fracjax._blocks import (
    INSIDE,
    CubicStiffness,
    DryFriction,
    LuGre,
    Mass,
    Modes,
    Oscillator,
    Within,
)
from fracjax._computing import computing
from fracjax._inside import (
    About,
    Candidate,
    Columns,
    Inside,
    Worth,
    _columns,
    _inquire,
    columns_of,
    error_on,
    inquire_inside,
)
from fracjax._inside._columns import Column
from fracjax._inside._inquire import _Inquiry
from fracjax._prepare import prepare
from fracjax._solve import solve_from

W, ZETA, STEP, SAMPLES = 2 * np.pi * 4.0, 0.05, 0.02, 700
FORCES = {
    "": lambda x, v: 0.0,
    "cubic_stiffness": lambda x, v: -0.8 * x**3,
    "dry_friction": lambda x, v: -0.35 * np.tanh(v / 0.02),
    "cubic_stiffness + quadratic_damping": lambda x, v: -0.8 * x**3 - 0.008 * v * abs(v),
}


def recorded(law: str, level: float, seed: int) -> fj.Recording:
    """A multisine of many lines on an oscillator with a force inside, with noise of .1 %."""
    rng = np.random.default_rng(seed)
    lines, phases = np.arange(2, 88), rng.uniform(0, 2 * np.pi, 86)
    rates = 2 * np.pi * lines / (SAMPLES * STEP)

    def drive(t):
        return level * np.sqrt(2 / lines.size) * np.sum(np.cos(np.outer(t, rates) + phases), axis=1)

    fine = drive(np.arange(8 * SAMPLES + 1) * STEP / 8)

    def rate(t, state):
        x, v = state
        u = np.interp(t, np.arange(fine.size) * STEP / 8, fine)
        return [v, W**2 * (u - x + FORCES[law](x, v)) - 2 * ZETA * W * v]

    times = np.arange(SAMPLES) * STEP
    x = solve_ivp(rate, (0, times[-1]), [0, 0], "LSODA", times, rtol=1e-7, atol=1e-9).y[0]
    noise = 1e-3 * np.ptp(x) * rng.standard_normal(x.size)
    return fj.Recording(drive(times), x + noise, STEP, "V", "um", source=law or "linear")


@pytest.fixture
def few(monkeypatch):
    """A catalogue of two effects: compiling the others takes most of the time."""
    choose(monkeypatch, "cubic_stiffness", "quadratic_stiffness")


def choose(monkeypatch, *names):
    chosen = {name: INSIDE[name] for name in names}
    monkeypatch.setattr(_inquire, "INSIDE", chosen)
    monkeypatch.setattr(_columns, "INSIDE", chosen)


def asked(law: str):
    training, test = recorded(law, 1.0, 1), recorded(law, 1.3, 2)
    # Friction sticks within a small part of a sample, which a coarser grid does not resolve.
    grid = 16 if law == "dry_friction" else 4
    preparation = replace(prepare([training], history="rest", settling=0), oversampling=grid)
    return inquire_inside(
        Oscillator(1.0, 3.5, 0.1), preparation, lambda fit: error_on(fit, test, "rest", 0)[0]
    ), test


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "alike"),
    [
        ("dry_friction", ["hysteretic_spring"]),
        ("cubic_stiffness + quadratic_damping", ["quadratic_stiffness", "hysteretic_spring"]),
    ],
)
def test_effects_are_named_and_no_others(law, alike, monkeypatch):
    """Of those of the law and what could pass for them."""
    choose(monkeypatch, *law.split(" + "), *alike)
    inside, test = asked(law)
    assert {*inside.names} == {*law.split(" + ")}
    assert inside.base_error is not None
    assert inside.extended_error is not None
    assert inside.base_error > 4 * inside.extended_error
    assert inside.extended_error < 8e-3 * np.ptp(test.response)
    parameters = fj.Model(inside.block).parameters
    assert float(parameters["oscillator.frequency"].value) == pytest.approx(4.0, rel=0.02)
    if law != "dry_friction":
        assert float(parameters["cubic_stiffness.stiffness"].value) == pytest.approx(0.8, rel=0.05)
    else:
        assert float(parameters["dry_friction.coulomb"].value) == pytest.approx(0.35, rel=0.1)


def test_a_linear_machine_is_left_as_it_is(few):
    inside, _ = asked("")
    assert inside.names == ()
    assert inside.outside == ""
    assert inside.extended is inside.base
    assert inside.base_error == inside.extended_error


def test_a_column_is_the_derivative_by_the_effect():
    preparation = replace(
        prepare([recorded("cubic_stiffness", 0.5, 3)], history="rest", settling=0), oversampling=2
    )
    with computing():
        solved = solve_from([Within(Oscillator(1.0, 3.5, 0.1))], preparation)
        columns = columns_of(solved)
        (column,) = columns.effects["cubic_stiffness"]
        ((_, effect),) = column.inside
        size, (problem,) = float(effect.stiffness.value), preparation.problems()
        machine: Any = solved.block
        ends = [
            problem.linearised(machine @ CubicStiffness(factor * size), ())[0]
            for factor in (1e-4, -1e-4)
        ]
        wanted = problem.whiten((ends[0] - ends[1]) / 2e-4)
        np.testing.assert_allclose(column.white[:, 0], wanted, atol=1e-4 * np.abs(wanted).max())
        assert set(columns.others) == {"linear_dynamics", "drive_curve", "response_curve"}
        for shapes in (columns.effects | columns.others).values():
            assert all(shape.white.shape[0] == columns.residual.size for shape in shapes)


@pytest.mark.parametrize(
    ("machine", "free"),
    [
        (Within(Mass(of_velocity=True)), False),
        (Mass(of_velocity=True) @ DryFriction(), True),
        (Within(Mass()), True),
        (Oscillator() @ DryFriction(), False),
        (Oscillator() @ CubicStiffness(), True),
    ],
    ids=["velocity", "friction of a velocity", "position", "friction", "spring"],
)
def test_the_drives_offset_is_free_where_it_differs_from_one_of_the_response(machine, free):
    """A velocity that is moved by a constant drive is one that is measured with an offset, unless
    friction depends on it."""
    assert machine.drive_offset.fixed is not free


WAVES = {
    "wave": np.cos(0.1 * np.arange(1000)),
    "machine": np.cos(0.2 * np.arange(1000)),
    "effect": np.cos(0.3 * np.arange(1000)),
    "offset": np.ones(1000),
}


@dataclass
class Stepped:
    """Recordings of unit noise whose response is wrong by the square of the step along a wave."""

    oversampling: int
    size: float
    along: str = "wave"

    def problems(self):
        wave = WAVES[self.along]
        error = self.size * wave / self.oversampling**2
        return [SimpleNamespace(whiten=lambda signal: signal, respond=lambda block: error)]


@pytest.mark.parametrize(
    ("preparation", "coarse"),
    [
        (Stepped(1, 1.0), True),
        (Stepped(8, 1.0), False),
        (Stepped(1, 1.0, along="machine"), False),
        (Stepped(1, 1.0, along="effect"), True),
        (Stepped(64, 1e6), False),
    ],
    ids=["long", "short", "absorbed by the machine", "absorbed by an effect", "finest"],
)
def test_a_step_is_too_long_where_half_of_it_is_told_apart(preparation, coarse):
    solved = SimpleNamespace(
        block=SimpleNamespace(effects=("one",)), preparation=preparation, cost=1000.0,
        sensitivity=lambda: (
            [SimpleNamespace(name=n) for n in ("machine.gain", "effects.0.size")],
            None,
            np.stack([WAVES[of] for of in ("machine", "effect", "offset")], axis=1),
        ),
    )  # fmt: skip
    fit = SimpleNamespace(
        names=("one",), solved=solved,
        about=SimpleNamespace(samples=1000, evidence=lambda worth, effects: (0.0, 0.0)),
    )  # fmt: skip
    inquiry: Any = _Inquiry(True, lambda text: None, Columns({}, {}, *3 * [np.ones(1)]), [fit])  # type: ignore[list-item]
    assert inquiry.is_coarse() == coarse


def about(missing: float, seed: int = 5, count: int = 4000) -> About:
    """Ten effects of chance about a residual of unit noise with so much of the first, and a further
    column that is no effect."""
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((count, 13))
    residual = white[:, 0] + missing * white[:, 1]
    effects = {f"effect_{k}": [Column((), white[:, [1 + k]])] for k in range(10)}
    others = {"drive_curve": [Column((), white[:, [11]])]}
    tangent = white[:, [12]]
    residual = residual - tangent @ np.linalg.lstsq(tangent, residual, rcond=None)[0]
    return About.of(Columns(effects, others, residual, tangent, 10 * count**0.5), frozenset())


def test_what_a_residual_is_worth():
    """A known noise that is reached: 1/UNKNOWN samples at most; a misfit: some tens."""
    reached = Worth.of(9e5, 10**6, specified=True)
    assert reached.variance == 1.0
    assert reached.samples == pytest.approx(500, rel=1e-3)
    missed = Worth.of(1e8, 10**6, specified=True)
    assert missed.variance == 100.0
    assert 40 < missed.samples < 50
    unknown = Worth.of(1e8, 10**6, specified=False)
    assert unknown.samples < missed.samples
    # Few samples are worth themselves.
    assert Worth.of(10.0, 10, specified=True).samples == pytest.approx(10, rel=0.03)


def test_chance_is_not_named_and_an_effect_is():
    for seed in range(10):
        nothing = about(0.0, seed)
        worth = Worth.of(nothing.inner.square, nothing.samples, specified=True)
        assert nothing.posterior(worth).best.names == ()
        present = about(0.5, seed)
        square = present.inner.square / 1.25
        posterior = present.posterior(Worth.of(square, present.samples, specified=True))
        assert posterior.best.names == ("effect_0",)
        assert posterior.probability_of("effect_0") > 0.95


def test_what_the_fit_absorbs_is_no_evidence():
    rng = np.random.default_rng(8)
    tangent, own, residual = rng.standard_normal((3, 500))
    effects = {
        "absorbed": [Column((), tangent[:, None])],
        "half": [Column((), (tangent + own)[:, None])],
    }
    others = {"drive_curve": [Column((), rng.standard_normal((500, 1)))]}
    columns = Columns(effects, others, residual, tangent[:, None], 1.0)
    inner = About.of(columns, frozenset()).inner
    apart = own - tangent * (tangent @ own) / (tangent @ tangent)
    np.testing.assert_allclose(inner.columns[1], 0.0, atol=1e-9)
    assert inner.columns[2, 2] == pytest.approx(apart @ apart)
    assert inner.along[2] == pytest.approx(apart @ residual)


def test_coefficients_and_what_is_left():
    present = about(0.5)
    worth = Worth.of(present.inner.square / 1.25, present.samples, specified=True)
    best = present.posterior(worth).best
    ((coefficient,),) = present.coefficients(best, worth)
    assert coefficient == pytest.approx(0.5, abs=0.08)
    assert present.remainder(best, worth) == pytest.approx(present.samples, rel=0.05)


def test_a_freer_fit_of_the_same_residual_is_less_likely():
    one, more = about(0.0), about(0.0)
    more = replace(more, freedom=one.freedom + 1)
    worth = Worth.of(one.inner.square, one.samples, specified=True)
    gap = one.evidence(worth, 0)[0] - more.evidence(worth, 0)[0]
    assert gap == pytest.approx(0.5 * np.log1p(worth.samples))
    assert one.evidence(worth, 0)[0] - one.evidence(worth, 1)[0] == pytest.approx(np.log(50))
    assert one.evidence(worth, 0)[1] == 0.0
    assert one.outside(worth) == "drive_curve"


def test_a_curve_beside_the_machine_is_no_effect():
    """What a static curve explains as well is not named."""
    rng = np.random.default_rng(7)
    curve = rng.standard_normal(3000)
    residual = curve + 0.3 * rng.standard_normal(3000)
    effects = {"cubic_stiffness": [Column((), (curve + 0.5 * rng.standard_normal(3000))[:, None])]}
    others = {"response_curve": [Column((), curve[:, None])]}
    columns = Columns(effects, others, residual, np.ones((3000, 1)), 100.0)
    inside = About.of(columns, frozenset())
    worth = Worth.of(0.09 * 3000, 3000, specified=False)
    posterior = inside.posterior(worth)
    assert posterior.best.names == ()
    assert inside.evidence(worth, 0)[1] > 0
    assert inside.outside(worth) == "response_curve"
    # Without the curve it would be.
    alone = About.of(replace(columns, others={"response_curve": [Column((), 0 * curve[:, None])]}),
                     frozenset())  # fmt: skip
    assert alone.posterior(worth).best.names == ("cubic_stiffness",)


def beside(shapes, seed=2, count=400) -> About:
    """Columns of chance, one for each shape of an effect, about a residual of the second."""
    white = np.random.default_rng(seed).standard_normal((count, len(shapes) + 1))
    effects: dict[str, list[Column]] = {}
    for k, (name, effect, machine) in enumerate(shapes):
        column = Column((("joint", effect),), white[:, [k]], machine)
        effects.setdefault(name, []).append(column)
    others = {"drive_curve": [Column((), white[:, [-1]])]}
    columns = Columns(effects, others, white[:, 1], np.ones((count, 1)), count**0.5)
    return About.of(columns, frozenset())


WORTH = Worth(1.0, 400.0)


def test_each_form_of_an_effect_is_tried():
    shapes = [
        ("dry_friction", DryFriction(1.0), None),
        ("dry_friction", DryFriction(2.0), None),
        ("dry_friction", LuGre(3.0), None),
        ("cubic_stiffness", CubicStiffness(), None),
    ]
    about = beside(shapes)
    forms = _inquire._by_form(about, ("dry_friction",), WORTH)
    kept = [form.shapes[one.kinds[0]].inside[0][1] for form, one in forms]
    assert [(type(e), float(e.coulomb.value)) for e in kept] == [(DryFriction, 2.0), (LuGre, 3.0)]
    assert _inquire._by_form(about, ("cubic_stiffness",), WORTH) == []
    assert _inquire._by_form(about, ("cubic_stiffness", "dry_friction"), WORTH) == []


def test_look_alikes_are_those_of_either_entry():
    assert {"hysteretic_spring", "quadratic_damping"} <= {*_inquire._alike("dry_friction")}
    assert "dry_friction" in _inquire._alike("hysteretic_spring")
    assert "dry_friction" not in _inquire._alike("dry_friction")


def test_a_start_has_its_port_where_the_column_had_it():
    places = Within(Modes()).placements("joint")
    about = beside([("cubic_stiffness", CubicStiffness(2.0), place.machine) for place in places])
    best = about.posterior(WORTH).best
    started = _inquire._started(Within(Modes()).at("joint", DryFriction()), about, best, WORTH, 0.5)
    ((coefficient,),) = about.coefficients(best, WORTH)
    np.testing.assert_array_equal(started.machine.joint.value, [0.0, 1.0])
    assert float(started.effects[1].stiffness.value) == pytest.approx(2.0 * 0.5 * coefficient)


@pytest.mark.parametrize(
    ("second", "cost", "extended"),
    [
        (0.04, 150.0, [("a", False)]),
        (0.06, 150.0, [("a", False), ("b", True)]),
        (0.06, 90.0, [("a", False)]),
    ],
    ids=["unlikely", "likely", "at the noise"],
)
def test_what_could_stand_in_the_bests_place_is_extended_too(second, cost, extended):
    fits = [
        SimpleNamespace(
            names=(name,), solved=SimpleNamespace(cost=cost), about=SimpleNamespace(samples=100)
        )
        for name in "abc"
    ]
    inquiry: Any = _Inquiry(True, lambda text: None, Columns({}, {}, *3 * [np.ones(1)]), fits)  # type: ignore[list-item, arg-type]
    asked, reduced = [], []
    inquiry.ranked = lambda: (fits, np.array([1.0, second, 0.01]))
    inquiry._extend = lambda fit, again: asked.append((*fit.names, again))
    inquiry._reduce = lambda fit: reduced.append(fit.names)
    inquiry.search()
    assert asked == extended
    assert reduced[0] == ("a",)


def test_the_better_of_two_fits_of_a_set_is_kept(monkeypatch):
    costs = iter([9.0, 11.0, 7.0])
    monkeypatch.setattr(_inquire, "solve_from", lambda *_: SimpleNamespace(cost=next(costs)))
    monkeypatch.setattr(
        _inquire._Fit, "of", lambda solved, names, _: SimpleNamespace(names=names, solved=solved)
    )
    base = SimpleNamespace(
        names=(), solved=SimpleNamespace(cost=20.0, preparation=None),
        about=SimpleNamespace(samples=100),
    )  # fmt: skip
    inquiry: Any = _Inquiry(True, lambda text: None, Columns({}, {}, *3 * [np.ones(1)]), [base])  # type: ignore[list-item]
    at = SimpleNamespace(at=lambda position: SimpleNamespace(blocks=(None,)))
    inquiry._descent = lambda start, held: SimpleNamespace(cost=10.0, objective=at, position=None)
    kept = []
    for _ in range(3):
        inquiry._fit(("a",), [Within(Oscillator())], 0)
        kept.append([fit.solved.cost for fit in inquiry.fits])
    assert kept == [[20.0, 9.0], [20.0, 9.0], [20.0, 7.0]]


def test_names_and_what_they_may_be_instead():
    sets = [
        (("clearance", "dry_friction", "dry_friction"), 0.6),
        (("clearance", "hysteretic_spring"), 0.3),
        (("clearance",), 0.09),
        (("cubic_stiffness", "dry_friction"), 0.01),
    ]
    block: Any = None
    candidates = tuple(Candidate(names, block, 1.0, p) for names, p in sets)
    inside = Inside(block, block, candidates, "", None, None)
    assert inside.names == ("clearance", "dry_friction")
    assert inside.probability_of("clearance") == pytest.approx(0.99)
    assert inside.sets == (("clearance",), ("dry_friction", "hysteretic_spring"))
