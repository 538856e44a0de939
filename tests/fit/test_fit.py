"""A fit recovers a truth of other numerics, with honest intervals, and keeps what it is given."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from tests.fit.helpers import (
    CLEAN,
    DRIVE,
    KNOWN,
    LAW,
    SIGMA,
    STARTS,
    STEP,
    fit_foh,
    record,
    several_tones,
    truth,
    white,
)
from tests.helpers import by_name


@pytest.fixture(scope="module")
def recovered() -> fj.Fit:
    return fit_foh(record(0))


# Recovery and its uncertainty ---------------------------------------------------------------------


def test_what_is_left_is_the_noise(recovered):
    noise = SIGMA * np.sqrt(np.mean(white(0) ** 2))
    assert recovered.converged
    assert recovered.scores.rmse == pytest.approx(noise, rel=0.02)
    assert np.sqrt(np.mean(recovered.residuals[0] ** 2)) == pytest.approx(noise, rel=0.02)
    assert recovered.scores.nrmse_percent == pytest.approx(100 * (1 - recovered.scores.e_r))


def test_the_true_parameters_are_recovered(recovered):
    estimates = by_name(recovered)
    assert estimates.keys() == LAW.keys()
    assert estimates["alpha"].identified
    for name, estimate in estimates.items():
        if estimate.identified:
            assert abs(estimate.value - LAW[name]) < 4 * estimate.standard_error, name
            assert estimate.standard_error > 0
            assert not estimate.at_bound
    assert estimates["k_l"].unit == "um/V"


def test_the_simulation_is_the_model_at_the_samples(recovered):
    """The last too, whose rate looks beyond the record."""
    grid = fj.Grid(STEP, "constant")
    found = recovered.model.block(jnp.asarray(DRIVE), grid) + recovered.offsets[0]
    size = np.ptp(CLEAN)
    np.testing.assert_allclose(recovered.simulations[0], found, rtol=0, atol=1e-9 * size)


def test_the_last_samples_are_as_good_as_the_others(recovered):
    """FOH's rate there needs samples that were never taken: going straight on, it cost 10 sigma."""
    error = recovered.simulations[0] - CLEAN
    assert np.abs(error[-4:] - error[:-4].mean()).max() < SIGMA


@pytest.mark.slow
def test_intervals_of_95_percent_cover_the_truth():
    """Of 40 draws 34 to 40: fewer has a chance of 1 % when 95 % is true."""
    draws = [by_name(fit_foh(record(100 + k)))["alpha"] for k in range(40)]
    assert all(draw.identified for draw in draws)
    covered = sum(draw.interval[0] <= LAW["alpha"] <= draw.interval[1] for draw in draws)
    assert covered >= 0.85 * len(draws)
    # And they are not merely wide: the standard error is the scatter, to 35 % (3 sigma of 40).
    scatter = np.std([draw.value for draw in draws], ddof=1)
    assert np.mean([draw.standard_error for draw in draws]) == pytest.approx(scatter, rel=0.35)


def test_a_fit_repeats(recovered):
    again = fit_foh(record(0))
    assert [e.value for e in again.estimates] == [e.value for e in recovered.estimates]


def test_precision_is_left_alone(recovered, float32_default):
    assert jnp.ones(1).dtype == np.float32
    again = fit_foh(record(0))
    assert jnp.ones(1).dtype == np.float32
    assert again.simulations[0].dtype == np.float64
    for one, other in zip(again.estimates, recovered.estimates, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)


# Fixed values and bounds --------------------------------------------------------------------------


def test_a_bound_is_kept_and_said():
    free = fit_foh(record(0), bounds={"alpha": (0.2, 0.4)})
    alpha = by_name(free)["alpha"]
    assert 0.2 <= alpha.value <= 0.4
    assert alpha.at_bound  # the truth lies below


def test_unknown_names_are_refused():
    sentence = r'"wumpus": expected one of .*alpha.*found none'
    with pytest.raises(fj.InputError, match=sentence):
        fit_foh(record(0), fixed={"wumpus": 0.1})
    with pytest.raises(fj.InputError, match=sentence):
        fit_foh(record(0), bounds={"wumpus": (0.1, 0.2)})


def test_recordings_in_different_units_are_refused():
    other = fj.Recording(DRIVE, CLEAN, STEP, "V", response_unit="nm", source="other")
    with pytest.raises(fj.InputError, match=r"other: expected the units of .*V, um.*V, nm"):
        fj.fit(fj.parse_model("foh"), [record(0), other])


# Several recordings -------------------------------------------------------------------------------


JOINT_LAW = {"chi": 0.2, "mu": 0.4, "delta": 0.08, "g": 0.03, "g_kappa": 0.12}


@pytest.fixture(scope="module")
def joint() -> fj.Fit:
    """Two recordings of one LFDH, its shapes given; offsets count from where the drive is zero."""
    recordings = []
    for seed, (scale, offset) in enumerate(((1.0, 3.0), (0.6, -7.0))):
        drive, clean = truth(lambda t, a=scale: a * several_tones(t), JOINT_LAW, "lfdh")
        clean += offset + JOINT_LAW["g"] * drive[0]
        recordings.append(fj.Recording(drive, clean + 5e-4 * white(seed), STEP, "V", "um"))
    noise = fj.Noise(5e-4, "um", "specification", np.ones(1), 5e-4)
    shapes = {name: JOINT_LAW[name] for name in ("chi", "mu", "delta")}
    return fj.fit(fj.parse_model("lfdh"), recordings, noise=noise, fixed=shapes, starts=1)


def test_recordings_share_parameters_and_have_their_own_offsets(joint):
    estimates = by_name(joint)
    assert len(joint.offsets) == len(joint.simulations) == len(joint.residuals) == 2
    assert joint.scores.rmse == pytest.approx(5e-4, rel=0.03)
    for name, true in (("k_0", "g"), ("k_delta", "g_kappa")):
        error = 4 * estimates[name].standard_error
        assert abs(estimates[name].value - JOINT_LAW[true]) < error, name
    # What was held before the record is k_0 times the first drive: the offsets inherit its error.
    error = 4 * estimates["k_0"].standard_error * DRIVE[0]
    for found, wanted in zip(joint.offsets, (3.0, -7.0), strict=True):
        assert abs(found - wanted) < error + 1e-3


def test_fixed_values_are_kept_and_not_estimated(joint):
    for name in ("chi", "mu", "delta"):
        assert float(joint.model.parameters[name].value) == JOINT_LAW[name]
    assert by_name(joint).keys() == {"k_0", "k_delta"}


# Saving -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("source", ["recovered", "joint"])
def test_a_saved_fit_simulates_the_same(source, request, tmp_path):
    fit = request.getfixturevalue(source)
    fit.save(tmp_path / "fit.json")
    loaded = fj.load_model(tmp_path / "fit.json")
    assert loaded.name == fit.model.name
    grid = fj.Grid(STEP, "constant")
    wanted = np.asarray(fit.model.block(jnp.asarray(DRIVE), grid))
    found = loaded.block(jnp.asarray(DRIVE), grid)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_saved_fit_says_what_it_rests_on(recovered, tmp_path):
    recovered.save(tmp_path / "fit.json")
    content = json.loads((tmp_path / "fit.json").read_text(encoding="utf-8"))
    noise = {"sigma": SIGMA, "unit": "um", "method": "specification", "relative_error": None}
    assert content["noise"] == noise
    assert content["assumptions"] == [{"history": "constant", "settling_samples": 0}]
    assert content["units"] == {"drive": "V", "response": "um"}
    assert content["parameters"]["alpha"]["value"] == by_name(recovered)["alpha"].value


@pytest.mark.parametrize("content", [None, "", "{}", '{"schema": "fracjax.fit/99"}', "[1, 2]"])
def test_no_saved_fit_is_refused(content, tmp_path):
    path = tmp_path / "fit.json"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    with pytest.raises(fj.InputError, match=r"fit\.json: expected a fit.*found"):
        fj.load_model(path)


def test_a_model_made_from_a_block_can_be_saved_and_loaded(tmp_path):
    fit = fj.fit(fj.Model(fj.blocks.FOH()), record(0), noise=KNOWN, starts=STARTS)
    fit.save(tmp_path / "fit.json")
    fj.load_model(tmp_path / "fit.json")


# What one steady sine cannot tell -----------------------------------------------------------------


@pytest.fixture(scope="module")
def one_sine() -> fj.Fit:
    """Steady cycles at 1 Hz of a law with k_p = 0: gain and phase, two numbers for three."""
    times = np.arange(1000) / 100
    gain = 0.07 + 0.04 * (2j * np.pi) ** 0.14
    drive = 40 + 30 * np.sin(2 * np.pi * times)
    response = 30 * np.imag(gain * np.exp(2j * np.pi * times))
    noise = 5e-3 * np.random.default_rng(4).standard_normal(times.size)
    recording = fj.Recording(drive, response + noise, 1e-2, "V", "um")
    return fj.fit(fj.parse_model("foh"), recording, fixed={"k_p": 0.0, "beta": 0.1}, starts=STARTS)


def test_steady_cycles_are_taken_as_periodic(one_sine):
    assert one_sine.to_dict()["assumptions"] == [{"history": "periodic", "settling_samples": 0}]
    assert one_sine.scores.rmse == pytest.approx(5e-3, rel=0.05)


def test_one_sine_leaves_the_gains_known_only_together(one_sine):
    assert any("k_l and k_h" in pair for pair in one_sine.correlated)
    assert not by_name(one_sine)["k_l"].identified
    assert not by_name(one_sine)["k_h"].identified
    assert by_name(one_sine).keys() == {"alpha", "k_l", "k_h"}


def test_a_second_gain_in_a_row_is_fitted_too():
    """It can no longer be eliminated, and has no bounds; the data know only its product with the
    first, which the fit says."""
    found = fj.fit(fj.parse_model("foh >> lfdh"), record(5), noise=KNOWN, starts=1)
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)
    assert "lfdh.k_0" in {e.name for e in found.estimates}
    assert "foh.k_l" in {e.name for e in found.estimates if not e.identified}


def test_a_bound_on_one_side_is_refused():
    with pytest.raises(ValueError, match="expected two finite bounds or none"):
        fj.Parameter(1.0, "V", lower=0.0)
