"""Play operators of a curve: against plays sample by sample, and properties of their loops."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
from fracjax import blocks
from fracjax._operators import Grid
from tests.helpers import close, respond

STEP, LOW, HIGH = 1e-2, 10.0, 90.0
SHARES = np.array([0, 2, 3.5, 5.5, 8, 11, 14.5, 18.5, 23, 28, 34, 41, 48]) / 100
WEIGHTS = np.array([0.5, 0.1, -0.05, 0.1, 0, 0.2, 0.1, 0.05, 0.1, 0.1, -0.02, 0.03, 0.1])


def drive_of(seed: int) -> np.ndarray:
    """A walk (300,) that leaves the span of 10 to 90 V at both ends and returns to its start."""
    walk = np.cumsum(np.random.default_rng(seed).normal(0, 1, 300))
    walk -= np.linspace(0, walk[-1] - walk[0], 300)
    return 50 + 60 * walk / np.abs(walk).max()


def curve(drive: np.ndarray, q: float) -> np.ndarray:
    """The parabola between 10 and 90 V, by its tangents beyond."""
    inside = np.minimum(np.maximum(drive, LOW), HIGH)
    parabola = inside + q * (inside - 50) ** 2 / 80
    return parabola + (1 + 2 * q * (inside - 50) / 80) * (drive - inside)


def by_samples(drive: np.ndarray, q: float, start: float) -> np.ndarray:
    """The response (N,) from plays that rest at the curve of `start`, sample by sample."""
    zero = curve(np.zeros(1), q)[0]
    response = np.zeros(drive.size)
    for weight, radius in zip(WEIGHTS, SHARES * (HIGH - LOW), strict=True):
        state = curve(np.array([start]), q)[0] - zero
        for n, value in enumerate(curve(drive, q) - zero):
            state = min(max(state, value - radius), value + radius)
            response[n] += weight * state
    return response


@settings(max_examples=15)
@given(st.floats(-0.9, 0.9), st.integers(0, 1000), st.sampled_from(["rest", "constant"]))
def test_it_is_plays_sample_by_sample(q, seed, history):
    drive = drive_of(seed)
    block = blocks.PrandtlIshlinskii(WEIGHTS, q, low=LOW, high=HIGH)
    start = 0.0 if history == "rest" else drive[0]
    close(respond(block, drive, Grid(STEP, history)), by_samples(drive, q, start), 1e-12)


def test_at_rest_without_drive_the_response_is_zero():
    block = blocks.PrandtlIshlinskii(WEIGHTS, 0.6, low=LOW, high=HIGH)
    assert np.abs(respond(block, np.zeros(20), Grid(STEP, "rest"))).max() < 1e-14


@pytest.mark.parametrize("q", [0.0, 0.5])
def test_loops_are_symmetric_without_a_curve_alone(q):
    angles = 2 * np.pi * np.arange(200) / 200
    block = blocks.PrandtlIshlinskii(WEIGHTS, q, low=LOW, high=HIGH)
    loop = respond(block, 50 + 40 * np.cos(angles), Grid(STEP, "periodic"))
    # Half a period later, the loop of a classical operator is its own image through the centre.
    skew = np.abs(loop + np.roll(loop, 100) - loop.max() - loop.min()).max()
    assert (skew < 1e-12 * np.ptp(loop)) == (q == 0)
    assert q == 0 or skew > 0.02 * np.ptp(loop)


@pytest.mark.parametrize("q", [0.0, -0.7])
def test_after_a_turn_the_slopes_are_the_sums_of_the_weights(q):
    block = blocks.PrandtlIshlinskii(WEIGHTS, q, low=LOW, high=HIGH)
    down = np.linspace(90, 10, 8001)
    drive = np.concatenate([np.linspace(10, 90, 8001), down[1:]])
    response = respond(block, drive, Grid(STEP, "constant"))[8000:]
    slopes = np.diff(response) / np.diff(curve(down, q))
    back = np.abs(curve(down, q) - curve(down, q)[0])
    edges = np.append(2 * SHARES * (HIGH - LOW), np.inf)
    for k, slope in enumerate(np.cumsum(WEIGHTS)):
        inside = (back[:-1] > edges[k]) & (back[1:] < edges[k + 1])
        assert inside.any()
        np.testing.assert_allclose(slopes[inside], slope, rtol=1e-7)
    np.testing.assert_allclose(block.slopes, np.cumsum(WEIGHTS))


def test_by_name_its_radii_span_the_drive_of_the_recording():
    recording = fj.Recording(drive_of(1), drive_of(2), STEP, "V", "um")
    ends = recording.drive.min(), recording.drive.max()
    named = fj.fit("prandtl_ishlinskii", recording, starts=1, noise="1 um").model.parameters
    np.testing.assert_allclose(named["ends"].value, ends)
    np.testing.assert_allclose(named["radii"].value, SHARES * (ends[1] - ends[0]))
    nominal = fj.parse_model("prandtl_ishlinskii")
    assert nominal.parameters["ends"].value.tolist() == [0, 100]
    assert fj.Model(nominal.block).name == "prandtl_ishlinskii"


def test_another_number_of_weights_is_refused():
    with pytest.raises(fj.InputError, match=r"expected 13 weights.* found .*\(12,\)"):
        blocks.PrandtlIshlinskii(WEIGHTS[1:], low=LOW, high=HIGH)
