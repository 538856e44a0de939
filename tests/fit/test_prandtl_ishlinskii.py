"""Fits of play operators: to plays sample by sample, and to a Preisach plane, which is none."""

import numpy as np
import pandas as pd
import pytest

import fracjax as fj
from benchmarks.real.piezo_dbo import PERIOD, unseen_rmse
from fracjax import blocks
from tests.helpers import by_name, specified

STEP = 5e-3
TIMES = STEP * np.arange(900)
DRIVE = 50 + 45 * np.sin(2 * np.pi * 1.1 * TIMES) * np.cos(2 * np.pi * 0.13 * TIMES)
LOW, HIGH = DRIVE.min(), DRIVE.max()
RADII = np.array([0, 2, 3.5, 5.5, 8, 11, 14.5, 18.5, 23, 28, 34, 41, 48]) / 100 * (HIGH - LOW)
WEIGHTS = np.array([60, 8, 6, 7, 5, 4, 5, 3, -2, 3, 2, 3, 2]) * 1e-3  # um/V
Q = -0.2
SIGMA = 0.01  # um


def plays(signal: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Play operators (N, R), sample by sample, all at the first value before it."""
    states = np.full(radii.size, signal[0])
    return np.stack([states := np.clip(states, u - radii, u + radii) for u in signal])


def truth(drive: np.ndarray) -> np.ndarray:
    """The response (N,) to a drive within the span."""
    centre, span = (LOW + HIGH) / 2, HIGH - LOW
    return plays(drive + Q * (drive - centre) ** 2 / span, RADII) @ WEIGHTS


CLEAN = truth(DRIVE)


def recording(seed: int) -> fj.Recording:
    noise = np.random.default_rng(seed).normal(0, SIGMA, CLEAN.size)
    return fj.Recording(DRIVE, CLEAN + 3.0 + noise, STEP, "V", "um", source=f"recording {seed}")


def fitted(seed: int) -> fj.Fit:
    return fj.fit("prandtl_ishlinskii", recording(seed), noise=specified(SIGMA), starts=2)


def test_weights_and_curve_are_recovered_within_their_standard_errors():
    values = {f"weights[{k}]": w for k, w in enumerate(WEIGHTS)} | {"q": Q}
    deviations = []
    for seed in range(12):
        fit = fitted(seed)
        assert fit.converged
        assert fit.scores.rmse == pytest.approx(SIGMA, rel=0.08)
        estimates = by_name(fit)
        assert estimates.keys() == values.keys()
        deviations += [
            (estimates[n].value - value) / estimates[n].standard_error
            for n, value in values.items()
        ]
    inside = np.mean(np.abs(deviations) < 1.96)
    # 168 intervals of 95 %, which are correlated within a fit.
    assert 0.88 <= inside <= 0.995
    assert 0.8 < np.std(deviations) < 1.2


def test_tables_show_the_radii_and_sum_what_the_recording_does_not_tell_apart():
    fit = fitted(0)
    shown = [each for each in fit.shown_estimates if each.path.startswith("weights")]
    assert len(shown) < len(WEIGHTS)
    assert all(each.value > 2 * each.standard_error for each in shown)
    assert sum(each.value for each in shown) == pytest.approx(
        sum(each.value for name, each in by_name(fit).items() if name != "q")
    )
    assert f"radius {RADII[1]:.3g} V" in f"{fit.summary()}"
    # The eighth weight is below zero: it is part of a sum, whose error is that of the sum.
    (pool,) = (each for each in shown if "…8]" in each.name or "[8…" in each.name)
    assert pool.standard_error < by_name(fit)["weights[8]"].standard_error * 2


def test_a_saved_fit_keeps_the_radii_of_its_own_block(tmp_path):
    own = blocks.PrandtlIshlinskii(WEIGHTS, low=-20.0, high=160.0)
    fit = fj.fit(fj.Model(own), recording(0), noise=specified(SIGMA), starts=1)
    fit.save(tmp_path / "fit.json")
    again = fj.load_model(tmp_path / "fit.json")
    one, other = (fj.simulate(m, DRIVE[::3], STEP).response for m in (fit.model, again))
    np.testing.assert_array_equal(one, other)


def test_each_recording_of_a_batch_has_radii_over_its_own_drive(tmp_path):
    half = fj.Recording(
        25 + 0.5 * (DRIVE - 50), 0.5 * recording(1).response, STEP, "V", "um", source="half"
    )
    options = {"out": tmp_path, "starts": 1, "noise": f"{SIGMA} um"}
    table = fj.fit_batch("prandtl_ishlinskii", [recording(0), half], **options)
    assert isinstance(table, pd.DataFrame)
    assert list(table["status"]) == ["fitted", "fitted"]
    for k, weight in enumerate(WEIGHTS):
        errors = np.asarray(table[f"weights[{k}].standard_error"])
        assert np.all(np.abs(np.asarray(table[f"weights[{k}].value"]) - weight) < 4 * errors)


def test_it_is_a_part_of_compositions():
    model = fj.parse_model("drive_lag >> prandtl_ishlinskii >> creep + resonance")
    assert model.parameters["first.second.weights"].gain
    response = fj.simulate(model, DRIVE, STEP).response
    assert np.isfinite(response).all()
    assert np.ptp(response) > 1.0


# Data of another law ------------------------------------------------------------------------------


def preisach(drive: np.ndarray, seed: int, count: int = 200) -> np.ndarray:
    """A Preisach plane (N,): relays of a random smooth density, all down before the first sample.

    The plane is a little wider than the drive; the response spans about 10 um.
    """
    generator = np.random.default_rng(seed)
    levels = np.linspace(0, 100, count)
    up, down = (a.ravel() for a in np.meshgrid(levels, levels, indexing="ij"))
    up, down = up[up > down], down[up > down]
    width, middle = (up - down) / 100, (up + down) / 200
    density = np.exp(-width / generator.uniform(0.08, 0.25))
    for centre in generator.uniform(0, 1, 3):
        density += generator.uniform(0, 1) * np.exp(-(((middle - centre) / 0.2) ** 2) - 6 * width)
    state = np.zeros(up.size)
    total = np.empty(drive.size)
    for n, u in enumerate(drive):
        state[u >= up], state[u <= down] = 1.0, 0.0
        total[n] = density @ state
    return 0.05 * drive + 7 * total / density.sum()


def held_out_error(name: str, seed: int) -> float:
    """The rms error [um] on cycles that decay, after a fit to a plane's beating ones."""
    unseen = 50 + 45 * np.sin(2 * np.pi * 0.7 * TIMES) * (1 - TIMES / 6)
    drive = np.concatenate([DRIVE, unseen])
    response = preisach(drive, seed)
    noise = np.random.default_rng(seed).normal(0, SIGMA, DRIVE.size)
    measured = fj.Recording(DRIVE, response[: DRIVE.size] + noise, STEP, "V", "um")
    model = fj.fit(name, measured, history="constant", starts=4).model
    error = response - fj.simulate(model, drive, STEP).response
    return float(np.std(error[DRIVE.size :]))


@pytest.mark.slow
def test_preisach_planes_are_predicted_better_than_by_bouc_wen():
    names = "prandtl_ishlinskii", "bouc_wen"
    errors = np.array([[held_out_error(name, seed) for name in names] for seed in range(4)])
    ratios = errors[:, 0] / errors[:, 1]
    # Where a plane is nearly symmetric and exponential, Bouc–Wen is as good.
    assert np.exp(np.mean(np.log(ratios))) < 0.7
    assert ratios.max() < 1.2


@pytest.mark.slow
def test_nested_loops_of_a_real_actuator_are_predicted_better_than_by_foh(data_folder):
    steady, nested = (
        fj.read(data_folder / "piezo_dbo" / name, input=0, output=4, rate=200)
        for name in ("Model_Vi_Do.dat", "Test_Vi_Do_Di.dat")
    )
    fits = {
        name: fj.fit(name, steady, history="constant", settling=PERIOD, starts=2)
        for name in ("foh", "prandtl_ishlinskii")
    }
    unseen = {
        name: unseen_rmse(nested.response, fj.simulate(f.model, nested.drive, nested.dt).response)
        for name, f in fits.items()
    }
    assert fits["prandtl_ishlinskii"].scores.rmse < 0.75 * fits["foh"].scores.rmse
    assert unseen["prandtl_ishlinskii"] < 0.65 * unseen["foh"]
