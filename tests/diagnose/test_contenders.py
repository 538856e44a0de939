"""Contenders on finer grids."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from fracjax._diagnose import _round
from fracjax._diagnose._judgement import Judged, best_of
from fracjax._solve import silent
from tests.diagnose.stages import fine_judged


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
    monkeypatch.setattr(_round, "_refitted_from_other", sought_beside)
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


def test_a_refined_candidate_keeps_to_its_usual_ranges_on_its_own_grid(monkeypatch):
    """Of two modes one left them there for nothing, and was excluded for it."""

    @dataclass(frozen=True)
    class Question:
        attempt: Any
        stage: Any

        def answered(self, solved: Any, numerics: float) -> Any:
            return solved.grid, numerics, self.attempt.conceded

    @dataclass(frozen=True)
    class Solution:
        grid: str

        @property
        def preparation(self) -> str:
            return f"of {self.grid}"

    @dataclass(frozen=True)
    class Part:
        solved: Any
        conceded: float = 0.0

        def on(self, preparation: Any) -> Any:
            return preparation

    def kept_usual(attempt: Any, stage: Any) -> Any:
        assert (attempt.solved.grid, stage) == ("out+", "of out+")
        return Part(Solution("in"), conceded=3.0)

    def finer(solved: Any, *_: Any) -> tuple[Any, float]:
        return Solution(f"{solved.grid}+"), 0.1

    monkeypatch.setattr(_round, "refine_until_accurate", finer)
    monkeypatch.setattr(_round, "_kept_usual", kept_usual)
    coarse: Any = Part(Solution("out"))
    question: Any = Question(coarse, coarse)
    assert _round._refined(question, coarse, silent) == ("in+", 0.1, 3.0)
    monkeypatch.setattr(_round, "_kept_usual", lambda attempt, _: attempt)
    assert _round._refined(question, coarse, silent) == ("out+", 0.1, 0.0)


@pytest.mark.parametrize(("left", "asked"), [(1.1, ["a", "b"]), (1.0, ["a"])])
def test_what_a_coarse_grid_leaves_over_does_not_count_twice(left, asked, monkeypatch):
    """A mode gained less by it, and that again was divided by what it left: two modes won."""
    found = [fine_judged("a", 1000, plausible=True), fine_judged("b", 850, True, left)]
    assert refined_contenders(found, {"b": 1100}, monkeypatch)[0] == asked
