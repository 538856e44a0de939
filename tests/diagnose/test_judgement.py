"""Which candidate takes the name, who rivals it, and why."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fracjax._diagnose._evidence import delta_bic
from fracjax._diagnose._judgement import (
    best_of,
    excess_doubt,
    explained_fraction,
    freedom_of,
    probability_of,
    reason,
    residual_has_pattern,
    residual_is_noise,
    rivals_of,
    share_of_excess,
)
from fracjax._diagnose._result import Axis
from tests.diagnose.helpers import CONVINCING, ended_at, judged_of, known_to


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
    wild = judged_of("i", 10_200, predicts_worse=True)
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
        (judged_of("a", 100), 0.02, 0.0, "the residual does not exceed the noise"),
        (judged_of("a", 100), 0.001, 1.5, "not refitted: the discretisation error is 1.5"),
        (None, 0.001, 0.0, "not refitted: other effects have more evidence"),
        (judged_of("a", 100), 0.001, 0.0, "adopted: significantly better"),
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


def test_what_is_left_over_is_judged_as_far_as_the_noise_is_known():
    doubt = 3 * np.sqrt(2 / 1000 + 0.1**2)
    assert excess_doubt(ended_at(0).solved) == pytest.approx(doubt)
    assert freedom_of(known_to(0.1), 3.0) == pytest.approx(200)
    for excess, most in ((0.0, 1.5 + doubt), (4000.0, 1.7 + doubt)):
        base = ended_at(5000, excess)
        assert residual_is_noise(base, ended_at(1000 * most - 1))
        assert not residual_is_noise(base, ended_at(1000 * most + 1))


def test_the_shares_that_an_effect_explains():
    base = ended_at(3000, excess=2000)
    doubt = 1000 * excess_doubt(base.solved)
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
    assert residual_has_pattern(stage_of(2000), stage_of(1000), axes) == left
