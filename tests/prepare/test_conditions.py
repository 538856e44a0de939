"""Priors, ties and parameters of each recording's own."""

import json
from dataclasses import replace

import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks.mains_interference import MainsInterference
from tests.fit.creep import CLEAN, DRIVE, SIGMA, TIMES, TRUE, fit, record, response_of
from tests.helpers import by_name

# Priors -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", TRUE)
def test_a_prior_counts_as_one_more_measurement(plain, name):
    """Of mean ± sd and estimate ± error comes the mean weighted by 1/variance, and its error."""
    free = by_name(plain)[name]
    sd = 0.7 * free.standard_error
    mean = free.value + 2 * free.standard_error
    found = by_name(fit(record(CLEAN), priors={name: fj.Normal(mean, sd)}))[name]
    weight, other = 1 / free.standard_error**2, 1 / sd**2
    wanted = (weight * free.value + other * mean) / (weight + other)
    assert found.value == pytest.approx(wanted, abs=0.05 * free.standard_error)
    assert found.standard_error == pytest.approx((weight + other) ** -0.5, rel=0.03)


def test_a_prior_decides_what_the_data_leave_open():
    model, values = "foh", {"k_l": 0.07, "k_h": 0.04, "alpha": 0.14, "k_p": 0.0}
    recording = record(response_of(values, model=model))
    options = {"fixed": {"k_p": 0.0, "beta": -0.1}}
    open_ = by_name(fit(recording, model, **options))
    found = by_name(fit(recording, model, priors={"alpha": fj.Normal(0.14, 3e-4)}, **options))
    assert found["alpha"].standard_error == pytest.approx(3e-4, rel=0.02)
    assert found["k_h"].standard_error < 0.3 * open_["k_h"].standard_error


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"priors": {"nu": fj.Normal(0, 1)}}, '"nu": expected one of k_c, mu, found none'),
        ({"priors": {"mu": fj.Normal(0.1, 0.0)}}, "standard deviations above 0"),
        ({"priors": {"mu": fj.Normal(0.1, 1)}, "fixed": {"mu": 0.1}}, "found a fixed one"),
        ({"own": ["nu"]}, '"nu": expected one of k_c, mu'),
        ({"tied": {"mu": "nu"}}, '"nu": expected one of k_c, mu'),
        ({"tied": {"mu": "mu"}}, "neither tied itself"),
        ({"tied": {"mu": ("k_c", 0.0)}}, "expected a factor other than 0"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(options, said):
    with pytest.raises(fj.InputError, match=said):
        fit(record(CLEAN), **options)


def test_a_prior_of_several_components_is_finite_in_all():
    means = np.zeros(12)
    means[3] = np.nan
    with pytest.raises(fj.InputError, match="expected finite means"):
        fit(
            record(CLEAN),
            "foh + minor_loop_memory",
            priors={"minor_loop_memory.weights": fj.Normal(means, 1.0)},
        )


# Ties ---------------------------------------------------------------------------------------------

CASCADE = fj.Model(fj.blocks.Creep() >> fj.blocks.Creep(fixed_gain=True))
BESIDE = fj.Model(fj.blocks.Creep() + fj.blocks.Creep())


def test_a_tied_parameter_follows():
    """Two creeps in a row are one of the sum of their orders: tied 1 to 2, they are 1/3, 2/3."""
    recording = record(response_of({"k_c": 0.08, "mu": 0.03}))
    options = {"tied": {"creep_2.mu": ("first.mu", 2.0)}}  # by name or by place
    found = fit(recording, CASCADE, **options)
    parameters = {name: float(p.value) for name, p in found.model.parameters.items()}
    assert by_name(found).keys() == {"creep_1.k_c", "creep_1.mu"}
    assert parameters["creep_2.mu"] == pytest.approx(2 * parameters["creep_1.mu"], rel=1e-12)
    one = by_name(fit(recording))["mu"]
    assert 3 * parameters["creep_1.mu"] == pytest.approx(one.value, rel=1e-3)
    assert 3 * by_name(found)["creep_1.mu"].standard_error == pytest.approx(
        one.standard_error, rel=0.02
    )
    assert found.to_dict()["tied"] == {"creep_2.mu": {"to": "creep_1.mu", "factor": 2.0}}


def test_tied_gains_stay_eliminated_side_by_side():
    """k (D^0.3 + 2 s^-μ) u: two gains that are one."""
    clean = response_of({"k_c": 0.02, "mu": 0.2}) + 2 * response_of({"k_c": 0.02, "mu": 0.01})
    tied = {"creep_2.k_c": ("creep_1.k_c", 2.0)}
    options = {"fixed": {"creep_1.mu": 0.2, "creep_2.mu": 0.01}, "tied": tied}
    found = fit(record(clean), BESIDE, **options)
    (gain,) = found.estimates
    assert gain.name == "creep_1.k_c"
    assert abs(gain.value - 0.02) < 4 * gain.standard_error
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def test_a_gain_tied_to_a_shape_is_iterated():
    found = fit(record(response_of({"k_c": 0.08, "mu": 0.04})), tied={"k_c": ("mu", 2.0)})
    (only,) = found.estimates
    assert only.name == "mu"
    assert only.value == pytest.approx(0.04, rel=1e-3)
    assert float(found.model.parameters["k_c"].value) == pytest.approx(2 * only.value)


# Parameters of each recording's own ---------------------------------------------------------------


@pytest.fixture(scope="module")
def pair() -> list[fj.Recording]:
    """Two actuators of one creep order and two gains."""
    drives = DRIVE, 0.5 * DRIVE + 10
    gains = 0.08, 0.05
    return [
        record(response_of({"k_c": k, "mu": 0.02}, u), u, seed)
        for seed, (k, u) in enumerate(zip(gains, drives, strict=True))
    ]


@pytest.mark.parametrize("own", [["k_c"], ["mu"], ["k_c", "mu"]])
def test_own_parameters_are_each_recordings(pair, own, tmp_path):
    found = fit(pair, own=own, priors={"mu": fj.Normal(0.02, 10.0)})
    shared = [name for name in ("mu", "k_c") if name not in own]
    assert set(by_name(found)) == {*shared, *(f"{n}@{r}" for n in own for r in (1, 2))}
    if "k_c" in own:
        assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)
        for name, true in (("k_c@1", 0.08), ("k_c@2", 0.05)):
            estimate = by_name(found)[name]
            assert abs(estimate.value - true) < 4 * estimate.standard_error
    if own == ["k_c", "mu"]:
        # Nothing shared: two fits in one.
        for r, recording in enumerate(pair):
            alone = by_name(fit(recording))
            for name in own:
                one, other = by_name(found)[f"{name}@{r + 1}"], alone[name]
                assert one.value == pytest.approx(other.value, rel=1e-3)
                assert one.standard_error == pytest.approx(other.standard_error, rel=0.15)
    values = [float(model.parameters[own[0]].value) for model in found.models]
    assert values == [by_name(found)[f"{own[0]}@{r}"].value for r in (1, 2)]
    found.save(tmp_path / "fit.json")
    assert json.loads((tmp_path / "fit.json").read_text())["own"] == own
    fj.load_model(tmp_path / "fit.json")


def test_what_begins_anew_with_a_recording_is_its_own_unasked(pair):
    """The mains: of two recordings no two phases are alike."""
    phases, frequency = (0.3, 2.9), 50.03
    humming = [
        replace(r, response=r.response + 10 * SIGMA * np.cos(2 * np.pi * frequency * TIMES + phase))
        for r, phase in zip(pair, phases, strict=True)
    ]
    creep = fj.parse_model("creep").block
    model = fj.Model(creep + MainsInterference(50.0), "creep and the mains")
    found = fit(humming, model, own=["first.k_c"])
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)
    for fitted, phase in zip(found.models, phases, strict=True):
        lines = {name: np.asarray(p.value) for name, p in fitted.parameters.items()}
        size = lines["mains_interference.cosines"][0] - 1j * lines["mains_interference.sines"][0]
        turned = np.pi * (lines["mains_interference.frequency"] - frequency) * TIMES[-1]
        assert abs(size) == pytest.approx(10 * SIGMA, rel=0.1)
        assert np.angle(size * np.exp(1j * (turned - phase))) == pytest.approx(0, abs=0.1)
    with pytest.raises(fj.InputError, match="differ between recordings"):
        fj.sample_posterior(found)


def test_a_shared_parameter_draws_on_both(pair):
    joint = by_name(fit(pair, own=["k_c"]))["mu"]
    alone = [by_name(fit(recording))["mu"].standard_error for recording in pair]
    wanted = sum(error**-2 for error in alone) ** -0.5
    assert joint.standard_error == pytest.approx(wanted, rel=0.05)
