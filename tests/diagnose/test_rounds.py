"""The rounds of a diagnosis: look-alikes from the catalogue, a second look at the first effect,
optima far out in a flat valley."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose import _detect, _procedure, _refit, _round
from fracjax._diagnose._held_out import Gain, Predict, Prediction, predict_stretches
from fracjax._diagnose._judgement import SIGNIFICANCE, Judged, best_of
from fracjax._diagnose._refit import Refit, begun_from, sought_further, within_usual_ranges
from fracjax._diagnose._score import EffectScore, _families, kind_of
from fracjax._diagnose._stage import Layer, Stage, wrapped
from fracjax._fit import prepare, residual_noise, silent, solve_from
from fracjax._parameters import named_parameters, set_values
from tests.helpers import specified

STEP = 5e-3
TIMES = STEP * np.arange(600)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES) * np.linspace(1, 0.4, TIMES.size)
NOISE = 0.003 * np.random.default_rng(5).standard_normal(TIMES.size)


def stage_of(names: tuple[str, ...]) -> Stage:
    """LFDH with effects, fitted to a recording that has electrostriction and a lag."""
    truth = fj.parse_model("electrostriction >> lfdh >> drive_lag").block
    truth = set_values(truth, {"second.time_constant": 0.02})
    response = fj.simulate(fj.Model(truth), DRIVE, STEP, "constant").response
    recording = fj.Recording(DRIVE, response + NOISE * np.ptp(response), STEP, "V", "um")
    sigma = 0.003 * float(np.ptp(response))
    told = specified(sigma)
    preparation = prepare([recording], history="constant", noise=told)
    setting = preparation.setting
    base = fj.parse_model("lfdh", setting).block
    layers = tuple(Layer(EFFECTS[n], EFFECTS[n].trials(setting)[0]) for n in names)
    block = wrapped(base, [(layer, layer.trial) for layer in layers])
    return Stage("lfdh", base, layers, solve_from([block], preparation), preparation)


NOTHING: Any = None
JUDGED = Judged(
    refit=NOTHING,
    preparation=NOTHING,
    delta_bic=1.0,
    altogether=1.0,
    spared=0.0,
    conceded=0.0,
    explained=1.0,
    numerics=0.0,
    gain=Gain(100.0, 1.0, 1.0, foretold=(True,), base_rmse=2.0, extended_rmse=1.0, left=1.0),
    foretells_worse=False,
    prediction=NOTHING,
    predict=NOTHING,
    plausible=True,
)


def judged(stage: Stage, name: str) -> Judged:
    """An effect fitted outermost on a stage, as a round judges it."""
    layer = Layer(EFFECTS[name], EFFECTS[name].trials(stage.preparation.setting)[0])
    solved = solve_from([layer.effect.insert(stage.solved.block, layer.trial)], stage.preparation)
    score: Any = SimpleNamespace(effect=layer.effect, trials=[layer.trial], best=0)
    return replace(
        JUDGED,
        refit=Refit(score, solved),
        preparation=stage.preparation,
        delta_bic=stage.solved.bic - solved.bic,
        altogether=stage.solved.bic - solved.bic,
        prediction=SimpleNamespace(),  # type: ignore[arg-type]
        predict=lambda *_: SimpleNamespace(),  # type: ignore[arg-type, return-value]
    )


def judged_again(
    names: tuple[str, ...],
    beside: tuple[str, ...],
    monkeypatch,
    predict: Predict = predict_stretches,
) -> tuple[list[str], str | None]:
    """The effects that stay when each but the last is judged again among `beside`, and the one that
    was too small to."""
    monkeypatch.setattr(_procedure, "scored", lambda *_: [])
    monkeypatch.setattr(_procedure, "residual_of", lambda *_: None)
    monkeypatch.setattr(
        _procedure, "judge", lambda base, less, *_: [judged(less, name) for name in beside]
    )
    with jax.enable_x64(True):
        base, stage = stage_of(()), stage_of(names)
        rounds = [_procedure.Round(judged(base, name), []) for name in names]
        stage, rounds, small = _procedure._reconsidered(base, stage, rounds, predict, 0, silent)
    assert [layer.effect.name for layer in stage.layers] == [r.winner.name for r in rounds]
    return [r.winner.name for r in rounds], small


def reconsidered(names: tuple[str, ...], beside: tuple[str, ...], monkeypatch) -> list[str]:
    """The effects that stay."""
    return judged_again(names, beside, monkeypatch)[0]


def test_what_was_first_adopted_gives_way_to_what_does_better_beside_the_second(monkeypatch):
    """A bent sensor bends the line as electrostriction does, less well."""
    beside = ("sensor_nonlinearity", "electrostriction")
    found = reconsidered(("sensor_nonlinearity", "drive_lag"), beside, monkeypatch)
    assert found == ["drive_lag", "electrostriction"]


def test_where_more_than_noise_is_left_the_idle_is_dropped_and_nothing_judged_again(monkeypatch):
    monkeypatch.setattr(_procedure, "is_exhausted", lambda base, stage: False)
    beside, names = (
        ("sensor_nonlinearity", "electrostriction"),
        ("sensor_nonlinearity", "drive_lag"),
    )
    assert reconsidered(names, beside, monkeypatch) == list(names)
    idle = ("slew_rate_limit", "electrostriction", "drive_lag")
    assert reconsidered(idle, beside, monkeypatch) == ["electrostriction", "drive_lag"]


@pytest.mark.parametrize(("rmse", "stays"), [(2.2, True), (1.8, False)])
def test_what_was_first_adopted_stays_where_the_better_fit_foretells_worse(
    rmse, stays, monkeypatch
):
    def predict(solved: Any, _: Any) -> Any:
        squares = any(name.endswith(".q") for name in named_parameters(solved.block))
        return SimpleNamespace(rmse=rmse if squares else 1.0)

    names, beside = (
        ("sensor_nonlinearity", "drive_lag"),
        ("sensor_nonlinearity", "electrostriction"),
    )
    found, _ = judged_again(names, beside, monkeypatch, predict)
    assert found == (list(names) if stays else ["drive_lag", "electrostriction"])


@pytest.mark.parametrize(("needed", "grid"), [(1, 1), (4, 4)])
def test_what_is_judged_again_runs_on_the_grid_that_it_needs_itself(needed, grid, monkeypatch):
    """Plays before a fractional law may have asked for one thirty times as fine."""
    grids = []

    def judge(_: Any, less: Stage, *__: Any) -> list[Judged]:
        grids.append(less.preparation.oversampling)
        return []

    def fine_enough(solved: Any, preparation: Any, *_: Any) -> tuple[Any, Any, float]:
        assert preparation.oversampling == 1
        return solved, preparation.with_oversampling(needed), 0.0

    monkeypatch.setattr(_procedure, "scored", lambda *_: [])
    monkeypatch.setattr(_procedure, "residual_of", lambda *_: None)
    monkeypatch.setattr(_procedure, "judge", judge)
    monkeypatch.setattr(_procedure, "fine_enough", fine_enough)
    names = ("electrostriction", "drive_lag")
    with jax.enable_x64(True):
        base, stage = stage_of(()), stage_of(names)
        base = replace(base, preparation=base.preparation.with_oversampling(1))
        stage = replace(stage, preparation=stage.preparation.with_oversampling(8))
        rounds = [_procedure.Round(judged(base, name), []) for name in names]
        _procedure._reconsidered(base, stage, rounds, predict_stretches, 0, silent)
    assert grids == [grid]


def test_what_was_adopted_beside_one_that_has_given_way_is_judged_again(monkeypatch):
    beside = ("electrostriction", "drive_lag")
    found = reconsidered(("sensor_nonlinearity", "resonance"), beside, monkeypatch)
    assert found == ["electrostriction", "drive_lag"]


def test_what_is_small_beside_the_right_effect_goes_too_but_is_told(monkeypatch):
    """It was judged beside what stood in for that, which had left it more to do."""
    monkeypatch.setattr(
        _procedure, "_is_worth_naming", lambda base, stage, winner: winner.name != "drive_lag"
    )
    names, beside = ("sensor_nonlinearity", "drive_lag"), ("electrostriction", "drive_lag")
    assert judged_again(names, beside, monkeypatch) == (["electrostriction"], "drive_lag")


@pytest.mark.parametrize(("ahead", "named"), [(11.0, ["first", "second"]), (9.0, ["other"])])
def test_one_effect_is_preferred_to_two_that_do_no_more(ahead, named, monkeypatch):
    """The first to be adopted, ahead by little, may have needed the second to do what one does."""
    base = stage_of(())

    def at(name: str, cost: float, free: int) -> Judged:
        found = judged(base, "electrostriction")
        solved = replace(found.solved, cost=cost, free=found.solved.free + free)
        gained = base.solved.bic - solved.bic
        effect = replace(found.layer.effect, name=name)
        score: Any = SimpleNamespace(effect=effect, trials=[found.layer.trial], best=0)
        return replace(found, refit=Refit(score, solved), delta_bic=gained, altogether=gained)

    pair = 550.0
    alone = pair + ahead + float(np.log(base.solved.samples))
    first, other, second = at("first", 570.0, 0), at("other", alone, 0), at("second", pair, 1)
    monkeypatch.setattr(
        _procedure,
        "judge",
        lambda base, stage, *_: [first, other] if not stage.layers else [second],
    )
    monkeypatch.setattr(_procedure, "best_of", lambda found: found[0] if found else None)
    seen: Any = SimpleNamespace(least=0.0, scores=[], height=1e3)
    rest: Any = SimpleNamespace(least=1.0, scores=[])
    monkeypatch.setattr(
        _procedure, "detect", lambda stage, *_: seen if len(stage.layers) < 2 else rest
    )
    monkeypatch.setattr(_procedure, "_is_worth_naming", lambda *_: True)
    monkeypatch.setattr(
        _procedure, "_reconsidered", lambda b, stage, rounds, *_: (stage, rounds, None)
    )
    course = _procedure.run(base, 0.0, predict_stretches, 0, silent)
    assert [round_.winner.name for round_ in course.rounds] == named
    assert list(course.stage.adopted) == named
    assert course.opening == [first, other]


def test_the_right_effects_stay_and_an_idle_one_goes(monkeypatch):
    beside = ("sensor_nonlinearity", "electrostriction")
    assert reconsidered(("electrostriction", "drive_lag"), beside, monkeypatch) == [
        "electrostriction",
        "drive_lag",
    ]
    idle = ("slew_rate_limit", "electrostriction", "drive_lag")
    assert reconsidered(idle, beside, monkeypatch) == ["electrostriction", "drive_lag"]


def test_look_alikes_that_the_catalogue_knows_are_refitted_too():
    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(effect=EFFECTS[name], promised=z**2)

    with jax.enable_x64(True):
        best = judged(stage_of(()), "drive_lag")
    scores = [scored("delay", 9.0), scored("creep", 2.0), scored("saturation", 9.0)]
    scores.append(scored("drive_lag", 9.0))
    missed = _round._look_alikes_missed([best], scores)
    assert [score.effect.name for score in missed] == ["delay"]
    assert _round._look_alikes_missed([], scores) == []


@pytest.mark.parametrize(
    ("explained", "plausible", "asked"),
    [(0.6, True, []), (0.4, True, ["delay", "creep"]), (0.6, False, ["delay", "creep"])],
)
def test_where_nothing_that_may_be_named_explains_half_every_other_promising_effect_is_refitted(
    explained, plausible, asked
):
    """A drift that the base had absorbed scored less than ten others, and none explained it."""

    def scored(name: str, z: float) -> Any:
        return SimpleNamespace(effect=EFFECTS[name], promised=z**2, log_evidence=z)

    best = replace(fine_judged("saturation", 1000, plausible), explained=explained)
    scores = [scored("saturation", 9.0), scored("creep", 3.5), scored("delay", 4.0)]
    scores.append(scored("backlash", 2.0))
    passed_over = _round._passed_over([best], scores, 20.0)
    assert [score.effect.name for score in passed_over] == asked


@pytest.mark.parametrize(
    ("height", "numerics", "is_looked_into"),
    [(6.0, 0.9, True), (6.0, 1.1, False), (100.0, 9.0, True), (100.0, 11.0, False)],
)
def test_only_a_mismatch_far_beyond_the_numerical_error_is_looked_into(
    height, numerics, is_looked_into, monkeypatch
):
    asked = []
    scored: Any = [SimpleNamespace(height=height), SimpleNamespace(height=1.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], 1e-9))
    monkeypatch.setattr(_procedure, "judge", lambda *_: asked.append(True) or [])
    unused: Any = None
    with jax.enable_x64(True):
        course = _procedure.run(stage_of(()), numerics, unused, 0, silent)
    assert bool(asked) is is_looked_into
    assert course.rounds == []


@pytest.mark.parametrize(("apart", "fall"), [(3.9, 400.0), (4.1, 4.1**2)])
def test_a_recording_that_does_not_show_the_effect_leaves_it_to_stretches(apart, fall, monkeypatch):
    """Predictions of another recording that lie so many noises apart, and of stretches 20."""
    fold, certain = np.arange(500) % 5, np.zeros((500, 0))
    noise = np.random.default_rng(1).standard_normal(500)

    def predicting(apart: float) -> Predict:
        wrong = np.roll(noise, 50)
        wrong -= noise * (wrong @ noise) / (noise @ noise)
        wrong *= apart / np.linalg.norm(wrong)

        def predict(solved, _):
            error = noise + wrong if solved is base.solved else noise
            return Prediction(1.0, (1.0,) * 5, error, fold, certain)

        return predict

    with jax.enable_x64(True):
        base = stage_of(())
        refit = judged(base, "drive_lag").refit
        stretches = predicting(20.0)
        monkeypatch.setattr(_round, "predict_stretches", stretches)

        def before(predict: Predict) -> Prediction:
            return predict(base.solved, base.preparation)

        question = _round._Question(base, base, refit, before, predicting(apart))
        found = question.answered(refit.solved, base.preparation, 0.0)
    assert found.gain.fall == pytest.approx(fall)
    assert (found.predict is stretches) == (apart < 4)


@pytest.mark.parametrize(
    ("explained", "left", "silent"),
    [
        ((1.0, 0.5), (9.0, 1.0), True),
        ((1.0, 0.95), (9.0, 1.9), False),
        ((0.8, 0.5), (9.0, 9.0), False),
    ],
)
def test_a_recording_that_no_fit_foretells_which_explains_the_training_says_nothing(
    explained, left, silent, monkeypatch
):
    """χ² per sample of 9 held out beside 1 in training: the base's own law is open there."""
    monkeypatch.setattr(_round, "predict_stretches", lambda *_: "stretches")
    monkeypatch.setattr(
        _round, "gain", lambda _, told: replace(answer(1.0).gain, fall=float(told == "stretches"))
    )
    monkeypatch.setattr(_round, "foretells_worse", lambda predict, *_: predict is recording)
    for name in ("explained_fraction", "spared", "delta_bic"):
        monkeypatch.setattr(_round, name, lambda *_: 1.0)
    monkeypatch.setattr(_round, "is_plausible", lambda *_: True)
    score: Any = SimpleNamespace(effect=None, trials=[None], best=0)
    solved: Any = SimpleNamespace(cost=100.0, samples=100, left=1.0)
    attempt = Refit(score, solved)

    def recording(*_: Any) -> Any:
        return "recording"

    def answer(left: float, explained: float = 1.0) -> Judged:
        gain = Gain(-5.0, 9.0, 0.0, foretold=(True,), base_rmse=1.0, extended_rmse=1.0, left=left)
        return replace(JUDGED, refit=attempt, explained=explained, gain=gain, foretells_worse=True)

    stage: Any = SimpleNamespace(solved=None)
    question = _round._Question(stage, stage, attempt, lambda predict: recording(), recording)
    found = [(question, answer(at, of)) for at, of in zip(left, explained, strict=True)]
    told = _round._told_by_stretches(found)
    assert [j.gain.fall for _, j in told] == [1.0 if silent else -5.0] * 2
    # That it is foretold worse still counts.
    assert all(j.foretells_worse for _, j in told)


@pytest.mark.parametrize(("loss", "inside"), [(5.0, True), (20.0, False)])
def test_an_optimum_in_a_flat_valley_does_not_speak_against_an_effect(loss, inside, monkeypatch):
    """The nearest fit within the usual ranges counts where it loses no more than 10 in χ²."""
    with jax.enable_x64(True):
        stage = stage_of(())
        attempt = judged(stage, "drive_lag").refit
        usual = named_parameters(attempt.solved.block)["first.time_constant"].plausible
        far = set_values(attempt.solved.block, {"first.time_constant": 3.0 * float(usual[1])})
        solved = SimpleNamespace(block=far, cost=100.0)

    def near(starts, preparation, hopeless):
        assert hopeless == 110.0
        for start in starts:
            assert named_parameters(start)["first.time_constant"].is_plausible
        return SimpleNamespace(block=starts[0], cost=100.0 + loss)

    monkeypatch.setattr(_refit, "solve_from", near)
    given: Any = solved
    found = within_usual_ranges(Refit(attempt.score, given), stage, 10.0)
    kept = named_parameters(found.solved.block)["first.time_constant"]
    assert kept.is_plausible == inside


def test_a_refit_also_starts_from_what_was_found_before_and_a_law_of_fewer_numbers_from_its_own(
    monkeypatch,
):
    begun: list[Any] = []

    def solve(starts: list[Any], *_: Any) -> Any:
        begun.append(starts)
        return SimpleNamespace(
            block=starts[0], cost=-float(len(begun)), left=1.0, free=1, samples=9
        )

    monkeypatch.setattr(_refit, "solve_from", solve)
    effect = EFFECTS["minor_loop_memory"]
    with jax.enable_x64(True):
        stage = stage_of(())
        trials = list(effect.trials(stage.preparation.setting))
        count = len(trials)
        score = EffectScore(
            effect=effect, trials=trials, z=np.ones(count), norms=np.ones(count),
            concealments=np.zeros(count), sizes=np.ones(count), directions=np.eye(count),
            families=_families(trials),
        )  # fmt: skip
        inside = set_values(stage.solved.block, {"delta": 0.4})
        earlier = effect.insert(inside, trials[0])
        _refit.refit(score, stage, [stage.solved.block], 0, np.inf, [earlier])
    kinds = [{kind_of(start) for start in starts} for starts in begun]
    assert all(len(kind) == 1 for kind in kinds)
    assert len(set.union(*kinds)) == 4  # two sites, twelve thresholds or six
    assert begun[0][0] is earlier
    of_six = [starts for starts in begun if len(starts) == 1]
    assert len(of_six) == 2
    assert named_parameters(of_six[0][0])["first.delta"].value == 0.4


@pytest.mark.parametrize(("stuck", "better"), [(50.0, True), (0.0, False)])
def test_more_starts_leave_a_basin_and_keep_what_they_cannot_better(stuck, better):
    with jax.enable_x64(True):
        stage = stage_of(())
        attempt = judged(stage, "drive_lag").refit
        best = attempt.solved
        early = replace(attempt, solved=replace(best, cost=best.cost + stuck))
        found = sought_further(early, stage, 0)
    assert (found is not early) is better
    assert found.solved.cost == pytest.approx(best.cost, abs=1.0)


@pytest.mark.parametrize(
    ("left", "rivals", "asked"),
    [(1.05, [], []), (1.05, ["c", "f"], ["b", "c", "f"]), (1.5, ["c"], ["a", "b", "c", "d"])],
)
def test_those_on_whose_order_the_name_depends_are_sought_further(left, rivals, asked, monkeypatch):
    """Those that gain most where the best leaves more than noise, else the best and its rivals.  Of
    a thousand samples the power of the noise is known to .13 (three standard errors)."""
    gains = {"b": 300.0, "a": 400.0, "e": 50.0, "d": 100.0, "c": 200.0, "f": 5.0}
    answers = {
        name: SimpleNamespace(
            name=name, delta_bic=gain, preparation=known(), solved=cost_of(1000 * left, -gain)
        )
        for name, gain in gains.items()
    }
    found: list[Any] = [
        (SimpleNamespace(attempt=name, stage=None), answer) for name, answer in answers.items()
    ]
    tried: list[Any] = []

    def sought(attempt: Any, *_: Any) -> Any:
        tried.append(attempt)
        return attempt

    monkeypatch.setattr(_round, "sought_further", sought)
    monkeypatch.setattr(_round, "best_of", lambda _: answers["b"])
    monkeypatch.setattr(_round, "rivals_of", lambda *_: [answers[name] for name in rivals])
    before: Any = cost_of(5000.0)
    assert _round._sought_further(before, found, 0, silent) == found
    assert tried == asked


@pytest.mark.parametrize(
    ("p_value", "displaced", "layers", "hidden"),
    [(0.5, ["delta"], (), 0.002), (0.5, [], (), 1.0), (0.001, ["delta"], (), 1.0),
     (0.5, ["delta"], ("creep",), 1.0)],
)  # fmt: skip
def test_a_fit_outside_its_usual_ranges_is_also_seen_from_within(
    p_value, displaced, layers, hidden, monkeypatch
):
    """Where it shows nothing, and before an effect is adopted; counted as a second look."""
    solved = SimpleNamespace(kurtosis=3.0, blocks=())
    stage: Any = SimpleNamespace(
        name="lfdh", solved=solved, undisplaced="within", displaced=displaced, layers=layers,
        preparation=SimpleNamespace(problems=tuple),
    )  # fmt: skip
    monkeypatch.setattr(_detect, "residual_of", lambda *_: None)
    monkeypatch.setattr(_detect, "locate", lambda *_: [])
    monkeypatch.setattr(_detect, "freedom_of", lambda *_: 100.0)
    monkeypatch.setattr(_detect, "scored", lambda stage, solved, residual: solved)
    monkeypatch.setattr(
        _detect, "family_wise_p", lambda scores, *_: 0.001 if scores == "within" else p_value
    )
    found = _detect.detect(stage, 0, lambda message: None)
    assert (found.p_value, found.hidden) == (p_value, hidden)
    assert found.least == min(p_value, hidden)


def cost_of(cost: float, bic: float = 0.0) -> Any:
    left = max(1.0, cost / 1000)
    return SimpleNamespace(cost=cost, samples=1000, left=left, kurtosis=3.0, bic=bic)


def known() -> Any:
    """Recordings of a noise without doubt."""
    noise = SimpleNamespace(doubt=lambda _: 0.0)
    return SimpleNamespace(takes=[SimpleNamespace(noise=noise)])


def worth_naming(
    base: Any, stage: Any, winner: Any, gained: float = 0.0, name: str = "creep"
) -> bool:
    """Whether an effect is worth naming that gains so much of 1000 in χ² on data held out."""
    winner.layer = SimpleNamespace(effect=fj.EFFECTS[name])
    winner.gain, winner.prediction = SimpleNamespace(fall=gained), 1000.0
    winner.predict = lambda *_: None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_procedure, "gain", lambda _, fall: SimpleNamespace(fall=fall))
        return _procedure._is_worth_naming(base, stage, winner)


def stages(cost: float, *adopted: str) -> tuple[Any, Any]:
    """A base with 1000 in χ² beyond the noise of 1000 samples, and a stage with effects."""
    layers = [SimpleNamespace(effect=fj.EFFECTS[name]) for name in adopted]
    base = SimpleNamespace(solved=cost_of(2000.0), excess=1000.0, layers=(), preparation=known())
    stage = SimpleNamespace(
        solved=cost_of(cost), excess=cost - 1000, layers=layers, preparation=known()
    )
    return base, stage


@pytest.mark.parametrize(
    ("before", "after", "worth"),
    [
        (1800.0, 1790.0, True),  # what is left is more than the noise: another is looked for
        (1350.0, 1325.0, True),  # what is left is under the noise: a fiftieth is asked
        (1350.0, 1335.0, False),
    ],
)
def test_a_further_effect_takes_a_share_that_counts(before, after, worth):
    winner: Any = SimpleNamespace(solved=cost_of(after), preparation=known())
    assert worth_naming(*stages(before, "creep"), winner) == worth


@pytest.mark.parametrize(
    ("adopted", "name", "worth"),
    [("creep", "mains_interference", True), ("creep", "thermal_drift", False),
     ("mains_interference", "thermal_drift", True)],
)  # fmt: skip
def test_lines_of_the_mains_and_other_laws_do_not_imitate_each_other(adopted, name, worth):
    winner: Any = SimpleNamespace(solved=cost_of(1335.0), preparation=known())
    assert worth_naming(*stages(1350.0, adopted), winner, name=name) == worth


@pytest.mark.parametrize(("gained", "worth"), [(25.0, True), (15.0, False)])
def test_a_further_effect_may_take_its_share_of_data_held_out(gained, worth):
    """Of 1000 in χ² that both effects together gain there."""
    winner: Any = SimpleNamespace(solved=cost_of(1295.0), preparation=known())
    assert worth_naming(*stages(1300.0, "creep"), winner, gained) == worth


def test_what_a_later_effect_makes_superfluous_is_found():
    stage = stage_of(("delay", "electrostriction", "drive_lag"))
    found = _procedure._superfluous(stage, silent)
    assert found is not None
    dropped, less = found
    assert dropped == 0
    assert less.adopted == ("electrostriction", "drive_lag")
    assert less.solved.bic < stage.solved.bic
    assert _procedure._superfluous(less, silent) is None


def test_what_a_refit_gains_where_each_noise_is_what_it_leaves_itself(monkeypatch):
    """-2 ln of the likelihood falls by 2 N ln of the noise's, and each number costs ln n."""

    def noise(sigma: float, square: float = 1.0) -> Any:
        return SimpleNamespace(
            is_leftover=True,
            innovation=sigma,
            sigma=sigma,
            method="residual",
            whitened_square=square,
        )

    take = SimpleNamespace(
        noise=noise(2.0),
        recording=SimpleNamespace(response=np.zeros(100)),
        used=np.arange(100) >= 20,
    )
    preparation = SimpleNamespace(takes=[take], with_noises=lambda noises: noises)
    of_base = SimpleNamespace(free=5, simulations=[np.zeros(100)])
    base: Any = SimpleNamespace(solved=of_base, preparation=preparation)
    solved: Any = SimpleNamespace(free=8, samples=80, simulations=[np.zeros(100)])
    for left, gained in ((1.0, 160 * np.log(2) - 3 * np.log(80)), (2.0, -3 * np.log(80))):
        monkeypatch.setattr(_procedure, "residual_noise", lambda *_, left=left: noise(left))
        found, seen = _procedure._seen_past(base, solved)
        noises: Any = seen
        assert found == pytest.approx(gained)
        assert [n.sigma for n in noises] == [left]
    monkeypatch.setattr(_procedure, "residual_noise", lambda *_: noise(2.5))
    assert _procedure._seen_past(base, solved) == (-np.inf, preparation)
    # A line that no filter holds is in no innovation, and costs its whitened squares.
    monkeypatch.setattr(_procedure, "residual_noise", lambda *_: noise(2.0))
    take.noise = noise(2.0, square=4.0)
    assert _procedure._seen_past(base, solved)[0] == pytest.approx(80 * 3 - 3 * np.log(80))


def test_of_a_specified_noise_a_better_fit_tells_the_colour(monkeypatch):
    """Its size stays; what it gains is what the residual's own innovation has lost."""
    white = fj.Noise(0.5, "um", "specification", np.ones(1), 0.5, is_leftover=True)
    left = {0.0: replace(white, sigma=2.0, innovation=2.0, method="residual")}
    left[1.0] = replace(left[0.0], sigma=0.5, innovation=0.4, filter=np.array([1.0, -0.6]))
    monkeypatch.setattr(_procedure, "residual_noise", lambda left_over, *_: left[-left_over[0]])
    take = SimpleNamespace(
        noise=white, recording=SimpleNamespace(response=np.zeros(100)), used=np.ones(100, bool)
    )
    preparation = SimpleNamespace(takes=[take], with_noises=lambda noises: noises)
    of_base = SimpleNamespace(free=5, simulations=[np.zeros(100)])
    base: Any = SimpleNamespace(solved=of_base, preparation=preparation)
    solved: Any = SimpleNamespace(free=5, samples=100, simulations=[np.ones(100)])
    found, noises = _procedure._seen_past(base, solved)
    assert found == pytest.approx(200 * np.log(2.0 / 0.4))
    (seen,) = noises  # type: ignore[misc]
    assert (seen.sigma, seen.method) == (0.5, "specification")
    assert seen.innovation == pytest.approx(0.4)
    assert seen.filter.tolist() == [1.0, -0.6]
    # Where even that leaves more than the noise, nothing of the colour is known.
    left[1.0] = replace(left[1.0], sigma=0.6)
    assert _procedure._seen_past(base, solved) == (-np.inf, preparation)


def opened(disturbance: np.ndarray, rests: bool = True) -> tuple[Stage, _procedure.Course]:
    """LFDH, fitted to itself with a disturbance [share of the response], the last quarter of the
    drive a rest, or none; and a course on which nothing was refitted."""
    drive = np.where(TIMES < 2.25, DRIVE, DRIVE[450]) if rests else DRIVE
    response = fj.simulate("lfdh", drive, STEP, "constant").response
    response = response + np.ptp(response) * disturbance
    preparation = prepare([fj.Recording(drive, response, STEP, "V", "um")], history="constant")
    block = fj.parse_model("lfdh", preparation.setting).block
    with jax.enable_x64(True):
        solved = solve_from([block], preparation)
        (take,) = preparation.takes
        if take.noise is None:
            left = residual_noise(response - solved.simulations[0], take.used, take.recording)
            preparation = preparation.with_noises([left])
            solved = solve_from([block], preparation)
        base = Stage("lfdh", block, (), solved, preparation)
        seen = _detect.detect(base, 0, silent)
    return base, _procedure.Course(seen, True, [], seen, [], {}, base, None)


def test_where_no_effect_gains_anything_noise_may_be_larger_outside_a_rest():
    louder = NOISE * np.where(TIMES < 2.25, 2.0, 1.0)
    base, course = opened(louder)
    (told,) = [take.noise for take in base.preparation.takes]
    assert told is not None
    assert told.method == "static"
    assert course.first.least < SIGNIFICANCE
    with jax.enable_x64(True):
        explained = _procedure.explained_by_noise(base, course, 0, silent)
        assert explained is not None
        again, quiet = explained
        assert quiet.first.least >= SIGNIFICANCE
        (followed,) = [take.noise for take in again.preparation.takes]
        assert followed is not None
        ratio = followed.sigma / told.sigma
        assert np.std(louder) / np.std(NOISE[TIMES > 2.25]) == pytest.approx(ratio, rel=0.2)
        # An effect that would have been an improvement is no noise.
        gaining = replace(course, judged={"a": fine_judged("a", 20.0, True)})
        assert _procedure.explained_by_noise(base, gaining, 0, silent) is None
        # What is smooth from sample to sample is none either.
        wave = 0.006 * np.sin(9 * TIMES + TIMES**2) * (TIMES < 2.25)
        assert _procedure.explained_by_noise(*opened(NOISE + wave), 0, silent) is None


def test_a_noise_that_a_fit_left_over_may_vary_along_the_recording():
    louder = NOISE * np.where(TIMES < 1.5, 0.5, 2.0)
    base, course = opened(louder, rests=False)
    # A loud stretch that by chance is tilted: sure, were it of the noise's average size.
    course = replace(course, first=replace(course.first, p_value=1e-5))
    with jax.enable_x64(True):
        explained = _procedure.explained_by_noise(base, course, 0, silent)
        assert explained is not None
        (followed,) = [take.noise for take in explained[0].preparation.takes]
        assert followed is not None
        sizes = followed.course[1]
        assert sizes[-3:].mean() == pytest.approx(4 * sizes[:3].mean(), rel=0.25)
        wave = 0.006 * np.sin(9 * TIMES + TIMES**2) * (TIMES < 2.25)
        assert _procedure.explained_by_noise(*opened(NOISE + wave, False), 0, silent) is None


def fine_judged(name: str, gained: float, plausible: bool, left: float = 1.0) -> Judged:
    solved = SimpleNamespace(gained=gained, bic=-gained * left, cost=-gained * left, samples=0.0)
    layer = SimpleNamespace(effect=SimpleNamespace(name=name, special_case=""))
    refit: Any = SimpleNamespace(name=name, solved=solved, layer=layer)
    return replace(JUDGED, refit=refit, delta_bic=gained, altogether=gained, plausible=plausible)


def refined_contenders(
    found: list[Judged],
    finer: dict[str, float],
    monkeypatch,
    alike: str = "",
    beside: dict[str, float] | None = None,
) -> tuple[list[str], list[Judged]]:
    """Who was judged on a finer grid, in order, and all as they are judged then; `finer` holds what
    some gain there, and those `alike` are look-alikes of each other, which gain what `beside` says
    where another ended."""
    asked = []

    def judged_finer(name: str, gained: float) -> Judged:
        return fine_judged(name, finer.get(name, gained), plausible=True)

    def refined(_: Any, judged: Any, __: Any) -> Judged:
        asked.append(judged.name)
        return judged_finer(judged.name, judged.solved.gained)

    def sought_beside(
        _: Any, name: Any, answer: Judged, __: int, *, anew: bool
    ) -> tuple[Any, Judged] | None:
        asked.append(f"{name} {'anew' if anew else 'beside'}")
        found = fine_judged(name, (beside or {}).get(name, 0.0), plausible=True)
        return (name, found) if found.delta_bic > answer.delta_bic else None

    monkeypatch.setattr(_round, "_refined", refined)
    monkeypatch.setattr(_round, "_sought_beside", sought_beside)
    pairs = [(one, other) for one in alike for other in alike if one != other]
    monkeypatch.setattr(_round, "_look_alike", lambda one, other: (one.name, other.name) in pairs)
    questions: Any = [(judged.name, judged) for judged in found]
    before: Any = SimpleNamespace(bic=0.0)
    return asked, _round._contenders_refined(before, questions, 0, silent)


@pytest.mark.parametrize(
    ("first", "second", "refined"), [(100, 60, "ab"), (100, 40, "a"), (8, 6, "")]
)
def test_a_fit_that_only_the_grid_makes_implausible_is_refined(first, second, refined, monkeypatch):
    """Nothing is admissible, yet the grid of those that gain most is checked: a mode on a coarse
    one is damped by it, and ends at the bound of its own damping."""
    gained = {"a": first, "b": second, "c": 3}
    found = [fine_judged(name, gain, plausible=False) for name, gain in gained.items()]
    asked, judged = refined_contenders(found, {}, monkeypatch)
    assert asked == list(refined)
    assert [j.name for j in judged if j.plausible] == list(refined)


@pytest.mark.parametrize(("second", "best"), [(930, "b"), (850, "a")])
def test_what_gains_nearly_as_much_is_judged_on_a_fine_grid_too(second, best, monkeypatch):
    """Beyond any margin, yet only since its grid was left coarse: a mode there rings at another
    frequency, and two modes whose grid was refined fitted better."""
    gained = {"a": 1000, "b": second, "c": 700}
    found = [fine_judged(name, gain, plausible=True) for name, gain in gained.items()]
    asked, judged = refined_contenders(found, {"b": 1100}, monkeypatch)
    winner = best_of(judged)
    assert winner is not None
    assert winner.name == best
    assert asked == (["a", "b"] if best == "b" else ["a"])


@pytest.mark.parametrize(("on_the_finer", "best"), [(1130, "b"), (900, "a")])
def test_look_alikes_of_what_a_fine_grid_helps_are_sought_there_anew(
    on_the_finer, best, monkeypatch
):
    """On the coarse one a resonance had ended far off, and a second mode took its name."""
    gained = {"a": 1000, "b": 300, "c": 300}
    found = [fine_judged(name, gain, plausible=True) for name, gain in gained.items()]
    beside = {"b": on_the_finer}
    asked, judged = refined_contenders(found, {"a": 1100}, monkeypatch, "ab", beside)
    winner = best_of(judged)
    assert winner is not None
    assert winner.name == best
    assert asked == ["a", "b anew", *(["b", "a beside"] if best == "b" else [])]
    # Where the grid makes little difference, they begin from where the best ended, and no more.
    for little in (1005, 1050):
        assert refined_contenders(found, {"a": little}, monkeypatch, "ab")[0] == ["a", "b beside"]


def test_a_look_alike_whose_grid_was_fine_enough_where_it_stood_is_sought_again(monkeypatch):
    """A resonance stood far off, where a coarse grid does; two modes were found on a fine one."""
    found = [fine_judged("a", 950, plausible=True), fine_judged("b", 1000, plausible=True)]
    asked, judged = refined_contenders(found, {"b": 1400}, monkeypatch, "ab", {"a": 1420})
    assert asked == ["a", "b", "a anew", "a", "b beside"]
    winner = best_of(judged)
    assert winner is not None
    assert winner.name == "a"


def test_a_look_alike_begins_with_the_numbers_that_the_two_laws_share():
    """One mode begins where the first of two has been found, round the base beside them."""
    with jax.enable_x64(True):
        stage = stage_of(())
        two, one = (EFFECTS[name] for name in ("second_mode", "resonance"))
        trial = two.trials(stage.preparation.setting)[0]
        block = two.insert(stage.solved.block, set_values(trial, {"damping": 2.0}))
        block = set_values(block, {"first.mu": 0.123, "second.frequency": 77.0})
        scores: Any = [
            SimpleNamespace(effect=e, trials=e.trials(stage.preparation.setting), best=0)
            for e in (two, one)
        ]
        other = Refit(scores[0], replace(stage.solved, block=block))
        (start,) = begun_from(other, scores[1])
        begun = named_parameters(start)
        around = begun_from(Refit(scores[1], replace(stage.solved, block=start)), scores[0])
    assert float(begun["second.frequency"].value) == 77.0
    assert float(begun["first.mu"].value) == 0.123
    # Within its own bounds.
    assert float(begun["second.damping"].value) == 1.0
    assert not any("ratio" in name for name in begun)
    # And where one was found, it is the lower of two or the upper.
    for block in around:
        two_modes = {name: float(p.value) for name, p in named_parameters(block.second).items()}
        modes = two_modes["frequency"] * np.array([1.0, two_modes["ratio"]])
        assert np.isclose(modes, 77.0).any()
        assert two_modes["damping"] == 1.0
    assert len(around) > 1
    # A mode at its lower bound is found on records that are too slow for any.
    slowest = set_values(trial, {"frequency": 0.1})
    assert all(block.frequency.value == 0.1 for block in two.beyond(slowest))


@pytest.mark.parametrize(("guessed", "asked"), [(True, [0.0]), (False, [])])
def test_where_only_a_fit_tells_the_noise_refits_are_asked_though_nothing_shows(
    guessed, asked, monkeypatch
):
    """Seen against itself a mismatch is no larger than its noise."""
    found, least = [fine_judged("a", 100.0, plausible=True)], []

    def judge(*_: Any, **asked: Any) -> list[Judged]:
        least.append(asked["least"])
        return found

    scored: Any = [SimpleNamespace(height=2.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], 0.5))
    monkeypatch.setattr(_procedure, "judge", judge)
    with jax.enable_x64(True):
        stage = stage_of(())
        (take,) = stage.preparation.takes
        assert take.noise is not None
        noise = replace(take.noise, is_leftover=guessed)
        stage = replace(stage, preparation=stage.preparation.with_noises([noise]))
        course = _procedure.run(stage, 0.0, NOTHING, 0, silent)
    assert least == asked
    assert course.rounds == []
    assert course.opening == (found if guessed else [])
    assert list(course.judged) == (["a"] if guessed else [])


@pytest.mark.parametrize(
    ("guessed", "may", "rounds"), [(True, True, 0), (True, False, 1), (False, True, 1)]
)
def test_a_noise_that_hid_behind_the_mismatch_is_read_before_the_rounds_go_on(
    guessed, may, rounds, monkeypatch
):
    seen = iter([SIGNIFICANCE / 2, 0.5])
    scored: Any = [SimpleNamespace(height=2.0)]
    monkeypatch.setattr(_procedure, "detect", lambda *_: _detect.Detection(scored, [], next(seen)))
    with jax.enable_x64(True):
        stage = stage_of(())
        (noise,) = (take.noise for take in stage.preparation.takes if take.noise is not None)
        noise = replace(noise, is_leftover=guessed)
        stage = replace(stage, preparation=stage.preparation.with_noises([noise]))
        less = stage.preparation.with_noises([replace(noise, sigma=0.9 * noise.sigma)])
        monkeypatch.setattr(_procedure, "_seen_past", lambda *_: (20.0, less))
        found = [judged(stage, "drive_lag")]
        monkeypatch.setattr(_procedure, "judge", lambda *_, **__: found)
        course = _procedure.run(stage, 0.0, NOTHING, 0, silent, may_read_again=may)
        clearer = _procedure.with_noise_beyond_mismatch(stage, course)
    assert len(course.rounds) == rounds
    # Whoever asked for it early finds it.
    assert (clearer is not None) == guessed


def test_a_refined_candidate_keeps_to_its_usual_ranges_on_its_own_grid(monkeypatch):
    """Of two modes one left them there for nothing, and was excluded for it."""

    @dataclass(frozen=True)
    class Question:
        attempt: Any
        stage: Any

        def answered(self, solved: Any, preparation: Any, numerics: float) -> Any:
            return solved, preparation, numerics, self.attempt.conceded

    @dataclass(frozen=True)
    class Part:
        solved: Any = None
        preparation: Any = None
        conceded: float = 0.0

    def kept_usual(attempt: Any, stage: Any) -> Any:
        assert (attempt.solved, stage.preparation) == ("out+", "fine+")
        return Part("in", conceded=3.0)

    monkeypatch.setattr(
        _round, "fine_enough", lambda solved, grid, *_: (f"{solved}+", f"{grid}+", 0.1)
    )
    monkeypatch.setattr(_round, "_kept_usual", kept_usual)
    question: Any = Question(Part("out"), Part(preparation="coarse"))
    coarse: Any = Part("out", "fine")
    assert _round._refined(question, coarse, silent) == ("in+", "fine++", 0.1, 3.0)
    monkeypatch.setattr(_round, "_kept_usual", lambda attempt, _: attempt)
    assert _round._refined(question, coarse, silent) == ("out+", "fine+", 0.1, 0.0)


@pytest.mark.parametrize(("left", "asked"), [(1.1, ["a", "b"]), (1.0, ["a"])])
def test_what_a_coarse_grid_leaves_over_does_not_count_twice(left, asked, monkeypatch):
    """A mode gained less by it, and that again was divided by what it left: two modes won."""
    found = [fine_judged("a", 1000, plausible=True), fine_judged("b", 850, True, left)]
    assert refined_contenders(found, {"b": 1100}, monkeypatch)[0] == asked


def test_what_is_read_from_a_recording_foretells_nothing_of_it():
    """A drift begins anew with every recording, and follows whatever is slow in that."""
    with jax.enable_x64(True):
        stage = stage_of(())
        told = [
            judged(stage, n).foretells_a_recording for n in ("electrostriction", "thermal_drift")
        ]
    assert told == [True, False]
