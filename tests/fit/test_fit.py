"""Fitting: recovery from a truth of other numerics, honest intervals, and what a fit keeps to."""

import json
import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from benchmarks.concealed.truth import BASES, OVER
from fracjax._fit import _programs, other_histories, prepare, solve_from, take_of
from fracjax._fit._programs import make_room
from fracjax._fit._solve import starts_of
from fracjax._operators._grid import History
from tests.helpers import by_name, specified

STEP = 2e-3
SAMPLES = 1200
LAW = {"alpha": 0.14, "beta": -0.13, "k_l": 0.07, "k_h": 0.04, "k_p": 1.5e-4}
STARTS = 2


def several_tones(times: np.ndarray) -> np.ndarray:
    """A drive [V] of three frequencies."""
    parts = ((15, 1.3, 0.0), (10, 4.1, 1.0), (6, 11.7, 2.0))
    return 40 + np.sum([a * np.sin(2 * np.pi * f * times + p) for a, f, p in parts], axis=0)


def truth(drive_of, law: dict[str, float], base: str = "foh") -> tuple[np.ndarray, np.ndarray]:
    """Drive [V] and displacement [um] at the samples, simulated on a grid 32 times finer."""
    fine = drive_of(np.arange((SAMPLES - 1) * OVER + 1) * STEP / OVER)
    return fine[::OVER], BASES[base].response(fine, STEP / OVER, law)[::OVER]


def white(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SAMPLES)


DRIVE, CLEAN = truth(several_tones, LAW)
SIGMA = 1e-3 * np.ptp(CLEAN)
KNOWN = specified(SIGMA)


def record(seed: int, offset: float = 1.0) -> fj.Recording:
    return fj.Recording(DRIVE, CLEAN + offset + SIGMA * white(seed), STEP)


def fit_foh(recording: fj.Recording, **options) -> fj.Fit:
    options = {"noise": KNOWN, "starts": STARTS} | options
    return fj.fit(fj.parse_model("foh"), recording, **options)


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
    other = fj.Recording(DRIVE, CLEAN, STEP, response_unit="nm", source="other")
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
        recordings.append(fj.Recording(drive, clean + 5e-4 * white(seed), STEP))
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
    assert content["noise"] == {"sigma": SIGMA, "unit": "um", "method": "specification"}
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
    recording = fj.Recording(drive, response + noise, 1e-2)
    return fj.fit(fj.parse_model("foh"), recording, fixed={"k_p": 0.0, "beta": 0.1}, starts=STARTS)


def test_steady_cycles_are_taken_as_periodic(one_sine):
    assert one_sine.to_dict()["assumptions"] == [{"history": "periodic", "settling_samples": 0}]
    assert one_sine.scores.rmse == pytest.approx(5e-3, rel=0.05)


def test_one_sine_leaves_the_gains_known_only_together(one_sine):
    assert any("k_l and k_h" in pair for pair in one_sine.correlated)
    assert not by_name(one_sine)["k_l"].identified
    assert not by_name(one_sine)["k_h"].identified
    assert by_name(one_sine).keys() == {"alpha", "k_l", "k_h"}


def test_an_estimated_past_explains_what_a_recording_cut_out_of_motion_remembers():
    """The second half of a burst and three tones, for a law without the rate term."""

    def drive_of(t):
        return several_tones(np.maximum(t - 1.0, 0.0)) + 30 * np.sin(2 * np.pi * t) ** 2 * (t < 1.0)

    law = LAW | {"k_p": 0.0}
    drive, clean = truth(drive_of, law)
    cut = fj.Recording(drive[500:], clean[500:] + SIGMA * white(3)[500:], STEP)
    model = fj.parse_model("foh")
    held, estimated = (
        fj.fit(
            model,
            cut,
            noise=KNOWN,
            history=past,
            settling=0,
            starts=STARTS,
            fixed={"k_p": 0.0, "beta": -0.1},
        )
        for past in ("constant", "estimated")
    )
    assert held.scores.rmse > 1.5 * SIGMA
    assert estimated.scores.rmse == pytest.approx(SIGMA, rel=0.1)
    alpha = next(e for e in estimated.estimates if e.name == "alpha")
    assert abs(alpha.value - law["alpha"]) < 4 * alpha.standard_error
    assert estimated.to_dict()["assumptions"][0]["history"] == "estimated"


def test_programs_are_forgotten_before_the_process_runs_out_of_maps(tmp_path, monkeypatch):
    compiled = jax.jit(lambda x: x + 1)
    compiled(1.0)
    make_room()
    assert compiled._cache_size() == 1  # type: ignore[attr-defined]
    (tmp_path / "limit").write_text("100\n")
    _programs._look.cache_clear()
    monkeypatch.setattr(_programs, "_LIMIT", tmp_path / "limit")
    make_room()
    assert compiled._cache_size() == 0  # type: ignore[attr-defined]
    monkeypatch.setattr(_programs, "_MAPS", tmp_path / "no such system")
    _programs._look.cache_clear()
    make_room()


def test_a_second_gain_in_a_row_is_fitted_too():
    """It can no longer be eliminated, and has no bounds; the data know only its product with the
    first, which the fit says."""
    found = fj.fit(fj.parse_model("foh >> lfdh"), record(5), noise=KNOWN, starts=1)
    assert found.scores.rmse == pytest.approx(SIGMA, rel=0.1)
    assert "second.k_0" in {e.name for e in found.estimates}
    assert "first.k_l" in {e.name for e in found.estimates if not e.identified}


def test_a_bound_on_one_side_is_refused():
    with pytest.raises(ValueError, match="expected two finite bounds or none"):
        fj.Parameter(1.0, "V", lower=0.0)


class Steep(fj.AbstractBlock):
    """A law whose derivative is of the order of 1e200, as Bouc–Wen's may be far from its range."""

    q: fj.Parameter

    def __init__(self):
        self.q = fj.Parameter(0.5, lower=0.0, upper=1.0)

    @property
    def linear(self) -> bool:
        return True

    def __call__(self, drive, grid):
        return drive * (1 + 1e-3 * jnp.sin(1e200 * self.q.value))


def test_a_derivative_near_overflow_does_not_stop_a_search():
    recording = fj.Recording(DRIVE, 1.2 * DRIVE + SIGMA * white(0), STEP)
    preparation = prepare([recording], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        found = solve_from([fj.blocks.Creep() >> Steep()], preparation)
    assert np.isfinite(found.cost)


def test_starts_side_by_side_end_where_they_end_one_after_the_other(monkeypatch):
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        found = {}
        for cores in (1, 4):
            monkeypatch.setattr(os, "cpu_count", lambda cores=cores: cores)
            found[cores] = solve_from(starts_of(block, 6, 0), preparation)
    assert found[1].start_costs == found[4].start_costs
    np.testing.assert_array_equal(found[1].simulations[0], found[4].simulations[0])


def test_starts_that_come_to_one_place_go_on_as_one():
    """Of a start given twice the second stops after its first looks, and is no worse for it."""
    block = fj.parse_model("foh >> creep").block
    preparation = prepare([record(0)], noise=KNOWN, history="constant")
    with jax.enable_x64(True):
        once, twice = (solve_from([block] * times, preparation) for times in (1, 2))
    assert once.evaluations > 10
    assert once.evaluations < twice.evaluations <= once.evaluations + 6
    assert twice.cost == once.cost


def test_of_steady_cycles_whole_periods_count_and_all_of_them():
    times = np.arange(1100) * STEP
    drive = 40 + 30 * np.sin(2 * np.pi * times / 0.4)  # 5.5 periods of 200
    response = 0.1 * drive + SIGMA * np.random.default_rng(0).standard_normal(1100)
    recording = fj.Recording(drive, response, STEP)
    taken = prepare([recording], history="periodic").takes[0]
    assert len(taken.recording) == taken.used.size == 1000
    assert taken.used.all()
    weighed = prepare([recording], history="periodic", weights=times > 0.1).takes[0]
    assert weighed.roots is not None
    assert weighed.used.size == weighed.roots.size == 1000
    assert np.count_nonzero(~weighed.used) == 51


# One period of steady motion ----------------------------------------------------------------------


def one_period(history: History, seed: int = 0) -> fj.Recording:
    """FOH under ten tones of random phase, one period long, with noise."""
    generator = np.random.default_rng(seed)
    times = np.arange(512) * STEP
    tones = np.arange(1, 11)[:, None]
    phases = generator.uniform(0, 2 * np.pi, (10, 1))
    drive = 40 + 8 * np.sum(np.cos(2 * np.pi * tones * times / (512 * STEP) + phases), axis=0)
    response = fj.simulate("foh", drive, STEP, history).response
    return fj.Recording(drive, response + SIGMA * generator.standard_normal(512), STEP)


@pytest.mark.parametrize("history", ["periodic", "constant"])
def test_one_period_tells_whether_it_had_run_before(history):
    """Its drive ends where it began either way; its response only where it had."""
    fit = fit_foh(one_period(history))
    assert fit.to_dict()["assumptions"][0]["history"] == history
    assert fit.scores.rmse == pytest.approx(SIGMA, rel=0.1)


def two_cycles(model: str, history: History, tones: int, seed: int, wandering=0.0) -> fj.Recording:
    """A model and a mode just above so many tones, two periods, the noise perhaps wandering off."""
    generator = np.random.default_rng(seed)
    times = np.arange(1024) * STEP
    of_tone = 2 * np.pi * np.arange(1, tones + 1)[:, None] / (512 * STEP)
    phases = generator.uniform(0, 2 * np.pi, (tones, 1))
    waves = np.cos(of_tone * times + phases)
    drive = 40 + 8 * np.sum(waves, axis=0) / np.sqrt(tones / 10)
    mode = {"second.frequency": 1.1 * tones / (512 * STEP), "second.damping": 0.02}
    law = fj.parse_model(f"{model} >> resonance").with_values(mode)
    noise = SIGMA * generator.standard_normal(1024)
    noise += wandering * SIGMA * np.cumsum(generator.standard_normal(1024))
    return fj.Recording(drive, fj.simulate(law, drive, STEP, history).response + noise, STEP)


@pytest.mark.parametrize(
    ("model", "history", "tones", "seed", "wandering"),
    [
        # The least residual of these had spoken for the other.
        ("lfdh", "periodic", 64, 2, 0.0),
        ("lfdh", "constant", 40, 1, 0.0),
        ("lfdh", "constant", 64, 3, 0.0),
        # A law that foretells no change leaves both as they are: that one begins otherwise counts.
        ("foh", "constant", 20, 1, 0.0),
        ("foh", "periodic", 20, 1, 0.2),
        ("foh", "constant", 20, 2, 0.2),
    ],
)
def test_two_cycles_tell_whether_it_had_run_before_whatever_the_law_misses(
    model, history, tones, seed, wandering
):
    """It misses a mode in both of them, by far more than what their start could add."""
    recording = two_cycles(model, history, tones, seed, wandering)
    fit = fj.fit(fj.parse_model(model), recording)
    assert fit.scores.rmse > 20 * SIGMA
    assert fit.to_dict()["assumptions"][0]["history"] == history


def test_the_period_of_a_drive():
    """By three repeats, or by one other that fills the recording."""
    recording = two_cycles("lfdh", "periodic", 20, 0)
    assert take_of(recording, None, None, None).period == 512
    assert take_of(recording.window(0, 1000), None, None, None).period is None
    assert take_of(one_period("periodic"), None, None, None).period is None
    times = np.arange(1100) * STEP
    sine = fj.Recording(np.sin(2 * np.pi * times / 0.4), times, STEP)
    assert take_of(sine, None, None, None).period == 200


def test_one_period_of_steady_motion_may_be_told():
    recording = one_period("periodic")
    taken = prepare([recording], history="periodic").takes[0]
    assert (taken.history, taken.used.sum()) == ("periodic", 512)
    with pytest.raises(fj.InputError, match=r"expected a drive that repeats.*or one period"):
        prepare([recording.window(0, 400)], history="periodic")


def test_a_drive_that_begins_at_rest_is_no_period():
    recording = one_period("periodic")
    drive = np.concatenate([np.full(50, recording.drive[0]), recording.drive])
    response = np.concatenate([np.full(50, recording.response[0]), recording.response])
    take = take_of(fj.Recording(drive, response, STEP), None, None, None)
    assert other_histories(take) is None
