"""Inquiries into recordings of a machine: names, sizes and errors; noises; starts that adapt."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import (
    INSIDE,
    CubicStiffness,
    EndStop,
    Oscillator,
    QuadraticDamping,
)
from fracjax._computing import computing
from fracjax._inside import _columns, _inquire, inquire_inside
from fracjax._operators import Grid, refine
from fracjax._parameters import named_parameters, set_values
from fracjax._prepare import prepare
from fracjax._solve import begin
from tests.helpers import specified

COUNT, STEP = 256, 0.02
TRUTH = Oscillator(1.0, 4.0, 0.08) @ CubicStiffness(0.6) @ QuadraticDamping(0.03)


def recorded(curved: float = 0.0) -> fj.Recording:
    """A recording of the truth with noise of .1 %, and of a curve behind it."""
    rng = np.random.default_rng(4)
    drive = 3 * np.convolve(rng.standard_normal(COUNT + 4), np.ones(5) / 5, "valid")
    fine = refine(drive, 16, "rest")
    response = np.asarray(TRUTH(jnp.asarray(fine), Grid(STEP / 16, "rest")))[::16]
    response = response + curved * response**2
    noise = 1e-3 * np.ptp(response) * rng.standard_normal(COUNT)
    return fj.Recording(drive, response + noise, STEP, "V", "um")


def prepared(recording: fj.Recording, noise: fj.Noise | None):
    preparation = prepare([recording], noise=noise, history="rest", settling=0)
    return preparation.with_oversampling(4)


def choose(monkeypatch, *names: str) -> None:
    chosen = {name: INSIDE[name] for name in names}
    monkeypatch.setattr(_inquire, "INSIDE", chosen)
    monkeypatch.setattr(_columns, "INSIDE", chosen)


def test_two_effects_are_named_with_their_sizes_and_their_error(monkeypatch):
    choose(monkeypatch, "cubic_stiffness", "quadratic_damping")
    recording, asked = recorded(), []
    sigma = 1e-3 * float(np.ptp(recording.response))

    def held_out(solved) -> float:
        asked.append(solved)
        return float(len(asked))

    inside = inquire_inside(
        Oscillator(1.0, 3.5, 0.1), prepared(recording, specified(sigma)), held_out
    )
    assert {*inside.names} == {"cubic_stiffness", "quadratic_damping"}
    assert inside.outside == ""
    assert asked == [inside.base, inside.extended]
    assert (inside.base_error, inside.extended_error) == (1.0, 2.0)
    values = [float(effect.stiffness.value) for effect in inside.block.effects
              if isinstance(effect, CubicStiffness)]  # type: ignore[attr-defined]  # fmt: skip
    assert values == [pytest.approx(0.6, rel=0.03)]
    # Without noise in what decides, the extended model leaves what the noise has.
    assert inside.extended.cost == pytest.approx(COUNT, rel=0.35)
    probabilities = [candidate.probability for candidate in inside.candidates]
    assert sum(probabilities) == pytest.approx(1.0)
    assert probabilities == sorted(probabilities, reverse=True)
    assert probabilities[0] > 0.99
    sets = {candidate.names: candidate for candidate in inside.candidates}
    assert () in sets
    assert sets[()].ratio == 1.0
    assert inside.candidates[0].ratio == pytest.approx(inside.extended.cost / inside.base.cost)


def test_what_the_machine_has_is_not_named_and_a_curve_behind_it_is_outside(monkeypatch):
    choose(monkeypatch, "quadratic_stiffness")
    recording = recorded(curved=0.2)
    sigma = 1e-3 * float(np.ptp(recording.response))
    inside = inquire_inside(TRUTH, prepared(recording, specified(sigma)))
    assert inside.names == ()
    assert inside.outside == "response_curve"
    assert inside.extended is inside.base
    assert inside.block.sites == ("spring", "spring")
    assert (inside.base_error, inside.extended_error) == (None, None)


def test_noises_are_white_of_their_levels_and_none_where_one_is_none():
    recording = recorded()
    coloured = fj.Noise(0.02, "um", "specification", np.array([1.0, -0.5]), 0.018)
    take = prepared(recording, coloured).takes[0]
    several = replace(prepared(recording, coloured), takes=(take, take))
    white = _inquire._unweighted(several)
    for one in white.takes:
        assert one.noise is not None
        assert (one.noise.sigma, one.whitening.size) == (0.02, 1)
    mixed = replace(several, takes=(take, replace(take, noise=None)))
    assert [one.noise for one in _inquire._unweighted(mixed).takes] == [None, None]


def test_a_start_adapts_the_machine_with_its_effects_held():
    start = Oscillator(1.0, 3.6, 0.1) @ CubicStiffness(0.5) @ EndStop(30.0, 50.0)
    preparation = prepared(recorded(), specified(0.01))
    with computing():
        descent = begin(start, preparation.problems(), preparation.conditions)
        before = descent.objective.at(descent.position)
        for held, moved in ((0, []), (1, ["effects.0.stiffness"])):
            adapted = _inquire._adapted(descent, start, held)
            after = descent.objective.at(adapted.position)
            assert after.cost < 0.9 * before.cost
            names = (
                "machine.frequency",
                "effects.0.stiffness",
                "effects.1.stiffness",
                "effects.1.gap",
            )
            values = [[parameter_of(at.blocks[0], n) for n in names] for at in (before, after)]
            changed = [n for n, one, other in zip(names, *values, strict=True) if one != other]
            assert changed == ["machine.frequency", *moved]
        # With nothing to hold, or all, there is nothing to adapt to.
        assert _inquire._adapted(descent, start, 2) is descent
        broken = set_values(start, {"machine.frequency": np.nan})
        descent = begin(broken, preparation.problems(), preparation.conditions)
        assert _inquire._adapted(descent, start, 0) is descent


def parameter_of(block: fj.AbstractBlock, name: str) -> float:
    return float(named_parameters(block)[name].value)
