"""What a call may ask of a fit: robust losses, weights, masks, priors, ties, own parameters."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize

import fracjax as fj
from fracjax._blocks.mains_interference import MainsInterference
from fracjax._fit import LOSSES, options_of
from fracjax._fit._combinations import combinations_of
from fracjax._fit._conditions import Number
from fracjax._fit._robust import _SHAPES
from fracjax._fit._uncertainty import _coloured, _estimate, uncertainty_of
from tests.helpers import by_name, specified

STEP, SAMPLES, SIGMA = 2e-3, 600, 0.01
TIMES = STEP * np.arange(SAMPLES)
DRIVE = 40 + 15 * np.sin(2 * np.pi * 1.3 * TIMES) + 10 * np.sin(2 * np.pi * 4.1 * TIMES + 1)
KNOWN = specified(SIGMA)
TRUE = {"k_c": 0.08, "mu": 0.02}


def response_of(values: dict[str, float], drive=DRIVE, model: str = "creep") -> np.ndarray:
    """By the package's own simulation: here nothing is asked of the numerics."""
    block = fj.parse_model(model).with_values(values).block
    return np.asarray(block(jnp.asarray(drive), fj.Grid(STEP)))


CLEAN = response_of(TRUE)


def record(response: np.ndarray, drive: np.ndarray = DRIVE, seed: int = 0) -> fj.Recording:
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(response))
    return fj.Recording(drive, response + noise, STEP)


def fit(recording, model: str | fj.Model = "creep", **options) -> fj.Fit:
    options = {"noise": KNOWN, "starts": 1, "history": "constant", "settling": 0} | options
    model = fj.parse_model(model) if isinstance(model, str) else model
    return fj.fit(model, recording, **options)


def errors(found: fj.Fit) -> list[float]:
    """How far the estimates are from the truth, in standard errors."""
    return [abs(e.value - TRUE[e.name]) / e.standard_error for e in found.estimates]


@pytest.fixture(scope="module")
def plain() -> fj.Fit:
    return fit(record(CLEAN))


# Robust losses ------------------------------------------------------------------------------------


@pytest.mark.parametrize("loss", _SHAPES)
def test_a_loss_its_weight_and_its_slope_belong_together(loss):
    shape, z, step = _SHAPES[loss], np.array([0.1, 0.7, 1.2, 1.5, 3.0, 20.0]), 1e-6
    areas = [quad(lambda t: 2 * t * shape.weight(t), 0, end, points=[1.345])[0] for end in z]
    np.testing.assert_allclose(shape.twice(z), areas, rtol=1e-7)
    curvature = ((z + step) * shape.weight(z + step) - (z - step) * shape.weight(z - step)) / (
        2 * step
    )
    np.testing.assert_allclose(shape.slope(z), curvature, rtol=1e-6, atol=1e-9)


@pytest.fixture(scope="module")
def spoilt() -> tuple[fj.Recording, np.ndarray]:
    """A twentieth of the samples wrong by 20 to 60 sigma, all to one side."""
    generator = np.random.default_rng(5)
    bad = generator.choice(SAMPLES, SAMPLES // 20, replace=False)
    response = CLEAN.copy()
    response[bad] += SIGMA * generator.uniform(20, 60, bad.size)
    return record(response), bad


def test_least_squares_is_drawn_away_by_outliers(spoilt, plain):
    found = by_name(fit(spoilt[0]))
    good = by_name(plain)
    assert any(abs(found[n].value - TRUE[n]) > 5 * good[n].standard_error for n in TRUE)
    assert all(found[n].standard_error > 5 * good[n].standard_error for n in TRUE)


@pytest.mark.parametrize("loss", _SHAPES)
def test_robust_losses_are_not(spoilt, plain, loss):
    recording, bad = spoilt
    found = fit(recording, loss=loss)
    assert found.converged
    assert max(errors(found)) < 4
    for name, estimate in by_name(found).items():
        # A little wider than without outliers: the others do as much work as before.
        ratio = estimate.standard_error / by_name(plain)[name].standard_error
        assert 0.9 < ratio < 1.5, name
    assert found.robust is not None
    assert found.robust.weights[0][bad].max() < 0.2
    assert 0.05 <= found.robust.downweighted < 0.15
    assert found.robust.scale == pytest.approx(1.0, rel=0.15)
    assert found.to_dict()["loss"]["name"] == loss


def test_the_optimum_of_a_robust_loss_is_that_of_the_loss_itself(spoilt):
    """Against a direct minimisation of the soft_l1 loss over gain, order and offset."""
    found = fit(spoilt[0], loss="soft_l1")
    assert found.robust is not None
    scale = found.robust.scale * SIGMA

    def cost(v: np.ndarray) -> float:
        z = (spoilt[0].response - v[2] - response_of({"k_c": v[0], "mu": v[1]})) / scale
        return float(np.sum(_SHAPES["soft_l1"].twice(np.abs(z))))

    # A good start is enough: what is asked is whether anything near is lower.
    values = [by_name(found)["k_c"].value, by_name(found)["mu"].value, found.offsets[0]]
    best = minimize(cost, values, method="Nelder-Mead", options={"maxfev": 120})
    assert cost(np.array(values)) <= best.fun * (1 + 1e-5)


def test_without_outliers_a_robust_loss_changes_little(plain):
    found = fit(record(CLEAN), loss="huber")
    for name, estimate in by_name(found).items():
        assert abs(estimate.value - by_name(plain)[name].value) < 0.6 * estimate.standard_error
        assert estimate.standard_error == pytest.approx(
            by_name(plain)[name].standard_error, rel=0.25
        )


def test_an_unknown_loss_is_refused():
    with pytest.raises(fj.InputError, match=f'expected one of {", ".join(LOSSES)}, found "l3"'):
        fit(record(CLEAN), loss="l3")


# Weights and masks --------------------------------------------------------------------------------


def test_a_masked_stretch_has_no_say(plain):
    response = CLEAN.copy()
    response[200:300] += 3.0
    found = fit(record(response), mask=[(0.4, 0.598)])
    assert max(errors(found)) < 4
    assert found.to_dict()["samples_left_out"] == [100]
    # The very same as with weights of 0, whatever the stretch holds.
    weights = np.ones(SAMPLES)
    weights[200:300] = 0
    response[200:300] = 7.0
    other = fit(record(response), weights=weights)
    assert [e.value for e in other.estimates] == [e.value for e in found.estimates]
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def test_a_weight_of_four_is_half_the_noise(plain):
    found = fit(record(CLEAN), weights=np.full(SAMPLES, 4.0))
    half = fit(
        record(CLEAN), noise=fj.Noise(SIGMA / 2, "um", "specification", np.ones(1), SIGMA / 2)
    )
    for one, other in zip(found.estimates, half.estimates, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert one.standard_error == pytest.approx(other.standard_error, rel=1e-9)


def test_a_bad_period_does_not_spoil_the_measured_noise():
    drive = np.tile(40 - 20 * np.cos(2 * np.pi * np.arange(100) / 100), 8)
    response = response_of(TRUE, drive).copy()
    response[430:470] += 5.0
    found = fit(record(response, drive), noise=None, mask=[(0.86, 0.938)])
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.method == "repeats"
    assert noise.sigma == pytest.approx(SIGMA, rel=0.15)
    assert max(errors(found)) < 4


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"mask": [(3.0, 4.0)]}, "expected times within 0 to 1.198 s, found 3 to 4 s"),
        ({"mask": [(0.5, 0.2)]}, "found 0.5 to 0.2 s"),
        ({"mask": [(0.0, 1.19)]}, "expected at least 32 samples that count, found 4"),
        ({"weights": np.ones(7)}, r"expected 600 numbers, none below 0, found shape \(7,\)"),
        ({"weights": -np.ones(SAMPLES)}, "none below 0, found others"),
        (
            {"weights": [np.ones(SAMPLES)] * 2},
            "expected an array for each of 1 recordings, found 2",
        ),
    ],
)
def test_weights_that_do_not_fit_are_refused(options, said):
    with pytest.raises(fj.InputError, match=said):
        fit(record(CLEAN), **options)


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
        ({"priors": {"mu": fj.Normal(0.1, 0.0)}}, "a standard deviation above 0"),
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


# Ties ---------------------------------------------------------------------------------------------

CASCADE = fj.Model(fj.blocks.Creep() >> fj.blocks.Creep(fixed_gain=True))
BESIDE = fj.Model(fj.blocks.Creep() + fj.blocks.Creep())


def test_a_tied_parameter_follows():
    """Two creeps in a row are one of the sum of their orders: tied 1 to 2, they are 1/3, 2/3."""
    recording = record(response_of({"k_c": 0.08, "mu": 0.03}))
    options = {"tied": {"second.mu": ("first.mu", 2.0)}}
    found = fit(recording, CASCADE, **options)
    parameters = {name: float(p.value) for name, p in found.model.parameters.items()}
    assert by_name(found).keys() == {"first.k_c", "first.mu"}
    assert parameters["second.mu"] == pytest.approx(2 * parameters["first.mu"], rel=1e-12)
    one = by_name(fit(recording))["mu"]
    assert 3 * parameters["first.mu"] == pytest.approx(one.value, rel=1e-3)
    assert 3 * by_name(found)["first.mu"].standard_error == pytest.approx(
        one.standard_error, rel=0.02
    )
    assert found.to_dict()["tied"] == {"second.mu": {"to": "first.mu", "factor": 2.0}}


def test_tied_gains_stay_eliminated_side_by_side():
    """k (D^0.3 + 2 s^-μ) u: two gains that are one."""
    clean = response_of({"k_c": 0.02, "mu": 0.2}) + 2 * response_of({"k_c": 0.02, "mu": 0.01})
    tied = {"second.k_c": ("first.k_c", 2.0)}
    options = {"fixed": {"first.mu": 0.2, "second.mu": 0.01}, "tied": tied}
    found = fit(record(clean), BESIDE, **options)
    (gain,) = found.estimates
    assert gain.name == "first.k_c"
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
        size = lines["second.cosines"][0] - 1j * lines["second.sines"][0]
        turned = np.pi * (lines["second.frequency"] - frequency) * TIMES[-1]
        assert abs(size) == pytest.approx(10 * SIGMA, rel=0.1)
        assert np.angle(size * np.exp(1j * (turned - phase))) == pytest.approx(0, abs=0.1)
    with pytest.raises(fj.InputError, match="each recording's own"):
        fj.sample_posterior(found)


def test_a_shared_parameter_draws_on_both(pair):
    joint = by_name(fit(pair, own=["k_c"]))["mu"]
    alone = [by_name(fit(recording))["mu"].standard_error for recording in pair]
    wanted = sum(error**-2 for error in alone) ** -0.5
    assert joint.standard_error == pytest.approx(wanted, rel=0.05)


# Combinations -------------------------------------------------------------------------------------


def test_the_sum_that_a_covariance_fixes_is_found():
    """θ_1 + θ_2 known to 1e-4, θ_1 - θ_2 to 1; a third parameter has nothing to do with it."""
    axes = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    block = axes.T @ np.diag([1e-8, 1.0]) @ axes
    covariance = np.zeros((3, 3))
    covariance[:2, :2], covariance[2, 2] = block, 0.01
    units = ["um/V", "um/V*s^alpha", "1"]
    (found,) = combinations_of(["k_l", "k_h", "x"], np.array([0.3, 0.4, 1.0]), units, covariance)
    assert found.text == "k_l + k_h"
    assert found.unit == "um/V"
    assert found.value == pytest.approx(0.7)
    assert found.standard_error == pytest.approx(np.sqrt(2e-8), rel=1e-6)
    assert found.coefficients == {"k_l": 1.0, "k_h": 1.0}


def test_the_product_that_a_covariance_fixes_is_found():
    """ln k + ln a known to 1e-3, their difference to 0.2."""
    values = np.array([0.04, 0.03])
    axes = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    covariance = axes.T @ np.diag([1e-6, 0.04]) @ axes * np.outer(values, values)
    (found,) = combinations_of(["a", "k"], values[::-1], ["1", "um/V*s^a"], covariance[::-1, ::-1])
    assert found.text == "k·a"
    assert found.unit == "um/V"
    assert found.value == pytest.approx(0.0012)
    assert found.percent == pytest.approx(100 * np.sqrt(2e-6), rel=1e-6)


def test_a_group_without_any_close_pair_is_found():
    """Three gains of which only the sum is known; no two correlate beyond 0.5."""
    ones = np.ones(3) / np.sqrt(3)
    covariance = np.eye(3) - (1 - 1e-6) * np.outer(ones, ones)
    names = ["a", "b", "c"]
    correlation = covariance / np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.abs(correlation[np.triu_indices(3, 1)]).max() < 0.51
    (found,) = combinations_of(names, np.ones(3), ["V"] * 3, covariance)
    assert found.text == "a + b + c"
    assert found.standard_error == pytest.approx(np.sqrt(3e-6), rel=1e-3)


def test_a_slow_loop_of_foh_fixes_the_sum_of_the_gains_and_the_product_with_the_order():
    times = 5e-3 * np.arange(1500)
    drive = 50 - 45 * np.cos(2 * np.pi * times) + 5 * np.sin(2 * np.pi * 3 * times)
    law = {"k_l": 0.07, "k_h": 0.04, "alpha": 0.03, "k_p": 0.0}
    clean = np.asarray(
        fj.parse_model("foh").with_values(law).block(jnp.asarray(drive), fj.Grid(5e-3))
    )
    sigma = 1e-3 * np.ptp(clean)
    noise = specified(sigma)
    recording = fj.Recording(
        drive, clean + sigma * np.random.default_rng(2).standard_normal(1500), 5e-3
    )
    found = fj.fit(
        fj.parse_model("foh"), recording, noise=noise, history="constant", starts=1,
        fixed={"k_p": 0.0, "beta": -0.1},
    )  # fmt: skip
    known = {c.text: c for c in found.combinations}
    assert known["k_l + k_h"].percent < 0.05
    assert known["k_h·alpha"].percent < 2
    assert min(abs(100 * e.standard_error / e.value) for e in found.estimates) > 2
    for text, true in (("k_l + k_h", 0.11), ("k_h·alpha", 0.0012)):
        assert abs(known[text].value - true) < 4 * known[text].standard_error
    told = found.to_dict()["combinations"]
    assert {c["text"] for c in told} == set(known)


# Spelling -----------------------------------------------------------------------------------------


def test_options_as_they_are_written():
    found = options_of(
        fix=["k_p=0"], bound=["mu=0.1..0.2"], prior=["alpha = 0.1±0.02", "beta=-1e-1+-2"],
        tie=["second.mu=first.mu", "b = 2*a"], own=["k_p"], mask=["3 s..4 s", "10ms..20ms"],
    )  # fmt: skip
    assert found["fixed"] == {"k_p": 0.0}
    assert found["bounds"] == {"mu": (0.1, 0.2)}
    assert (float(found["priors"]["alpha"].mean), float(found["priors"]["alpha"].sd)) == (0.1, 0.02)
    assert float(found["priors"]["beta"].mean) == -0.1
    assert found["tied"] == {"second.mu": ("first.mu", 1.0), "b": ("a", 2.0)}
    assert found["own"] == ("k_p",)
    assert found["mask"] == ((3.0, 4.0), pytest.approx((0.01, 0.02)))
    assert options_of() == {}


@pytest.mark.parametrize(
    ("option", "text"),
    [
        ("fix", "k_p"), ("bound", "k_p=1"), ("prior", "k_p=1"), ("tie", "k_p=2"),
        ("mask", "3 s"), ("mask", "3 s..x"),
    ],
)  # fmt: skip
def test_options_written_otherwise_are_refused(option, text):
    with pytest.raises(fj.InputError, match=f"--{option}: expected a"):
        options_of(**{option: [text]})  # type: ignore[arg-type]


# Standard errors ----------------------------------------------------------------------------------


def coloured(seed: int, phi: float) -> np.ndarray:
    """AR(1) noise of unit variance."""
    white = np.random.default_rng(seed).standard_normal(SAMPLES)
    noise = np.empty(SAMPLES)
    noise[0] = white[0]
    for t in range(1, SAMPLES):
        noise[t] = phi * noise[t - 1] + np.sqrt(1 - phi**2) * white[t]
    return noise


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_intervals_cover_the_truth_though_the_noise_was_called_white(phi):
    """60 fits: of two parameters each, whose errors are far from independent, at least 52 within.

    52 of 60 is the 1 % point of the binomial at 95 %.  In coloured noise errors by JᵀJ alone fail.
    """
    covered, alone, orders = {"k_c": 0, "mu": 0}, {"k_c": 0, "mu": 0}, []
    for seed in range(60):
        recording = fj.Recording(DRIVE, CLEAN + SIGMA * coloured(seed, phi), STEP)
        found = fit(recording)
        orders.append(found.residual_order)
        naive = uncertainty_of(
            (found.model.block,), found.preparation.problems(), found.preparation.conditions,
            units=("V", "um"), inflation=1.0,
        ).estimates  # fmt: skip
        for counts, estimates in ((covered, found.estimates), (alone, naive)):
            for estimate in estimates:
                low, high = estimate.interval
                counts[estimate.name] += low <= TRUE[estimate.name] <= high
    assert min(covered.values()) >= 52, covered
    assert max(alone.values()) < 48 if phi else min(alone.values()) >= 52, alone
    assert np.mean(orders) < 0.5 if phi == 0 else min(orders) >= 1


def test_colour_widens_or_narrows_as_theory_says():
    """Of a mean of AR(1) noise the variance is (1 + φ)/(1 - φ) times that of white noise."""
    phi = 0.6
    ones = np.ones((4000, 1)) / np.sqrt(4000)
    found = float(np.sum(_coloured(ones, np.array([1.0, -phi])) ** 2))
    assert found == pytest.approx((1 + phi) / (1 - phi), rel=1e-3)
    # And against the matrix itself, for columns of any kind.
    columns = np.random.default_rng(0).standard_normal((60, 3))
    lags = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    matrix = columns.T @ phi**lags @ columns
    square = _coloured(columns, np.array([1.0, -phi]))
    np.testing.assert_allclose(square.T @ square, matrix, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("end", [0, 1])
def test_a_parameter_that_ends_on_either_bound_says_so(end):
    bounds = ((0.05, 0.06), (0.001, 0.002))[end]
    found = by_name(fit(record(CLEAN), bounds={"mu": bounds}))["mu"]
    assert found.value == pytest.approx(bounds[end], rel=1e-3)
    assert found.at_bound


def test_a_parameter_between_its_bounds_is_at_none():
    assert not by_name(fit(record(CLEAN), bounds={"mu": (0.001, 0.1)}))["mu"].at_bound


def test_a_gain_is_identified_to_a_twentieth_of_the_response():
    block = fj.parse_model("creep").block
    gain = Number("k_c", "k_c", 0, None)
    for share, known in ((0.049, True), (0.051, False)):
        found = _estimate(gain, True, (block,), 0.01, share, ("V", "um"))
        assert found.identified == known
