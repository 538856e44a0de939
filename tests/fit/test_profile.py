"""Profiles and comparisons: as closed forms have them, open where the data leave them open."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter, lsim

import fracjax as fj
from fracjax._fit import estimate_row, with_profiled_intervals
from fracjax._fit._held_out import HeldOutScores, _correlation_length, _folds
from fracjax._parameters import replace_parameters
from fracjax._prepare import prepare
from fracjax._report import fit_sentence
from tests.helpers import by_name, specified

STEP, SAMPLES, SIGMA = 2e-3, 600, 0.01
TIMES = STEP * np.arange(SAMPLES)
DRIVE = 40 + 15 * np.sin(2 * np.pi * 1.3 * TIMES) + 10 * np.sin(2 * np.pi * 4.1 * TIMES + 1)
KNOWN = specified(SIGMA)
NOISE = np.random.default_rng(8).standard_normal(2000)
OPTIONS = {"noise": KNOWN, "starts": 1, "history": "constant", "settling": 0}


def record(values: dict[str, float], model: str = "creep", drive=DRIVE, seed=0) -> fj.Recording:
    block = fj.parse_model(model).with_values(values).block
    response = np.asarray(block(jnp.asarray(drive), fj.Grid(STEP)))
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(drive))
    return fj.Recording(drive, response + noise, STEP, "V", "um", source=f"{model}.csv")


CREEP = record({"k_c": 0.08, "mu": 0.02})


@pytest.fixture(scope="module")
def creep() -> fj.Fit:
    return fj.fit(fj.parse_model("creep"), CREEP, **OPTIONS)


# Profiles -----------------------------------------------------------------------------------------


def test_of_a_gain_alone_the_profile_is_a_parabola():
    found = fj.fit(fj.parse_model("creep"), CREEP, fixed={"mu": 0.02}, **OPTIONS)
    profile = fj.profile(found, "k_c")
    (gain,) = found.estimates
    z = (profile.values - gain.value) / gain.standard_error
    np.testing.assert_allclose(profile.delta, z**2, rtol=1e-4, atol=1e-6)
    low, high = profile.interval_95
    assert (low, high) == pytest.approx(gain.interval, rel=1e-5)
    assert not profile.open
    assert not profile.lower_found


def test_a_profile_is_the_least_over_all_others(creep):
    """Against fits with the parameter held, started anew."""
    profile = fj.profile(creep, "mu")
    chi = sum(np.sum((r / SIGMA) ** 2) for r in creep.residuals)
    # The fit's errors are those of χ² times a factor that the profile shares.
    for k in (0, 3, -1):
        held = fj.fit(fj.parse_model("creep"), CREEP, fixed={"mu": profile.values[k]}, **OPTIONS)
        rise = sum(np.sum((r / SIGMA) ** 2) for r in held.residuals) - chi
        factor = rise / profile.delta[k]
        assert factor == pytest.approx(max(1.0, chi / SAMPLES), rel=0.02)
    estimate = next(e for e in creep.estimates if e.name == "mu")
    assert profile.interval_95 == pytest.approx(estimate.interval, rel=0.05)


def test_what_the_data_leave_open_is_open():
    """Without creep to be seen, its order may be as small as you like."""
    found = fj.fit(fj.parse_model("creep"), record({"k_c": 0.01, "mu": 1e-4}), **OPTIONS)
    profile = fj.profile(found, "mu")
    assert profile.open
    assert profile.interval_95[0] is None
    assert profile.interval_95[1] is not None
    assert profile.values.min() == pytest.approx(1e-5, rel=1e-6)  # its bound
    assert profile.delta[0] < 3.84


def test_a_logarithmic_parameter_is_known_by_a_factor():
    """Near the value as ± 1.96 standard errors, and never negative or endless."""
    drift = fj.Estimate("time_constant", 10.0, 5.0, "s", True, False, logarithmic=True)
    low, high = drift.interval
    assert low * high == pytest.approx(100.0)
    assert np.log(high / low) == pytest.approx(1.96)
    known = replace(drift, standard_error=1e-3).interval
    assert known == pytest.approx((10 - 1.96e-3, 10 + 1.96e-3), rel=1e-7)
    low, high = replace(drift, standard_error=np.inf).interval
    assert 0 < low < 10 < high < np.inf


def intervals(found: fj.Fit, *names: str) -> dict[str, tuple[float, float]]:
    return {e.name: e.interval for e in with_profiled_intervals(found, names).estimates}


def test_intervals_end_where_profiles_do(creep):
    told = intervals(creep, "mu")
    assert told["mu"] == pytest.approx(fj.profile(creep, "mu").interval_95, rel=2e-3)
    assert told["k_c"] == next(e for e in creep.estimates if e.name == "k_c").interval


class Bent(fj.AbstractBlock):
    """a u + b |u|, of which the bound of b may be in the way."""

    slope: fj.Parameter
    bend: fj.Parameter

    def __init__(self, least: float):
        self.slope = fj.Parameter(1.0, lower=0.0, upper=5.0)
        self.bend = fj.Parameter(1.1, lower=least, upper=5.0)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return self.slope.value * drive + self.bend.value * jnp.abs(drive)


@pytest.mark.parametrize(("least", "stopped"), [(0.2, False), (1.0, True)])
def test_beside_a_number_at_its_bound_an_interval_is_no_shorter_than_its_error(least, stopped):
    """|u| is much like u on a drive that is seldom negative: held, it lets a be known well."""
    drive = DRIVE - 22
    noise = SIGMA * np.random.default_rng(5).standard_normal(SAMPLES)
    recording = fj.Recording(drive, drive + 0.99 * np.abs(drive) + noise, STEP, "V", "um")
    found = fj.fit(fj.Model(Bent(least)), recording, noise=KNOWN, history="rest", starts=1)
    slope = by_name(found)["slope"]
    assert by_name(found)["bend"].at_bound == stopped
    told = np.array(intervals(found, "slope")["slope"])
    parabola = slope.value + 1.96 * slope.standard_error * np.array([-1, 1])
    assert told == pytest.approx(parabola, abs=0.05 * slope.standard_error)
    held = np.ptp(np.array(fj.profile(found, "slope").interval_95))
    assert held < 0.7 * np.ptp(told) if stopped else held == pytest.approx(np.ptp(told), rel=0.05)


class Cubed(fj.AbstractBlock):
    """p³ u."""

    root: fj.Parameter

    def __init__(self):
        self.root = fj.Parameter(1.0, lower=0.1, upper=3.0)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive, grid):
        return self.root.value**3 * drive


def test_an_interval_is_the_same_however_its_parameter_is_written():
    """The profile of p³, a gain, is a parabola: the ends of p are the roots of its ends."""
    white = 100 * np.random.default_rng(6).standard_normal(SAMPLES)
    recording = fj.Recording(DRIVE, DRIVE + white, STEP, "V", "um")
    noise = specified(100)
    found = fj.fit(fj.Model(Cubed()), recording, noise=noise, starts=1, history="constant")
    root = by_name(found)["root"]
    cube, error = root.value**3, 3 * root.value**2 * root.standard_error
    assert 0.5 < 1.96 * error / cube < 0.8  # far from straight
    wanted = np.cbrt(cube + 1.96 * error * np.array([-1, 1]))
    assert intervals(found, "root")["root"] == pytest.approx(wanted, rel=2e-3)


LONG = 0.02 * SAMPLES
DRIFTING = fj.Model(fj.parse_model("creep").block + fj.blocks.ThermalDrift(3.0, longest=LONG))
DRIFT = {
    "creep.k_c": 0.08,
    "creep.mu": 0.02,
    "thermal_drift.amplitude": 0.5,
    "thermal_drift.slope": 0.02,
    "thermal_drift.time_constant": 1.5 * LONG,
}


def drifting(seed: int) -> fj.Fit:
    step = LONG / SAMPLES
    response = np.asarray(DRIFTING.with_values(DRIFT).block(jnp.asarray(DRIVE), fj.Grid(step)))
    noise = SIGMA * np.random.default_rng(seed).standard_normal(SAMPLES)
    recording = fj.Recording(DRIVE, response + noise, step, "V", "um")
    return fj.fit(DRIFTING, recording, noise=KNOWN, starts=3, history="constant", settling=0)


def test_a_time_constant_longer_than_the_recording_is_within_its_interval():
    """A parabola at an optimum far too short leaves it out, and often."""
    name = "thermal_drift.time_constant"
    fits = [drifting(seed) for seed in range(16)]
    ends = [intervals(found, name)[name] for found in fits if by_name(found)[name].identified]
    assert len(ends) >= 8
    assert sum(low <= DRIFT[name] <= high for low, high in ends) >= len(ends) - 1
    # Of what may be as long as you like the bound of the search is no end.
    assert any(high > 3 * LONG for _, high in ends)


def test_a_vector_of_one_number_has_its_profile():
    """A mains line without harmonics: one sine and one cosine, in vectors of one."""
    line = fj.blocks.MainsInterference(50.0, 1)
    model = fj.Model(fj.parse_model("creep").block + line)
    hum = 0.05 * np.sin(2 * np.pi * 50 * TIMES)
    recording = fj.Recording(DRIVE, CREEP.response + hum, STEP, "V", "um")
    found = fj.fit(model, recording, fixed={"mains_interference.frequency": 50.0}, **OPTIONS)
    told = intervals(found, "mains_interference.sines", "mains_interference.cosines")
    for name in ("mains_interference.sines", "mains_interference.cosines"):
        assert told[name] == pytest.approx(by_name(found)[name].interval, rel=1e-3), name
    assert not fj.profile(found, "mains_interference.sines").open


def test_ties_and_priors_are_kept_while_a_parameter_is_held():
    model = fj.Model(fj.blocks.Creep() >> fj.blocks.Creep(fixed_gain=True))
    found = fj.fit(
        model, CREEP, tied={"creep_2.mu": "creep_1.mu"},
        priors={"creep_1.mu": fj.Normal(0.01, 1e-3)}, **OPTIONS,
    )  # fmt: skip
    profile = fj.profile(found, "creep_1.mu")
    estimate = next(e for e in found.estimates if e.name == "creep_1.mu")
    assert profile.interval_95 == pytest.approx(estimate.interval, rel=0.05)
    assert not profile.lower_found


def test_a_fit_short_of_the_optimum_is_found_out(creep):
    """A fit whose order was held elsewhere, passed off as free."""
    held = fj.fit(fj.parse_model("creep"), CREEP, bounds={"mu": (0.03, 0.1)}, **OPTIONS)
    block = held.model.block
    free = fj.Parameter(
        held.model.parameters["mu"].value,
        lower=1e-5,
        upper=0.3,
        plausible=(1e-3, 0.04),
        logarithmic=True,
    )
    model = fj.Model(replace_parameters(block, {"mu": free}), "creep")
    profiled = fj.with_profiles(replace(held, model=model, models=(model,)), ["mu"])
    assert profiled.profiles[0].lower_found
    assert "reached a smaller χ² than the fit of creep" in profiled.warnings[0]


def test_profiles_are_saved(creep, tmp_path):
    profiled = fj.with_profiles(creep, ["mu"])
    profiled.save(tmp_path / "fit.json")
    (told,) = json.loads((tmp_path / "fit.json").read_text())["profiles"]
    assert told["name"] == "mu"
    assert told["open"] is False
    assert len(told["values"]) == len(told["delta"])
    assert profiled.warnings == ()


def test_names_that_cannot_be_profiled_are_refused(creep):
    with pytest.raises(fj.InputError, match='profile of "nu": expected one of mu, k_c, found none'):
        fj.profile(creep, "nu")
    own = fj.fit(fj.parse_model("creep"), [CREEP, CREEP], own=["mu"], **OPTIONS)
    with pytest.raises(fj.InputError, match="expected one of k_c, found none"):
        fj.profile(own, "mu@1")


# Comparisons --------------------------------------------------------------------------------------


def unseen(comparison: fj.Comparison) -> HeldOutScores:
    found = comparison.rows[0].unseen
    assert found is not None
    return found


@pytest.fixture(scope="module")
def compared() -> fj.Comparison:
    """Creep's recording: creep, and the law that is too stiff for it."""
    models = [fj.parse_model("creep").with_values({"mu": 0.02}), fj.parse_model("lfdh")]
    return fj.compare(models[::-1], CREEP, **OPTIONS)


def test_the_law_that_made_the_recording_is_best(compared):
    assert compared.best == "creep"
    first, second = compared.rows
    assert (first.model, second.model) == ("creep", "lfdh")
    assert (first.parameters, second.parameters) == (3, 6)
    assert first.bic < second.bic
    assert first.rmse == pytest.approx(SIGMA, rel=0.1)


def test_errors_on_data_held_out_are_larger_than_on_data_fitted(compared):
    for row in compared.rows:
        assert row.unseen is not None
        assert len(row.unseen.folds) == 5
        assert row.rmse < row.unseen.rmse < 1.5 * row.rmse
        assert row.unseen.nrmse_percent == pytest.approx(100 * (1 - row.unseen.e_r))


def test_a_comparison_is_plain_data(compared, tmp_path):
    compared.save(tmp_path / "comparison.json")
    told = json.loads((tmp_path / "comparison.json").read_text())
    assert told["schema"] == "fracjax.comparison/2"
    assert told["best"] == "creep"
    assert [row["model"] for row in told["rows"]] == [f["model"] for f in told["fits"]]


def test_another_recording_may_be_held_out(creep):
    other = record({"k_c": 0.08, "mu": 0.02}, drive=0.5 * DRIVE[::-1], seed=4)
    found = fj.compare([fj.parse_model("creep")], CREEP, holdout=other, **OPTIONS)
    assert found.method == "creep.csv"
    assert unseen(found).rmse == pytest.approx(SIGMA, rel=0.2)
    strange = record({"k_c": 0.2, "mu": 0.02}, drive=0.5 * DRIVE, seed=4)
    worse = fj.compare([fj.parse_model("creep")], CREEP, holdout=strange, **OPTIONS)
    assert unseen(worse).rmse > 20 * SIGMA
    nm = fj.Recording(DRIVE, CREEP.response, STEP, "V", response_unit="nm", source="other")
    with pytest.raises(fj.InputError, match="other: expected the units of"):
        fj.compare([fj.parse_model("creep")], CREEP, holdout=nm, **OPTIONS)


def test_data_held_out_refute_the_least_bic():
    """On a recording without creep, creep predicts worse than a gain, whatever the fit says."""
    mean_gain = np.polyfit(DRIVE, CREEP.response, 1)[0]
    response = mean_gain * DRIVE + SIGMA * NOISE[:SAMPLES]
    other = fj.Recording(DRIVE, response, STEP, "V", "um", "gain.csv")
    found = fj.compare(["gain", "creep"], CREEP, holdout=other, **OPTIONS)
    assert found.best == found.best_unseen == "gain"
    assert found.rows[0].bic > found.rows[1].bic
    (sentence,) = found.refuted
    assert sentence.startswith("creep has a smaller BIC, and predicts data held out with an error")
    assert fit_sentence(found.fits).startswith("gain")
    assert "best of 2 models on data held out" in fit_sentence(found.fits)
    assert found.summary().startswith("2 models compared: best on data held out is gain.")
    assert sentence in f"{found.summary()}".replace("\n", " ")


def test_a_mode_beyond_half_the_rate_has_no_interval():
    """It is a delay to the recording, which gives its frequency a small error all the same."""
    times = np.arange(40_000) / 20_000
    drive = np.cumsum(np.random.default_rng(3).normal(size=400)).repeat(100)
    drive = gaussian_filter1d(drive, 30.0)
    turn = 2 * np.pi * 900
    response = lsim(([turn**2], [1, 0.3 * turn, turn**2]), drive, times)[1]
    recording = fj.Recording(drive[::20], response[::20] + 1e-4 * NOISE[:2000], 1e-3, "V", "um")
    found = fj.fit("gain >> resonance", recording).parameters["resonance.frequency"]
    assert found.value > 500
    assert found.standard_error < 0.5 * found.value
    assert not found.identified
    assert estimate_row(found)["interval"] == "–"


def test_a_stretch_is_predicted_without_having_been_seen():
    """A response spoilt in one stretch only: the other folds' errors stay as they are, and the
    spoilt one's is what was put in, not what a fit would have made of it."""
    response = CREEP.response.copy()
    response[60:90] += 1.0  # the third of twenty stretches, in the third fold
    spoilt = fj.Recording(DRIVE, response, STEP, "V", "um")
    folds = unseen(fj.compare([fj.parse_model("creep")], spoilt, **OPTIONS)).folds
    assert np.argmax(folds) == 2
    assert folds[2] == pytest.approx(np.sqrt(30 / 120), rel=0.1)


def test_nothing_to_compare_is_refused():
    with pytest.raises(fj.InputError, match="expected at least one model"):
        fj.compare([], CREEP)


def test_the_memory_of_a_residual_is_that_of_its_autocorrelation():
    noise = np.random.default_rng(1).standard_normal(20_000)
    slow = np.asarray(lfilter([1.0], [1.0, -0.9], noise))
    # 0.9^k is below a tenth from k = 22 on; an offset is no memory.
    assert 17 <= _correlation_length(slow) <= 27
    assert _correlation_length(noise + 50) <= 2


def test_beside_a_stretch_set_aside_as_much_is_left_out_as_the_residual_remembers():
    drive = np.random.default_rng(2).standard_normal(1200)
    take = prepare([fj.Recording(drive, drive, STEP, "V", "um")], history="constant").takes[0]
    slow = np.asarray(lfilter([1.0], [1.0, -0.8], np.random.default_rng(3).standard_normal(1200)))
    gap = _correlation_length(slow)
    assert 5 < gap < 20
    of, near = _folds(take, slow)
    for fold, left_out in enumerate(near):
        distances = np.abs(np.arange(1200)[:, None] - np.flatnonzero(of == fold)).min(axis=1)
        assert np.array_equal(left_out, distances <= gap)


def test_stretches_set_aside_are_whole_periods_from_two_in_each_fold_on():
    def changes(periods: int) -> np.ndarray:
        drive = 50 + 40 * np.sin(2 * np.pi * periods * np.arange(1200) / 1200)
        take = prepare([fj.Recording(drive, drive, STEP, "V", "um")], history="constant").takes[0]
        assert take.recording.drive_period() is not None
        of, near = _folds(take, np.random.default_rng(0).standard_normal(1200))
        assert near.shape == (5, 1200)
        return np.flatnonzero(np.diff(of)) + 1

    assert np.all(changes(10) % 120 == 0)
    assert np.all(changes(12) % 100 == 0)
    assert np.array_equal(changes(8), np.arange(60, 1200, 60))
