"""The tests on what a fit leaves over: silent on noise, loud on faults, and as peers compute."""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import norm

import fracjax as fj
from fracjax._fit._whiteness import LAGS, ResidualAnalysis, analyse_whitened

SAMPLES, STEP = 2000, 1e-3
STEPS = np.random.default_rng(9).standard_normal(SAMPLES)
DRIVE = np.convolve(np.cumsum(STEPS), np.ones(200) / 200, "same")
ALL = np.ones(SAMPLES, bool)


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(SAMPLES)


def analyse(residual: np.ndarray, counted: np.ndarray = ALL, drive=DRIVE) -> ResidualAnalysis:
    return analyse_whitened(residual, counted, drive, STEP, "loop.csv")


def p_values(found: ResidualAnalysis) -> dict[str, float]:
    return {
        "white": found.p_white,
        "drive": found.p_drive,
        "normal": found.p_normal,
        "even": found.p_even,
    }


def test_on_noise_all_is_well_and_the_p_values_are_uniform():
    draws = [p_values(analyse(noise(seed))) for seed in range(40)]
    for name in draws[0]:
        drawn = np.array([draw[name] for draw in draws])
        # 40 uniform draws: the mean is 0.5 ± 0.046, below 0.1 there are 4 ± 2.
        assert abs(drawn.mean() - 0.5) < 0.18, name
        assert np.sum(drawn < 0.1) <= 12, name


def test_findings_on_noise_are_plain():
    told = analyse(noise(1)).findings
    assert [t.split(" (")[0] for t in told] == [
        "The residual is white",
        "It is not correlated with the drive",
        "Its distribution is normal",
        "Its standard deviation is constant",
    ]


def _lagged(e: np.ndarray) -> np.ndarray:
    return (e + 0.3 * np.roll(e, 1)) / np.sqrt(1.09)


def _following(e: np.ndarray) -> np.ndarray:
    # Ten samples after the drive, a twenty-fifth of the noise's power.
    return e + 0.2 * (np.roll(DRIVE, 10) - DRIVE.mean()) / DRIVE.std()


def _skewed(e: np.ndarray) -> np.ndarray:
    return (np.exp(0.3 * e) - np.exp(0.045)) / 0.3


def _growing(e: np.ndarray) -> np.ndarray:
    return e * np.linspace(0.7, 1.3, SAMPLES)


@pytest.mark.parametrize(
    ("fault", "name"),
    [(_lagged, "white"), (_following, "drive"), (_skewed, "normal"), (_growing, "even")],
)
def test_each_fault_is_seen_by_its_own_test(fault, name):
    found = p_values(analyse(fault(noise(3))))
    assert found[name] < 1e-4
    # What goes with a slow drive is not white either.
    blind = {name, "white"} if name == "drive" else {name}
    assert all(p > 1e-3 for other, p in found.items() if other not in blind), found


def test_autocorrelation_is_the_direct_sum():
    e = noise(4)
    found = analyse(_lagged(e))
    centred = _lagged(e) - _lagged(e).mean()
    wanted = [
        centred[k:] @ centred[: SAMPLES - k] / (centred @ centred) for k in range(1, LAGS + 1)
    ]
    np.testing.assert_allclose(found.autocorrelation, wanted, atol=1e-12)
    assert found.band == pytest.approx(norm.ppf(0.995) / np.sqrt(SAMPLES), rel=1e-3)
    assert found.autocorrelation[0] > 4 * found.band


def test_cross_correlation_says_who_follows_whom():
    """A white drive whose tenth-last sample is in the residual: one peak, at lag +10."""
    drive = noise(5)
    found = analyse(noise(6) + 0.5 * np.roll(drive, 10), drive=drive)
    assert np.argmax(np.abs(found.cross_correlation)) == LAGS + 10
    outside = np.abs(np.delete(found.cross_correlation, LAGS + 10)) > found.cross_band
    assert outside.sum() <= 3
    assert found.cross_band == pytest.approx(2.576 / np.sqrt(SAMPLES), rel=0.3)


def test_the_band_of_the_cross_correlation_holds_for_colours():
    """Drive and residual slow both: at lag 0 they correlate far beyond white bands by chance."""

    def slow(seed):
        return np.convolve(noise(seed), np.ones(40) / 40, "same")

    found = [analyse(slow(seed), drive=slow(1000 + seed)) for seed in range(30)]
    beyond = np.mean([abs(f.cross_correlation[LAGS]) > f.cross_band for f in found])
    assert beyond <= 0.1
    white = np.mean([abs(f.cross_correlation[LAGS]) > f.band for f in found])
    assert white > 0.3


def test_samples_left_out_are_left_out():
    residual, counted = noise(7), ALL.copy()
    counted[1000:1200] = False
    residual[1000:1200] = 50.0
    found = analyse(residual, counted)
    assert found.residual.size == SAMPLES - 200
    assert found.times[1000] == pytest.approx(1.2)
    assert min(p_values(found).values()) > 1e-3


def test_spreads_are_those_of_the_stretches():
    found = analyse(_growing(noise(8)))
    parts = np.split(_growing(noise(8)), 20)
    np.testing.assert_allclose(found.spreads, [part.std() for part in parts], rtol=1e-12)
    np.testing.assert_allclose(found.edges, np.linspace(0, SAMPLES * STEP, 21), atol=1e-9)


@pytest.fixture(scope="module")
def recording() -> fj.Recording:
    times = 2e-3 * np.arange(800)
    drive = 40 + 15 * np.sin(2 * np.pi * 1.3 * times) + 10 * np.sin(2 * np.pi * 4.1 * times + 1)
    block = fj.parse_model("creep").with_values({"k_c": 0.08, "mu": 0.02}).block
    response = np.asarray(block(jnp.asarray(drive), fj.Grid(2e-3)))
    return fj.Recording(drive, response + 0.01 * noise(2)[:800], 2e-3, "V", "um")


def test_a_fit_is_analysed_recording_by_recording(recording):
    sigma = fj.Noise(0.01, "um", "specification", np.ones(1), 0.01)
    options = {"noise": sigma, "starts": 1, "history": "constant"}
    found = fj.fit(fj.parse_model("creep"), [recording, recording], **options)
    one, other = fj.analyse_residuals(found)
    assert isinstance(one, fj.ResidualAnalysis)
    np.testing.assert_allclose(one.residual, other.residual)
    assert np.std(one.residual) == pytest.approx(1.0, rel=0.05)
    assert min(p_values(one).values()) > 1e-3
    told = json.loads(json.dumps(one.to_dict()))
    assert told["findings"] == list(one.findings)
    # The order of the creep held where it is wrong: what is left goes with the drive.
    wrong = fj.fit(fj.parse_model("creep"), recording, fixed={"mu": 0.06}, **options)
    (bad,) = fj.analyse_residuals(wrong)
    assert bad.p_drive < 1e-6
    assert bad.p_white < 1e-6
    assert any("is correlated with the drive" in text for text in bad.findings)


def test_coloured_noise_is_white_once_whitened(recording):
    """AR(1) noise given with its filter: the tests are on the innovations."""
    white = noise(11)[:800]
    coloured = np.zeros(800)
    for t in range(1, 800):
        coloured[t] = 0.8 * coloured[t - 1] + 0.01 * white[t]
    clean = recording.response - 0.01 * noise(2)[:800]
    known = fj.Noise(coloured.std(), "um", "specification", np.array([1.0, -0.8]), 0.01)
    found = fj.fit(
        fj.parse_model("creep"),
        fj.Recording(recording.drive, clean + coloured, 2e-3, "V", "um"),
        noise=known, starts=1, history="constant",
    )  # fmt: skip
    (analysis,) = fj.analyse_residuals(found)
    assert analysis.p_white > 1e-3
    assert np.std(analysis.residual) == pytest.approx(1.0, rel=0.1)
