"""A law that a user writes is fitted and diagnosed like ours: its truth here is SciPy's."""

import numpy as np
import pytest
from jax import Array
from scipy.signal import lsim

import fracjax as fj

RATE, FINER = 200, 20


class Solid(fj.AbstractLinearBlock):
    """Standard linear solid: G(s) = k (1 + c / (1 + τ s)).  Source: Zener (1948)."""

    k: fj.Parameter = fj.Parameter(0.1, "response/drive", gain=True)
    c: fj.Parameter = fj.Parameter(0.1, lower=1e-3, upper=2.0)
    tau: fj.Parameter = fj.Parameter(0.1, "s", lower=1e-3, upper=10.0, logarithmic=True)

    def symbol(self, s: Array) -> Array:
        return self.k.value * (1 + self.c.value / (1 + self.tau.value * s))

    def static_gain(self) -> Array:
        return self.k.value * (1 + self.c.value)


class Plate(fj.AbstractBlock):
    """A stiffening plate without memory: y = k u (1 + c u).  Source: none, it is a test's."""

    k: fj.Parameter = fj.Parameter(0.1, "response/drive", gain=True)
    c: fj.Parameter = fj.Parameter(1e-3, "1/drive", lower=-0.1, upper=0.1)

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: fj.Grid) -> Array:
        return self.k.value * drive * (1 + self.c.value * drive)


def drive_at(times: np.ndarray) -> np.ndarray:
    """Rest at 50 V, sines of four frequencies and amplitudes with soft ends, rest again."""
    drive = np.full(times.shape, 50.0)
    for start, length, frequency, amplitude in (
        (1, 2, 1, 45),
        (3.2, 2, 3, 30),
        (5.4, 1.5, 8, 20),
        (7.1, 1.2, 20, 12),
    ):
        inside = (times >= start) & (times < start + length)
        turns = (times[inside] - start) / length
        drive[inside] += (
            amplitude * np.sin(np.pi * turns) * np.sin(2 * np.pi * frequency * (turns * length))
        )
    return drive


def recorded(response: np.ndarray, drive: np.ndarray) -> fj.Recording:
    """Every twentieth sample, with noise of 0.05 % of the span."""
    taken = response[::FINER] - response[0]
    noise = np.random.default_rng(7).normal(0, 5e-4 * np.ptp(taken), taken.size)
    return fj.Recording(drive[::FINER], taken + noise, 1 / RATE, source="simulated")


@pytest.fixture(scope="module")
def fine() -> tuple[np.ndarray, np.ndarray]:
    times = np.arange(9 * RATE * FINER) / (RATE * FINER)
    return times, drive_at(times)


def solid(times: np.ndarray, drive: np.ndarray, *, k=0.12, c=0.3, tau=0.2) -> np.ndarray:
    """The truth: SciPy's exact response to straight lines between samples."""
    response = lsim(([k * tau, k * (1 + c)], [tau, 1]), drive - drive[0], times)[1]
    return np.asarray(response)


def test_an_own_law_is_fitted(fine):
    times, drive = fine
    fit = fj.fit(fj.Model(Solid()), recorded(solid(times, drive), drive))
    assert fit.model.name == "Solid"
    for name, truth in (("k", 0.12), ("c", 0.3), ("tau", 0.2)):
        estimate = next(e for e in fit.estimates if e.name == name)
        assert abs(estimate.value - truth) < 4 * estimate.standard_error + 1e-3 * truth


def test_a_complete_own_law_is_let_alone(fine):
    times, drive = fine
    diagnosis = fj.diagnose(fj.Model(Solid()), recorded(solid(times, drive), drive))
    assert diagnosis.verdict == "none"


@pytest.mark.slow
def test_electrostriction_is_found_on_an_own_law(fine):
    times, drive = fine
    square = drive + 0.02 * (drive - 50) ** 2 / np.ptp(drive)
    diagnosis = fj.diagnose(fj.Model(Solid()), recorded(solid(times, square), drive))
    assert [effect.name for effect in diagnosis.effects] == ["electrostriction"]
    # A cube about another point is within a hundredth of what the square explains.
    assert set(diagnosis.effects[0].confusable_with) <= {"cubic_nonlinearity"}
    q = next(p for p in diagnosis.effects[0].parameters if p.name == "q")
    assert abs(q.value - 0.02) < 4 * q.standard_error + 4e-4


@pytest.mark.slow
def test_a_drive_lag_is_found_on_an_own_law_without_memory(fine):
    times, drive = fine
    lagged = np.asarray(lsim(([1.0], [4e-3, 1]), drive - 50, times)[1]) + 50
    diagnosis = fj.diagnose(
        fj.Model(Plate(), "plate"), recorded(0.1 * lagged * (1 + 2e-3 * lagged), drive)
    )
    assert "drive_lag" in {diagnosis.effects[0].name, *diagnosis.effects[0].confusable_with}
    assert diagnosis.held_out.extended_rmse is not None
    assert diagnosis.held_out.extended_rmse < 0.5 * diagnosis.held_out.base_rmse


class Loose(fj.AbstractBlock):
    """A gain, a curvature, and a number that moves nothing, or next to it: of no source."""

    k: fj.Parameter = fj.Parameter(0.1, "response/drive", gain=True)
    c: fj.Parameter = fj.Parameter(1e-3, "1/drive", lower=-0.1, upper=0.1)
    idle: fj.Parameter = fj.Parameter(0.5, lower=0.0, upper=1.0)
    effect: float = 0.0

    @property
    def linear(self) -> bool:
        return False

    def __call__(self, drive: Array, grid: fj.Grid) -> Array:
        moved = self.c.value * drive + self.effect * self.idle.value
        return self.k.value * drive * (1 + moved)


@pytest.mark.parametrize("effect", [0.0, 1e-160, 1e-308])
def test_a_number_that_moves_nothing_is_not_identified(fine, effect):
    drive = fine[1]
    recording = recorded(0.1 * drive * (1 + 2e-3 * drive), drive)
    fit = fj.fit(fj.Model(Loose(effect=effect), name="loose"), recording)
    found = {estimate.name: estimate for estimate in fit.estimates}
    idle, curvature = found["idle"], found["c"]
    assert not idle.identified
    assert idle.standard_error > 1e30
    assert curvature.identified
    assert curvature.value == pytest.approx(2e-3, abs=4 * curvature.standard_error)
