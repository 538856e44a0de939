"""How an inquiry into a machine proceeds: what it judges by, fits, takes away and answers."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fracjax._blocks import (
    INSIDE,
    CubicStiffness,
    DryFriction,
    EndStop,
    Oscillator,
    PositionDependentGain,
    QuadraticDamping,
    QuadraticStiffness,
    Within,
)
from fracjax._inside import About, Columns, Worth, _inquire
from fracjax._inside._columns import Column
from fracjax._inside._inquire import _Inquiry
from fracjax._path import Hypothesis, Posterior

NOTHING: Any = Columns({}, {}, *3 * [np.ones(1)])  # type: ignore[list-item]
OSCILLATOR = Within(Oscillator())
# What recordings are worth ------------------------------------------------------------------------


def fit_of(
    names=(), cost=100.0, samples=100, evidence=0.0, block=OSCILLATOR, oversampling=1
) -> Any:
    """A fit of a set, of which only what is asked for is there."""
    return SimpleNamespace(
        names=names, block=block,
        solved=SimpleNamespace(cost=cost, preparation=Coarse(oversampling), block=block),
        about=SimpleNamespace(samples=samples, evidence=lambda worth, effects: (evidence, 0.0)),
    )  # fmt: skip


class Coarse(SimpleNamespace):
    """A preparation of so many steps in a sample."""

    def __init__(self, oversampling: int = 1):
        super().__init__(oversampling=oversampling)

    def __replace__(self, **changes):
        return Coarse(**changes)


def inquiry_of(*fits, specified: bool = True, columns: Any = NOTHING) -> Any:
    return _Inquiry(specified, lambda text: None, columns, [*fits])


def test_a_fit_has_inner_products_of_what_is_no_effect_at_the_responses_size():
    """That of all recordings together."""
    rng = np.random.default_rng(3)
    residual, tangent, curve = rng.standard_normal((3, 40))
    sizes = [SimpleNamespace(size=3.0), SimpleNamespace(size=4.0)]
    solved: Any = SimpleNamespace(
        whitened=[residual[:15], residual[15:]], whitened_derivative=lambda: tangent[:, None],
        preparation=SimpleNamespace(problems=lambda: sizes), block=OSCILLATOR,
    )  # fmt: skip
    others = {"drive_curve": [Column((), curve[:, None])]}
    fit = _inquire._Fit.of(solved, ("b", "a", "b"), others)
    free = curve - tangent * (tangent @ curve) / (tangent @ tangent)
    free = 5.0 * free / np.linalg.norm(curve)
    assert fit.names == ("a", "b", "b")
    assert fit.block is OSCILLATOR
    np.testing.assert_allclose(fit.about.inner.columns, [[free @ free]])
    np.testing.assert_allclose(fit.about.inner.along, [free @ residual])
    assert (fit.about.kinds, fit.about.samples, fit.about.freedom) == ((), 40, 1)


def test_fits_are_judged_by_the_best_and_ranked_by_their_evidence():
    fits = [fit_of((), 300.0, evidence=1.0), fit_of(("a",), 150.0, evidence=3.0),
            fit_of(("b",), 200.0, evidence=2.0), fit_of(("c",), 200.0, evidence=3.0)]  # fmt: skip
    inquiry = inquiry_of(*fits)
    assert inquiry.worth == Worth.of(150.0, 100, specified=True)
    assert inquiry_of(*fits, specified=False).worth == Worth.of(150.0, 100, specified=False)
    ranked, probabilities = inquiry.ranked()
    assert [fit.names for fit in ranked] == [("a",), ("c",), ("b",), ()]
    odds = np.exp([3.0, 3.0, 2.0, 1.0])
    np.testing.assert_allclose(probabilities, odds / odds.sum())


class Wrong:
    """A recording of unit noise, wrong along a wave by the square of the step."""

    wave = np.cos(0.1 * np.arange(1000))

    def __init__(self, size: float, oversampling: int = 1):
        self.size, self.oversampling = size, oversampling

    def __replace__(self, **changes):
        return Wrong(self.size, **changes)

    def problems(self):
        error = self.size * self.wave / self.oversampling**2
        one = SimpleNamespace(whiten=lambda signal: signal, respond=lambda block: error)
        return [one]


@pytest.mark.parametrize(("cost", "variance"), [(500.0, 1.0), (1000.0, 1.0), (4000.0, 4.0)])
@pytest.mark.parametrize(
    ("share", "oversampling", "effects", "coarse"),
    [
        (0.99, 1, 1, False),
        (1.01, 1, 1, True),
        (1.01, 1, 0, False),
        (1e4, 32, 1, True),
        (1e4, 33, 1, False),
    ],
)
def test_a_step_is_too_long_from_a_change_of_one_in_chi_square(
    cost, variance, share, oversampling, effects, coarse, monkeypatch
):
    """As residuals are judged, and for a machine with effects, down to a 64th of a sample."""
    samples = 1000 / (1 + (0.002 + (1 - 1 / variance) / 50) * 1000)
    change = np.sqrt(variance * 1000 / samples / np.sum(Wrong.wave**2))
    size = share * change / (1 - 1 / 4)
    monkeypatch.setattr(_inquire, "replace", lambda one, **changes: one.__replace__(**changes))
    fit = fit_of(("a",), cost, 1000)
    fit.solved = SimpleNamespace(
        block=SimpleNamespace(effects=effects * ("one",)), preparation=Wrong(size, oversampling),
        cost=cost, sensitivity=lambda: ([], None, np.zeros((1000, 0))),
    )  # fmt: skip
    assert inquiry_of(fit).is_coarse() == coarse


def test_a_finer_inquiry_keeps_what_is_likely(monkeypatch):
    gone, kept = np.log(0.999e-3), np.log(1.001e-3)
    fits = [fit_of((), evidence=-1.0, oversampling=2), fit_of(("a",)),
            fit_of(("b",), evidence=kept), fit_of(("c",), evidence=gone)]  # fmt: skip
    monkeypatch.setattr(_inquire, "replace", replaced)
    monkeypatch.setattr(_inquire, "solve_from", lambda blocks, p: (blocks[0], p.oversampling))
    made = SimpleNamespace(others="others")
    monkeypatch.setattr(_inquire, "columns_of", lambda base: made)
    monkeypatch.setattr(_inquire._Fit, "of", lambda *of: of)
    finer = inquiry_of(*fits).finer()
    assert finer.columns is made
    assert [(fit[1], fit[0][1], fit[2]) for fit in finer.fits] == [
        ((), 4, "others"), (("a",), 4, "others"), (("b",), 4, "others")
    ]  # fmt: skip
    assert all(fit[0][0] is OSCILLATOR for fit in finer.fits)


def replaced(one, **changes):
    return one.__replace__(**changes) if isinstance(one, Coarse) else replace(one, **changes)


# What is fitted -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("second", "cost", "specified", "extended"),
    [
        (0.05, 101.0, True, "ab"),
        (0.0499, 101.0, True, "a"),
        (0.05, 100.0, True, "a"),
        (0.05, 50.0, False, "ab"),
    ],
)
def test_a_rival_is_extended_from_a_twentieth_where_more_than_noise_remains(
    second, cost, specified, extended
):
    fits = [fit_of((name,), cost) for name in "abc"]
    inquiry, asked = inquiry_of(*fits, specified=specified), []
    inquiry.ranked = lambda: (fits, np.array([1.0, second, 1.0]))
    inquiry._extend = lambda fit, again: asked.append((fit.names[0], again))
    inquiry._reduce = lambda fit: None
    inquiry.search()
    assert asked == [(name, name == "b") for name in extended]


def test_a_search_ends_after_three_rounds_or_when_its_time_is_over(monkeypatch):
    fits = [fit_of((name,)) for name in "abcdefgh"]
    inquiry, asked = inquiry_of(*fits), []
    # Every extension makes another set the best.
    inquiry.ranked = lambda: (fits[len(asked) :], np.ones(8 - len(asked)))
    inquiry._extend = lambda fit, again: asked.append(fit.names[0])
    reduced = []
    inquiry._reduce = lambda fit: reduced.append(fit.names[0])
    inquiry.search()
    assert (asked, reduced) == (["a", "b", "c"], ["a", "b", "c", "d"])
    asked.clear()
    monkeypatch.setattr(_inquire, "time_is_over", lambda: True)
    inquiry.search()
    assert asked == []


def test_each_effect_of_a_set_is_taken_away_but_none_that_is_believed():
    believed = OSCILLATOR @ CubicStiffness(1.0)
    block = believed @ QuadraticDamping(2.0) @ CubicStiffness(3.0) @ EndStop(4.0)
    names = ("cubic_stiffness", "end_stop", "quadratic_damping")
    fits = [fit_of(block=believed), fit_of(("cubic_stiffness", "end_stop"))]
    inquiry, fitted = inquiry_of(*fits), []
    inquiry._fit = lambda names, starts, held: fitted.append((names, starts, held))
    inquiry._reduce(fit_of(names, block=block))
    assert [names for names, *_ in fitted] == [
        ("end_stop", "quadratic_damping"), ("cubic_stiffness", "quadratic_damping"),
    ]  # fmt: skip
    for (_, (start,), held), kept in zip(fitted, ([0, 1, 3], [0, 1, 2]), strict=True):
        assert start.effects == tuple(block.effects[k] for k in kept)
        assert held >= 3  # nothing is held
    inquiry._reduce(fit_of(("end_stop",), block=block))
    assert len(fitted) == 2


@pytest.mark.parametrize(("ratio", "solved"), [(6.7, True), (7.0, False)])
def test_a_start_without_hope_is_not_fitted_to_its_end(monkeypatch, ratio, solved):
    """Odds of exp(30): at a worth of 31 samples a χ² of 6.8 times the least; of the best start."""
    starts = {"far": 1e6, "near": ratio * 100.0}
    at = SimpleNamespace(at=lambda position: SimpleNamespace(blocks=(position,)))
    inquiry = inquiry_of(fit_of(cost=100.0), fit_of(("b",), 150.0), specified=False)
    inquiry._descent = lambda start, held: SimpleNamespace(
        cost=starts[start], objective=at, position=start
    )
    asked = []

    def solve(blocks, preparation):
        asked.append((blocks, preparation.oversampling))
        return SimpleNamespace(cost=90.0)

    monkeypatch.setattr(_inquire, "solve_from", solve)
    monkeypatch.setattr(
        _inquire._Fit, "of", lambda solved, names, _: SimpleNamespace(names=names, solved=solved)
    )
    inquiry._fit(("a",), ["far", "near"], 0)
    assert asked == ([(["near"], 1)] if solved else [])
    assert [fit.names for fit in inquiry.fits] == [(), ("b",), ("a",)][: 2 + solved]


EFFECTS = {
    "cubic_stiffness": [CubicStiffness(1.0), CubicStiffness(2.0)],
    "quadratic_damping": [QuadraticDamping(1.0)],
    "dry_friction": [DryFriction(1.0)],
    "end_stop": [EndStop(1.0)],
    "quadratic_stiffness": [QuadraticStiffness(1.0)],
    "position_dependent_gain": [PositionDependentGain(1.0)],
}


def columns_about(*missing: float, count: int = 400) -> Columns:
    """Columns of chance about a residual of unit noise with so much of the first of each effect."""
    rng = np.random.default_rng(9)
    effects = {
        name: [
            Column((("spring", e),), rng.standard_normal((count, 1)), OSCILLATOR.machine)
            for e in own
        ]
        for name, own in EFFECTS.items()
    }
    residual = rng.standard_normal(count)
    for size, shapes in zip(missing, effects.values(), strict=False):
        residual = residual + size * shapes[0].white[:, 0]
    others = {"drive_curve": [Column((), rng.standard_normal((count, 1)))]}
    return Columns(effects, others, residual, np.ones((count, 1)), count**0.5)


def extended(monkeypatch, columns, block=OSCILLATOR, names=(), others=(), again=False, ranked=None):
    """What an extension of a fit fits: names, starts, and from which effect on they are held."""
    cost = float(columns.residual @ columns.residual)
    fit = fit_of(names, cost, columns.residual.size, block=block)
    inquiry, fitted = inquiry_of(fit, *others, columns=columns), []
    monkeypatch.setattr(_inquire, "columns_of", lambda solved, others: columns)
    inquiry._fit = lambda names, starts, held: fitted.append((names, starts, held))
    if ranked is not None:
        inquiry.ranked = lambda: ([ranked], np.ones(1))
    inquiry._extend(fit, again=again)
    return fitted, inquiry


def test_the_most_probable_effects_are_fitted_alone_and_the_most_probable_sets(monkeypatch):
    columns = columns_about(1.0, -1.0)
    fitted, inquiry = extended(monkeypatch, columns)
    names = [names for names, *_ in fitted]
    about = About.of(columns, frozenset(n for n, e in INSIDE.items() if e.one_sided))
    posterior, worth = inquiry._judged(about)
    best = [tuple(sorted(h.names)) for h in posterior.hypotheses]
    singles = [*dict.fromkeys(n for n in best if len(n) == 1)]
    assert names[:4] == singles[:4]
    least = posterior.best.log_posterior + np.log(1e-3)
    likely = dict.fromkeys(
        tuple(sorted(h.names)) for h in posterior.hypotheses if h.names and h.log_posterior > least
    )
    assert names == [*dict.fromkeys([*singles[:4], *[*likely][:3]])]
    assert ("cubic_stiffness",) in names
    # At the size of its columns, or smaller, and of the sign that it may have.
    for own, starts, held in fitted:
        assert held == 0
        one = next(h for h in posterior.hypotheses if tuple(sorted(h.names)) == own)
        sizes = [[float(getattr(e, e.size).value) for e in start.effects] for start in starts]
        coefficients = about.coefficients(one, worth)
        wanted = []
        for kind, (coefficient,) in zip(one.kinds, coefficients, strict=True):
            ((_, effect),) = about.shapes[kind].inside
            signed = INSIDE[about.kinds[kind].name].one_sided
            share = max(coefficient, 0.01) if signed else coefficient
            wanted.append(share * float(getattr(effect, effect.size).value))
        assert any(np.allclose(s, wanted) for s in sizes[::2])
        for full, small in zip(sizes[::2], sizes[1::2], strict=True):
            np.testing.assert_allclose(small, 0.3 * np.array(full))


def test_a_set_is_likely_from_a_thousandth_of_the_best_and_three_are_fitted(monkeypatch):
    """By its own best law; beside the four most probable effects alone."""
    places = {name: k for k, name in enumerate(EFFECTS, 1)} | {"cubic_stiffness": 0}

    def hypothesis(odds: float, *names: str, law: str = "0.0") -> Hypothesis:
        kinds = tuple(places[name] for name in names)
        return Hypothesis(np.log(odds), 0.0, law, names, kinds, len(names) * (1.0,))

    pairs = [("cubic_stiffness", name) for name in EFFECTS if name != "cubic_stiffness"]
    alone = [hypothesis(1e-4 - 1e-5 * k, name) for k, name in enumerate(EFFECTS)]
    columns, answers = columns_about(1.0), []
    for odds in ((1.001e-3, 0.999e-3), (0.3, 0.02, 0.01, 0.005)):
        likely = [hypothesis(o, *pair) for o, pair in zip(odds, pairs, strict=False)]
        # Under another law the same set is hopeless.
        others = [hypothesis(1e-9, *pair, law="0.3") for pair in pairs]
        posterior = Posterior.of([hypothesis(1.0), *alone, *likely, *others])
        monkeypatch.setattr(
            _Inquiry, "_judged", lambda self, about, p=posterior: (p, Worth(1.0, 400.0))
        )
        fitted, _ = extended(monkeypatch, columns)
        answers.append([names for names, *_ in fitted])
    singles = [(name,) for name in [*EFFECTS][:4]]
    assert answers[0] == [*singles, tuple(sorted(pairs[0]))]
    assert answers[1] == [*singles, *(tuple(sorted(pair)) for pair in pairs[:3])]


def test_sets_that_were_fitted_are_fitted_again_where_asked_and_none_of_four_effects(monkeypatch):
    block = OSCILLATOR @ EndStop(1.0) @ EndStop(2.0, side=-1.0)
    columns = columns_about(1.0, 0.0)
    there = fit_of(("cubic_stiffness", "end_stop", "end_stop"), 1e6)
    kwargs: dict = {"block": block, "names": ("end_stop", "end_stop")}
    fitted, _ = extended(monkeypatch, columns, **kwargs)
    first = [names for names, *_ in fitted]
    assert ("cubic_stiffness", "end_stop", "end_stop") in first
    assert all(len(names) == 3 and held == 2 for names, _, held in fitted)
    fitted, _ = extended(monkeypatch, columns, others=[there], **kwargs)
    assert [n for n, *_ in fitted] == [n for n in first if n != there.names]
    fitted, _ = extended(monkeypatch, columns, others=[there], again=True, **kwargs)
    assert [n for n, *_ in fitted] == first


def test_what_looks_like_the_best_is_fitted_too(monkeypatch):
    """Where one effect more is the best, and whatever its own probability."""
    columns = columns_about(1.0)
    alike = {n for n in EFFECTS if n in _inquire._alike("end_stop")}
    fitted, _ = extended(monkeypatch, columns, ranked=fit_of(("end_stop",)))
    assert alike <= {names[0] for names, *_ in fitted if len(names) == 1}
    plain, _ = extended(monkeypatch, columns, ranked=fit_of(()))
    assert len(fitted) >= len(plain)
    both, _ = extended(monkeypatch, columns, ranked=fit_of(("end_stop", "quadratic_stiffness")))
    assert [n for n, *_ in both] == [n for n, *_ in plain]


def test_it_is_judged_by_what_the_best_set_leaves_to_first_order_or_a_fit_leaves():
    columns = columns_about(1.0)
    about = About.of(columns, frozenset())
    total = float(columns.residual @ columns.residual)
    _, worth = inquiry_of(fit_of((), total, 400), columns=columns)._judged(about)
    remainder = about.remainder(about.posterior(worth).best, worth)
    assert worth.variance == pytest.approx(max(remainder / 400, 1.0), rel=1e-3)
    assert total > 1.5 * remainder
    posterior, worth = inquiry_of(fit_of((), 200.0, 400), specified=False)._judged(about)
    assert worth == Worth.of(200.0, 400, specified=False)
    best = about.posterior(worth).best
    assert posterior.best.names == best.names
    assert posterior.best.log_posterior == pytest.approx(best.log_posterior)


def test_parameters_belong_to_an_effect_or_to_the_machine():
    places = [
        _inquire._place(n) for n in ("effects.0.gap", "effects.12.gap", "machine.gain", "start")
    ]
    assert places == [0, 12, -1, -1]
    names = "machine.gain", "effects.0.gap", "start", "effects.1.gap"
    whitened = np.arange(12.0).reshape(2, 6)  # and two offsets
    solved: Any = SimpleNamespace(
        sensitivity=lambda: ([SimpleNamespace(name=n) for n in names], None, whitened)
    )
    np.testing.assert_array_equal(_inquire._machines_own(solved), whitened[:, [0, 2, 4, 5]])
