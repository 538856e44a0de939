"""What a user sees of a machine with physics inside: tables name each effect's own parameters."""

import pytest

import fracjax as fj
from tests.inside.test_inside import recorded


@pytest.fixture(scope="module")
def stiffening() -> fj.Recording:
    """An oscillator whose spring has a cubic part of .8."""
    return recorded("cubic_stiffness", 1.0, 0)


def test_a_fit_lists_the_parameters_of_what_is_inside(stiffening):
    fit = fj.fit("oscillator @ cubic_stiffness", stiffening)
    assert "cubic_stiffness.stiffness" in str(fit)
    (stiffness,) = [e for e in fit.shown_estimates if "cubic" in e.name]
    assert stiffness.value == pytest.approx(0.8, rel=0.01)


@pytest.mark.slow
def test_a_diagnosis_lists_the_parameters_of_what_it_names(stiffening):
    diagnosis = fj.diagnose("oscillator", stiffening)
    (effect,) = diagnosis.effects
    assert (effect.name, effect.site) == ("cubic_stiffness", "force")
    (stiffness,) = effect.parameters
    assert stiffness.name == "stiffness"
    assert stiffness.value == pytest.approx(0.8, rel=0.05)
    assert "cubic_stiffness  stiffness" in str(diagnosis)
    low, high = stiffness.interval
    assert low < 0.8 < high
    # Of .1 % of the response; what the bare oscillator leaves is a hundred times as much.
    assert diagnosis.noise.sigma < 0.01
    assert effect.probability <= 1.0
    assert effect.explained_fraction > 0.9
