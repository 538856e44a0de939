"""The diagnosis: noise, score test, held-out prediction, and the verdicts on independent truths."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kstest

import fracjax as fj
from benchmarks.concealed.cases import make_case
from fracjax._blocks import EFFECTS
from fracjax._diagnose import _detect, _refit, _round
from fracjax._diagnose._diagnose import _Conclusion
from fracjax._diagnose._evidence import delta_bic
from fracjax._diagnose._held_out import Gain, Prediction
from fracjax._diagnose._judgement import (
    Judged,
    best_of,
    excess_doubt,
    explained_fraction,
    freedom_of,
    is_exhausted,
    leaves_a_pattern,
    probability_of,
    reason,
    rivals_of,
    share_of_excess,
)
from fracjax._diagnose._procedure import Course
from fracjax._diagnose._result import Axis
from fracjax._diagnose._score import EffectScore, Residual, family_wise_p
from fracjax._fit import (
    Preparation,
    autoregression,
    measured_noise,
    numerical_error,
    prepare,
    settle,
    silent,
)
from fracjax._recording import Recording

VERDICTS = {"none", "missing", "confusable", "unexplained"}


def recording_of(case) -> Recording:
    step = float(case.time[1] - case.time[0])
    return Recording(case.voltage, case.displacement, step)


@pytest.fixture(scope="module")
def null():
    return fj.diagnose(fj.parse_model("foh"), recording_of(make_case("foh", "none", "bursts")))


@pytest.fixture(scope="module")
def concealed():
    case = make_case("foh", "electrostriction", "bursts", level=3.0)
    return case, fj.diagnose(fj.parse_model("foh"), recording_of(case))


def test_a_clean_recording_gets_no_name(null):
    assert null.verdict == "none"
    assert null.effects == ()
    assert null.extended is None
    assert null.p_value > 0.01
    assert all(c.detectable_amplitude > 0 for c in null.candidates)


def test_a_concealed_effect_is_named_located_and_predicts_better(concealed):
    case, diagnosis = concealed
    assert case.label["R2"] > 0.999
    assert diagnosis.verdict == "missing"
    assert [e.name for e in diagnosis.effects] == ["electrostriction"]
    assert diagnosis.axes[0].axis in {"level", "harmonics"}
    assert diagnosis.held_out.extended_rmse == pytest.approx(case.label["noise_sd_um"], rel=0.05)
    assert diagnosis.held_out.base_rmse > 2 * diagnosis.held_out.extended_rmse
    assert diagnosis.extended_model.name == "electrostriction >> foh"


def test_the_named_parameter_is_in_its_interval(concealed):
    case, diagnosis = concealed
    q = next(p for p in diagnosis.effects[0].parameters if p.name == "q")
    span = np.ptp(case.voltage)
    # Of u + q (u - u0)², another centre c changes the gain: q' = q U / (1 + 2 q (c - u0)).
    truth = case.label["parameters"]
    centre = 0.5 * (case.voltage.max() + case.voltage.min())
    expected = truth["q"] * span / (1 + 2 * truth["q"] * (centre - truth["u0"]))
    assert abs(q.value - expected) < 4 * q.standard_error + 0.02 * abs(expected)
    assert q.ends is not None  # told by the profile, in the fit that is saved too
    assert q.interval in {e.interval for e in diagnosis.extended.estimates}


def test_the_noise_floor_is_the_simulated_one(concealed, null):
    case, diagnosis = concealed
    for found in (diagnosis, null):
        assert found.noise.method == "static"
    assert diagnosis.noise.sigma == pytest.approx(case.label["noise_sd_um"], rel=0.1)


def test_what_is_written_follows_the_schema(concealed, null, tmp_path: Path):
    required = {"schema", "model", "recordings", "noise", "numerics", "verdict", "effects"}
    for number, diagnosis in enumerate((concealed[1], null)):
        diagnosis.save(tmp_path / f"{number}.json")
        content = json.loads((tmp_path / f"{number}.json").read_text())
        assert required | {"candidates", "where", "fit", "sentence"} <= set(content)
        assert content["verdict"] in VERDICTS
        assert {c["name"] for c in content["candidates"]} == set(fj.EFFECTS)
        evidence = [("delta_bic" in c, c["log_evidence"]) for c in content["candidates"]]
        assert evidence == sorted(evidence, reverse=True)
        for axis in content["where"]["axes"]:
            assert len(axis["edges"]) == len(axis["strength"]) + 1


# Noise ------------------------------------------------------------------------------------------


def test_autoregression_finds_the_colour():
    white = np.random.default_rng(0).standard_normal(20_000)
    coefficients, innovation = autoregression([np.asarray(lfilter([1], [1, -0.6], white))])
    assert coefficients[1] == pytest.approx(-0.6, abs=0.03)
    assert innovation == pytest.approx(1.0, rel=0.03)


def test_a_mains_line_does_not_enter_the_whitening():
    generator = np.random.default_rng(1)
    noise = generator.standard_normal(8000)
    line = 3 * np.sin(2 * np.pi * 0.1 * np.arange(8000))
    with_line = autoregression([noise + line])[1]
    assert with_line == pytest.approx(autoregression([noise])[1], rel=0.05)


def test_repeats_show_the_noise_under_a_slow_decay():
    generator = np.random.default_rng(2)
    time = np.arange(8000) / 200
    drive = np.sin(2 * np.pi * time)
    response = 5 * drive + 0.1 * np.log(time + 0.1) + 0.01 * generator.standard_normal(8000)
    noise = measured_noise(Recording(drive, response, 0.005))
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(0.01, rel=0.05)


# Score test and held-out prediction ---------------------------------------------------------------


def scores_of(directions: np.ndarray, residual: np.ndarray) -> EffectScore:
    ones = np.ones(len(directions))
    effect = fj.EFFECTS["creep"]
    alone = tuple((k,) for k in range(len(directions)))
    return EffectScore(effect, [], directions @ residual, ones, 0 * ones, ones, directions, alone)


def test_the_family_wise_p_is_uniform_where_nothing_is_missing():
    generator = np.random.default_rng(3)
    directions = generator.standard_normal((30, 200)) + 2 * generator.standard_normal(200)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    p_values = [
        family_wise_p([scores_of(directions, generator.standard_normal(200))], 1e9, seed)
        for seed in range(150)
    ]
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_projection_removes_what_the_fit_can_absorb():
    generator = np.random.default_rng(4)
    basis = np.linalg.qr(generator.standard_normal((50, 4)))[0]
    residual = Residual(generator.standard_normal(50), basis)
    columns = generator.standard_normal((3, 50))
    assert np.abs(residual.project(columns) @ basis).max() < 1e-12
    assert np.abs(residual.project((basis @ np.ones(4))[None])).max() < 1e-12


def test_the_numerical_error_falls_when_the_grid_is_refined():
    case = make_case("foh", "none", "bursts")
    preparation = prepare([recording_of(case)])
    solved, preparation = settle(
        fj.parse_model("foh").block, preparation, history="constant", starts=1, seed=0
    )
    errors = []
    for oversampling in (1, 2, 4):
        finer = preparation.with_oversampling(oversampling)
        errors.append(numerical_error(solved, finer))
    assert errors[0] > 4 * errors[1] > 16 * errors[2]


# What counts as noise, and what a name needs ------------------------------------------------------

STEP = 2e-3
CYCLES = 12
TIMES = STEP * np.arange(CYCLES * 500)
TONE = 50 - 40 * np.cos(2 * np.pi * TIMES)


def creeping(noise: np.ndarray) -> Recording:
    """A law that the model creep holds exactly, under some noise."""
    law = fj.simulate(fj.parse_model("creep"), TONE, STEP, "constant").response
    return Recording(TONE, law + noise, STEP, "V", "um")


def test_interference_that_does_not_repeat_is_noise():
    """A bump at 37 Hz of ever changing phase, far above the white noise beside it."""
    generator = np.random.default_rng(3)
    bump = lfilter([1.0], np.poly(0.995 * np.exp(2j * np.pi * 37 * STEP * np.array([1, -1]))).real,
                   generator.standard_normal(TIMES.size))  # fmt: skip
    white, bump = generator.standard_normal(TIMES.size), np.asarray(bump)
    noise = 0.01 * white + 0.02 * bump / bump.std()
    diagnosis = fj.diagnose(fj.parse_model("creep"), creeping(noise))
    assert diagnosis.noise.method == "repeats"
    assert diagnosis.verdict == "none"


def test_a_noise_floor_above_what_a_fit_leaves_is_not_believed():
    """What differs between the periods is a motion of the model's own, not noise."""
    drive = TONE * (1 + 0.02 * np.floor(TIMES))
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    law = fj.simulate(fj.parse_model("creep"), drive, STEP, "constant").response
    told = fj.Noise(0.5, "um", "repeats", np.ones(1), 0.5)
    found = fj.fit(fj.parse_model("creep"), Recording(drive, law + white, STEP), noise=told)
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.method == "residual"
    assert noise.sigma == pytest.approx(0.005, rel=0.05)


def test_a_specification_is_believed():
    white = 0.005 * np.random.default_rng(0).standard_normal(TIMES.size)
    told = fj.Noise(0.5, "um", "specification", np.ones(1), 0.5)
    found = fj.fit(fj.parse_model("creep"), creeping(white), noise=told)
    assert found.preparation.takes[0].noise == told


CONVINCING = Gain(100.0, 1.0, 1.0, foretold=(True,), base_rmse=2.0, extended_rmse=1.0, left=1.0)


def judged_of(
    name: str,
    delta_bic: float,
    *,
    plausible: bool = True,
    gain: Gain = CONVINCING,
    spared: float = 0.0,
    conceded: float = 0.0,
    before: float = 0.0,
    foretells_worse: bool = False,
    left: float = 0.0,
    special_case: str = "",
) -> Judged:
    unseen: Any = None
    refit: Any = SimpleNamespace(
        name=name,
        solved=SimpleNamespace(cost=left, samples=0.0),
        layer=SimpleNamespace(effect=SimpleNamespace(special_case=special_case)),
    )
    return Judged(
        refit=refit,
        preparation=unseen,
        delta_bic=delta_bic,
        altogether=before + delta_bic,
        spared=spared,
        conceded=conceded,
        explained=1.0,
        numerics=0.0,
        gain=gain,
        foretells_worse=foretells_worse,
        prediction=unseen,
        predict=unseen,
        plausible=plausible,
    )


@pytest.mark.parametrize(
    ("few", "many", "winner"),
    [
        # Numbers that the data hardly know do not take the name of a law that fits as well …
        ((5636, -3), (5630, 6), "few"),
        ((116, 6), (108, 17), "few"),
        # … and many that they know do not lose it to one that fits less.
        ((104, 0), (87, 35), "many"),
    ],
)
def test_a_name_goes_to_the_most_support_by_both_counts_of_numbers(few, many, winner):
    found = [judged_of("few", few[0], spared=few[1]), judged_of("many", many[0], spared=many[1])]
    best = best_of(found)
    assert best is not None
    assert best.name == winner


def test_rivals_are_those_within_25_or_a_hundredth():
    best, close, far = judged_of("a", 10_000), judged_of("b", 9901), judged_of("c", 9899)
    bad = judged_of("d", 10_100, plausible=False)
    found = [far, close, best, bad]
    assert best_of(found) is best
    # One outside its usual range is not adopted, but not excluded either.
    assert rivals_of(best, found) == [bad, close]
    # Nor is one that foretells a recording worse than without it, however much it gains.
    wild = judged_of("i", 10_200, foretells_worse=True)
    assert best_of([*found, wild]) is best
    assert rivals_of(best, [*found, wild]) == [wild, bad, close]
    # What needs to leave its range and still fits less well only mimics the winner.
    mimic = judged_of("e", 9990, plausible=False)
    assert rivals_of(best, [*found, mimic]) == [bad, close]
    # What fits better does not, for want of numbers that the data hardly know.
    several = judged_of("a", 10_000, spared=60)
    assert best_of([bad, several]) is several
    assert rivals_of(several, [bad, several]) == [bad]
    # A gain that held-out data leave open does not exclude a rival; one they refute does.
    open_ = judged_of("f", 9990, gain=replace(CONVINCING, fall=2.0))
    refuted = [
        judged_of("g", 9990, gain=replace(CONVINCING, fall=-1.0)),
        judged_of("h", 9990, gain=replace(CONVINCING, improved=0.6)),
    ]
    assert not open_.admissible
    assert rivals_of(best, [best, open_, *refuted]) == [open_]
    small = [judged_of("a", 50), judged_of("b", 26), judged_of("c", 24)]
    assert [j.name for j in rivals_of(small[0], small)] == ["b"]
    # Nor is what was adopted before of exactly the actuator's law.
    later = [judged_of("a", 500, before=9500), judged_of("b", 420), judged_of("c", 380)]
    assert [j.name for j in rivals_of(later[0], later)] == ["b"]
    # Nor do numbers exclude a rival that the data hardly know, up to 10 in BIC.
    loose = judged_of("e", 16, spared=15)
    assert rivals_of(small[0], [*small, loose]) == [small[1], loose]
    assert rivals_of(judged_of("a", 50, spared=15), [loose]) == []
    assert rivals_of(small[0], [judged_of("f", 14, spared=100)]) == []
    # Nor do usual ranges, which no law of another's form need keep to.
    usual = judged_of("g", 24, conceded=2)
    assert rivals_of(small[0], [usual]) == [usual]
    assert rivals_of(judged_of("a", 50, conceded=2), [usual]) == []
    # Nor the count of numbers that fit and foretell better than the winner's.
    winner = judged_of("a", 50, left=10.0)
    better, worse = (replace(CONVINCING, fall=fall) for fall in (101.0, 99.0))
    many = judged_of("m", 10, left=9.0, gain=better)
    assert rivals_of(winner, [many]) == [many]
    assert rivals_of(winner, [judged_of("m", 10, left=9.0, gain=worse)]) == []
    assert rivals_of(winner, [judged_of("m", 10, left=11.0, gain=better)]) == []


def test_a_law_that_contains_another_takes_its_name_for_a_hundredth_more():
    one, two = judged_of("a", 9901), judged_of("b", 10_000, special_case="a")
    assert best_of([one, two]) is one
    assert rivals_of(one, [one, two]) == [two]
    assert best_of([judged_of("a", 9899), two]) is two
    # Only where that is admissible, and contained.
    assert best_of([judged_of("a", 9999, plausible=False), two]) is two
    apart = judged_of("b", 10_000)
    assert best_of([one, apart]) is apart
    # Of a small gain the evidence decides; all that was gained before counts.
    small = judged_of("b", 50, special_case="a")
    assert best_of([judged_of("a", 40), small]) is small
    later, simple = judged_of("b", 50, before=9950, special_case="a"), judged_of("a", 40)
    assert best_of([simple, later]) is simple


def test_a_numerical_error_far_under_what_is_left_excludes_no_candidate():
    exact, far = judged_of("a", 50), judged_of("b", 50, left=10_000.0)
    assert replace(exact, numerics=0.9).admissible
    assert not replace(exact, numerics=1.1).admissible
    assert replace(far, numerics=9.0).admissible
    assert not replace(far, numerics=11.0).admissible


def test_a_law_of_many_numbers_is_named_where_it_has_the_evidence_but_is_no_rival_for_having_them():
    rigid, many = judged_of("c", 59, spared=2), judged_of("m", 43, spared=49)
    assert best_of([rigid, many]) is many
    assert rivals_of(many, [rigid, many]) == []
    # Behind in both, or ahead in one alone and near in the other, it is told.
    close = judged_of("c", 71, spared=2)
    assert rivals_of(many, [close, many]) == [close]
    assert probability_of(many, [close, many]) == pytest.approx(0.96 / (1 + np.exp(-19 / 8)))
    simple, imitating = judged_of("a", 200, spared=-2), judged_of("m", 148, spared=41)
    assert best_of([imitating, simple]) is simple
    assert rivals_of(simple, [imitating, simple]) == []


SCORED: Any = SimpleNamespace()


@pytest.mark.parametrize(
    ("judged", "p_value", "numerics", "said"),
    [
        (judged_of("a", 100), 0.02, 0.0, "nothing in the residual beyond noise"),
        (judged_of("a", 100), 0.001, 1.5, "not refitted: the discretisation error is 1.5"),
        (None, 0.001, 0.0, "not refitted: other effects have more evidence"),
        (judged_of("a", 100), 0.001, 0.0, "adopted: better beyond doubt"),
        (replace(judged_of("b", 100), numerics=2.0), 0.001, 0.0, "its discretisation error is 2"),
        (judged_of("b", 9.9), 0.001, 0.0, "rejected: the refit gains only 9.9 in BIC"),
        (judged_of("b", 100, plausible=False), 0.001, 0.0, "outside their plausible range"),
        (judged_of("b", 100, gain=replace(CONVINCING, fall=1.9)), 0.001, 0.0, "not predict held-o"),
        (judged_of("b", 100), 0.001, 0.0, "has less evidence than the adopted effect"),
    ],
)
def test_every_candidate_is_told_why(judged, p_value, numerics, said):
    assert said in reason(SCORED, judged, ["a"], p_value, numerics)


def test_a_probability_falls_with_the_rivals_and_the_closer_they_are():
    alone = [judged_of("a", 1000), judged_of("b", 970)]
    assert probability_of(alone[0], alone) == pytest.approx(0.96)
    one = [judged_of("a", 1000), judged_of("b", 992)]
    assert probability_of(one[0], one) == pytest.approx(0.96 / (1 + np.exp(-1)))
    two = [*one, judged_of("c", 1000)]
    assert probability_of(two[0], two) == pytest.approx(0.96 / (2 + np.exp(-1)))
    # One that fits better, but is not admissible, is no more likely than the winner.
    ahead = [judged_of("a", 1000), judged_of("b", 1100, plausible=False)]
    assert probability_of(ahead[0], ahead) == pytest.approx(0.96 / 2)


def stage_of(cost: float) -> Any:
    return SimpleNamespace(solved=SimpleNamespace(cost=cost, samples=1000))


def known_to(doubt: float) -> Any:
    """A preparation whose second recording's noise level is known to a share."""
    less, more = (SimpleNamespace(doubt=lambda _, d=d: d) for d in (doubt / 2, doubt))
    return SimpleNamespace(takes=[SimpleNamespace(noise=n) for n in (less, more, None)])


def ended_at(cost: float, excess: float = 0.0, doubt: float = 0.1, free: int = 3) -> Any:
    left = max(1.0, cost / 1000)
    solved = SimpleNamespace(cost=cost, samples=1000, left=left, kurtosis=3.0, free=free)
    return SimpleNamespace(solved=solved, preparation=known_to(doubt), excess=excess)


def test_what_is_left_over_is_judged_as_far_as_the_noise_is_known():
    doubt = 3 * np.sqrt(2 / 1000 + 0.1**2)
    assert excess_doubt(known_to(0.1), ended_at(0).solved) == pytest.approx(doubt)
    assert freedom_of(known_to(0.1), 3.0) == pytest.approx(200)
    for excess, most in ((0.0, 1.5 + doubt), (4000.0, 1.7 + doubt)):
        base = ended_at(5000, excess)
        assert is_exhausted(base, ended_at(1000 * most - 1))
        assert not is_exhausted(base, ended_at(1000 * most + 1))


def test_the_shares_that_an_effect_explains():
    base = ended_at(3000, excess=2000)
    doubt = 1000 * excess_doubt(base.preparation, base.solved)
    share = explained_fraction(base, ended_at(2000).solved)
    assert share == pytest.approx(1000 / (2000 - doubt))
    assert explained_fraction(base, ended_at(900).solved) == 1
    assert explained_fraction(base, ended_at(3001).solved) == 0
    winner: Any = ended_at(1500)
    assert share_of_excess(base, ended_at(2000), winner) == pytest.approx(0.25)


def test_evidence_counts_in_units_of_what_is_left():
    assert delta_bic(ended_at(3000).solved, ended_at(2000).solved) == pytest.approx(500)
    assert delta_bic(ended_at(3000).solved, ended_at(500).solved) == pytest.approx(2500)
    # What a number costs does not fall with it.
    more = delta_bic(ended_at(3000).solved, ended_at(2000, free=5).solved)
    assert more == pytest.approx(500 - 2 * np.log(1000))


@pytest.mark.parametrize(("excess", "left"), [(40.0, False), (300.0, True)])
def test_a_pattern_is_what_places_still_take_of_what_an_effect_took(excess, left):
    axes = [
        Axis("time", "s", np.arange(3.0), np.ones(2), 3.0, (), 0.5, excess=e) for e in (0.0, excess)
    ]
    assert leaves_a_pattern(stage_of(2000), stage_of(1000), axes) == left


def test_an_effect_is_refitted_once_however_it_came_to_be_listed():
    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(
            effect=EFFECTS[name], promised=z**2, height=z, log_evidence=z, best=0,
            directions=np.array([[1.0, 0.0]]),
        )  # fmt: skip

    names = ("creep", "delay", "drive_lag", "sensor_lag", "resonance", "saturation")
    listed = [scored(name, 20.0 - k) for k, name in enumerate(names)]
    solved = SimpleNamespace(block=fj.parse_model("foh").block)
    stage: Any = SimpleNamespace(
        displaced=True, name="foh", preparation=None, solved=solved, undisplaced=solved
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_detect, "residual_of", lambda *_: None)
        patch.setattr(_detect, "scored", lambda *_: listed[::-1])
        found = _round._candidates(stage, listed, 0.0, silent)[0]
    assert sorted(score.effect.name for score in found) == sorted(names)
    assert [score.effect.name for score in found[:4]] == list(names[:4])


def test_an_effect_that_scores_nearly_as_much_as_any_is_refitted_too():
    names = ("creep", "delay", "backlash", "saturation", "resonance", "second_mode", "drive_lag")
    heights = (20.0, 19.0, 18.5, 18.4, 18.3, 17.0, 3.0)
    directions = np.eye(len(names))

    def scored(k: int) -> EffectScore:
        effect: Any = SimpleNamespace(name=names[k], one_sided=False)
        return EffectScore(
            effect=effect, trials=[], z=heights[k] * np.ones(1), norms=np.ones(1),
            concealments=np.zeros(1), sizes=np.ones(1), directions=directions[k : k + 1],
            families=((0,),),
        )  # fmt: skip

    listed = _round._shortlist([scored(k) for k in range(len(names))], 10.0)
    assert [score.effect.name for score in listed] == list(names[:5])


def test_starts_of_a_refit_are_unlike():
    generator = np.random.default_rng(8)
    first, other = np.linalg.qr(generator.standard_normal((50, 2)))[0].T
    neighbour = first + 1e-4 * other
    directions = np.stack([first, neighbour / np.linalg.norm(neighbour), other, -first])
    unseen: Any = None
    score = EffectScore(
        effect=unseen, trials=[], z=np.array([9.0, 8.9, 5.0, 1.0]), norms=np.ones(4),
        concealments=np.zeros(4), sizes=np.ones(4), directions=directions,
        families=((0,), (1,), (2,), (3,)),
    )  # fmt: skip
    assert _refit.unlike(score, 3) == [0, 2]
    assert _refit.unlike(score, 1) == [0]


@pytest.mark.parametrize(
    ("oversampling", "samples", "grids"),
    [(4, 4000, [1, 4]), (8, 2000, [2, 8]), (4, 3999, [4]), (2, 100_000, [2])],
)
def test_a_refit_on_a_fine_and_long_grid_begins_on_a_coarse_one(
    oversampling, samples, grids, monkeypatch
):
    found = []

    def solved(starts, preparation, hopeless):
        found.append(preparation.oversampling)
        return SimpleNamespace(block="found")

    monkeypatch.setattr(_refit, "solve_from", solved)
    # As long as a recording is, and no more than that is looked at.
    takes: Any = (SimpleNamespace(recording=range(samples)),)
    _refit._searched([], Preparation(takes, oversampling), 0.0)
    assert found == grids


def test_look_alikes_are_told_with_the_drive_that_would_part_them(monkeypatch):
    """A lag on a slow sine could be a delay or a sensor's: all are told, and a faster drive."""
    # Of the whole catalogue each law costs a compilation.
    asked = {name: EFFECTS[name] for name in ("drive_lag", "delay", "sensor_lag", "resonance")}
    monkeypatch.setattr(_detect, "EFFECTS", asked)
    step, lag = 2e-3, 0.01
    drive = 50 - 40 * np.cos(2 * np.pi * step * np.arange(1500))
    keep = np.exp(-step / lag)
    late = 10 + np.asarray(lfilter([1 - keep], [1, -keep], drive - 10))
    noise = 1e-3 * np.random.default_rng(2).standard_normal(drive.size)
    response = fj.simulate("lfdh", late, step).response + noise
    found = fj.diagnose("lfdh", Recording(drive, response, step), limits="0..100 V, 20 V/ms")
    assert found.verdict == "confusable"
    names = {found.effects[0].name, *found.effects[0].confusable_with}
    assert "drive_lag" in names
    assert found.next_experiment is not None
    assert set(found.next_experiment.separates) <= names
    proposed = found.next_experiment.drive
    assert 0 <= proposed.values.min() < proposed.values.max() <= 100
    assert np.abs(np.diff(proposed.values)).max() / proposed.step <= 20e3 * (1 + 1e-9)


@pytest.mark.parametrize(
    ("layers", "left", "off", "is_unseen", "stands_in"),
    [
        (2, 4.0, 3.0, True, True),
        # One law may differ from the effect's own, and reach less far.
        (1, 4.0, 3.0, True, False),
        # What comes down to the noise is left with the names it has.
        (2, 1.4, 3.0, True, False),
        (2, 4.0, 1.3, True, False),
        # Stretches are no other recording.
        (2, 4.0, 3.0, False, False),
    ],
)
def test_several_effects_that_neither_fit_nor_foretell_stand_in_for_another(
    layers, left, off, is_unseen, stands_in
):
    stage = ended_at(1000 * left)
    stage.layers = (None,) * layers
    white = np.random.default_rng(0).standard_normal(1000)
    before, after = (
        Prediction(1.0, (1.0,), size * white, np.zeros(1000, int), np.zeros((1000, 0)))
        for size in (20.0, off * np.sqrt(left))
    )
    unseen = "another" if is_unseen else None
    conclusion: Any = SimpleNamespace(stage=stage, unseen=unseen, _predicted=(before, after))
    assert _Conclusion._stands_in.fget(conclusion) is stands_in  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("gained", "p_value", "verdict"),
    [
        (20, 0.005, "unexplained"),
        (20, 0.02, "none"),
        (5, 0.005, "none"),
        (5, 5e-5, "unexplained"),
    ],
)
def test_places_alone_must_be_surer(gained, p_value, verdict):
    unseen: Any = None
    first: Any = SimpleNamespace(p_value=p_value)
    refitted = {"a": judged_of("a", gained)}
    course = Course(first, True, [], first, [], refitted, unseen, None)
    conclusion: Any = SimpleNamespace(course=course, lawless=None)
    assert _Conclusion._verdict(conclusion, ()) == verdict
