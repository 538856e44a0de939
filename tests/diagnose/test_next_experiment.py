"""The next experiment: drives within the limits, and the one on which look-alikes part."""

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import DriveLag
from fracjax._blocks.creep import LogarithmicCreep
from fracjax._blocks.delay import Delay
from fracjax._blocks.thermal_drift import ThermalDrift
from fracjax._diagnose._next_experiment import (
    LIKELY,
    _most_distinguishing,
    _Trial,
    drives,
    propose,
    rest_samples,
)
from fracjax._parameters import set_values
from fracjax._prepare import Noise, prepare
from fracjax._protocol import Drive, Limits
from fracjax._solve import silent
from tests.helpers import specified

STEP, LEAD = 1e-3, 204
TIMES = STEP * np.arange(4000)


def recording(frequency: float = 1.0) -> fj.Recording:
    drive = 50 - 40 * np.cos(2 * np.pi * frequency * TIMES)
    return fj.Recording(drive, 0.1 * drive, STEP, "V", "um")


@pytest.mark.parametrize("slew", [50.0, 5e3, 1e6])
def test_drives_keep_to_the_limits(slew):
    limits = Limits(-10.0, 70.0, slew)
    candidates = drives(limits, STEP, "V", 20.0, LEAD)
    assert len(candidates) >= (30 if slew > 1e3 else 10)
    assert len({drive.description for drive in candidates}) == len(candidates)
    for drive in candidates:
        assert drive.values.min() >= -10 - 1e-9
        assert drive.values.max() <= 70 + 1e-9
        assert np.abs(np.diff(drive.values)).max() <= slew * STEP * (1 + 1e-9)


def test_drives_are_what_they_say():
    """Without a limit on the slew, from the end of the rest that each begins with."""
    candidates = drives(Limits(-10.0, 70.0, 1e6), STEP, "V", 20.0, LEAD)
    waves = {drive.description: drive.values for drive in candidates}
    assert all(values.size == 4096 + LEAD for values in waves.values())
    moved = {name: (values[LEAD:] - 30) / 40 for name, values in waves.items()}

    def first(words: str) -> np.ndarray:
        return next(values for name, values in moved.items() if words in name)

    def sizes(values: np.ndarray, parts: int) -> np.ndarray:
        return np.array([np.abs(part[4:-4]).max() for part in np.split(values, parts)])

    assert sizes(first("four amplitudes"), 4) == pytest.approx([0.25, 0.5, 0.75, 1.0], abs=0.01)
    decay = first("decaying sine of 31")
    assert sizes(decay, 8) == pytest.approx(1 - np.arange(8) / 8, abs=0.08)
    assert np.ptp(first("over 80 V")) == pytest.approx(2, abs=0.01)
    assert np.ptp(first("over 32 V")) == pytest.approx(0.8, abs=0.01)
    for bias in (-0.6, 0.6):
        about = first(f"V about {30 + 40 * bias:.4g} V")
        assert (about.min(), about.max()) == pytest.approx((bias - 0.4, bias + 0.4), abs=0.01)
    held = first("10 steps")[200::410]
    assert held == pytest.approx([-1, 1, -1, 0, 1, 0, -1, -0.5, 1, -1], abs=1e-9)
    assert np.ptp(first("a rest")[4:]) == pytest.approx(0, abs=1e-9)
    # Every reversal curve starts at the top and turns back sooner than the one before.
    curves = first("reversal curves of 0.977")
    curves = curves[4:]  # behind the way there
    turns = curves[1:-1][(np.diff(curves)[:-1] < 0) & (np.diff(curves)[1:] > 0)]
    assert curves.max() == pytest.approx(1, abs=0.01)
    assert turns[0] == pytest.approx(-1, abs=0.01)
    assert np.all(np.diff(turns) > 0.1)


@pytest.mark.parametrize(("step", "rest"), [(0.1, 204), (1e-3, 204), (5e-4, 400), (1e-5, 1024)])
def test_drives_begin_where_the_recording_did_with_a_rest_and_without_corners(step, rest):
    """The rest is .2 s, but a twentieth to a quarter of the drive; a step takes five samples."""
    for drive in drives(Limits(-10.0, 70.0, 1e9), step, "V", 20.0, rest_samples(step)):
        assert drive.values.size == 4096 + rest
        assert drive.values[: rest - 2] == pytest.approx(20.0)
        assert np.abs(np.diff(drive.values)).max() <= 80 * 6 / 16 + 1e-9
    outside = drives(Limits(-10.0, 70.0, 1e9), step, "V", 90.0, rest_samples(step))[0]
    assert outside.values[0] == pytest.approx(70.0)


def test_a_lag_and_a_delay_part_on_a_fast_drive():
    """On a slow sine the two are one; what tells them apart is ω τ, as high as the slew allows."""
    noise = Noise(0.005, "um", "specification", np.ones(1), 0.005)
    with jax.enable_x64(True):
        preparation = prepare([recording(0.5)], noise=noise, history="constant")
        base = fj.parse_model("foh").block
        rivals = [DriveLag(2e-3) >> base, Delay(2e-3, longest=0.01) >> base]
        said: list[str] = []
        fast = propose(rivals, preparation, Limits(0, 100, 1e5), said.append)
        slow = propose(rivals, preparation, Limits(0, 100, 2.0), said.append)
    assert fast.probability > 0.95
    assert slow.probability < fast.probability
    rate = np.abs(np.diff(fast.drive.values)).max() / STEP
    assert rate > 10 * np.abs(np.diff(slow.drive.values)).max() / STEP
    assert "choosing the next experiment" in said[0]


@pytest.mark.parametrize(("late", "rate"), [(1e-5, 4000), (2e-6, 16000)])
def test_what_shows_above_the_band_is_sought_at_a_higher_rate(late, rate):
    """A lag and a delay part as (ω τ)², and what samples of 1 ms can tell ends at 500 Hz."""
    noise = Noise(0.2, "um", "specification", np.ones(1), 0.2)
    with jax.enable_x64(True):
        preparation = prepare([recording(0.5)], noise=noise, history="constant")
        base = fj.parse_model("foh").block
        rivals = [DriveLag(late) >> base, Delay(late, longest=0.01) >> base]
        proposal = propose(rivals, preparation, Limits(0, 100, 1e9), silent)
    assert proposal.drive.step == pytest.approx(1 / rate)
    assert proposal.drive.description.endswith(f", at {rate} samples/s")
    assert proposal.probability > LIKELY


@pytest.mark.parametrize(("sigma", "rate"), [(0.2, 250), (0.4, 62.5)])
def test_what_shows_after_the_recording_is_sought_at_a_lower_rate(sigma, rate):
    """A creep and a drift, of which four seconds show the beginning: longer holds part them."""
    noise = specified(sigma)
    with jax.enable_x64(True):
        preparation = prepare([recording(0.5)], noise=noise, history="constant")
        base = fj.parse_model("foh").block
        drift = set_values(ThermalDrift(10.0, longest=60.0), {"amplitude": 0.2})
        rivals = [base >> LogarithmicCreep(0.02, 10.0), base + drift]
        proposal = propose(rivals, preparation, Limits(0, 100, 1e5), silent)
    assert proposal.drive.step == pytest.approx(1 / rate)
    assert "steps" in proposal.drive.description
    assert proposal.drive.description.endswith(f", at {rate:g} samples/s")
    assert proposal.probability > LIKELY


def test_two_that_nothing_tells_apart_are_no_reason_to_leave_the_others_together():
    noise = Noise(0.005, "um", "specification", np.ones(1), 0.005)
    with jax.enable_x64(True):
        preparation = prepare([recording(0.5)], noise=noise, history="constant")
        base = fj.parse_model("foh").block
        lag, late = DriveLag(2e-3) >> base, Delay(2e-3, longest=0.01) >> base
        alike = propose([lag, lag, late], preparation, Limits(0, 100, 1e5), silent)
        among = propose([late, lag, lag], preparation, Limits(0, 100, 1e5), silent)
        alone = propose([lag, lag], preparation, Limits(0, 100, 1e5), silent)
    assert (alike.distinguished, alike.all_apart) == ((2,), False)
    assert (among.distinguished, among.all_apart) == ((1, 2), False)
    assert alike.probability == pytest.approx(among.probability)
    assert alike.probability > 0.95
    assert (alone.distinguished, alone.all_apart) == ((1,), True)
    assert alone.probability < 1e-3


def probabilities(*drives: tuple[float, float, float]) -> np.ndarray:
    """Of three rivals, that each drive tells the first from the second and third, and these."""
    return np.array([[[1, a, b], [a, 1, c], [b, c, 1]] for a, b, c in drives])


@pytest.mark.parametrize(
    ("drives", "chosen"),
    [
        # All apart, if that is likely at all.
        ([(0.9, 0.5, 0.4), (0.6, 0.5, 0.5)], (1, (1, 2), True)),
        # Else both from the first, else one of them.
        ([(0.99, 0.4, 0.0), (0.6, 0.5, 0.4)], (1, (1, 2), False)),
        ([(0.1, 0.8, 0.0), (0.7, 0.4, 0.4)], (0, (2,), False)),
        # Else the least unlikely.
        ([(0.1, 0.4, 0.0), (0.1, 0.2, 0.3)], (1, (1, 2), True)),
    ],
)
def test_the_most_telling_drive(drives, chosen):
    assert _most_distinguishing(probabilities(*drives)) == chosen


def test_what_a_drive_would_show_is_told_in_units_of_the_noise():
    """Of a delay and none: the rms of their difference over the noise's, whatever the grid."""
    drive = Drive("sine", 50 + 40 * np.sin(2 * np.pi * 5 * TIMES), STEP)
    sigma, lag = 0.01, 2e-3
    noise = specified(sigma)
    with jax.enable_x64(True):
        block = Delay(lag, longest=0.1)
        late, punctual = (set_values(block, {"delay": d}) for d in (lag, 0.0))
        (gap,) = _Trial(drive, noise, 2).gaps([late, punctual])
    wanted = 0.5 * (40 * 2 * np.sin(np.pi * 5 * lag) / sigma) ** 2
    assert gap == pytest.approx(wanted, rel=0.02)


def test_the_fastest_full_tone_takes_the_slew_that_there_is():
    limits = Limits(-10.0, 70.0, 2e3)
    waves = {d.description: d.values for d in drives(limits, STEP, "V", 20.0, LEAD)}
    full = [v for name, v in waves.items() if name.startswith("a sine") and "over 80 V" in name]
    rates = sorted(np.abs(np.diff(values)).max() / STEP for values in full)
    assert rates[-1] == pytest.approx(limits.slew, rel=0.02)
    # Evenly in their logarithm, from two periods in all on.
    assert len(rates) == 6
    steps = np.diff(np.log(rates))
    assert steps == pytest.approx(np.full(5, steps.mean()), rel=0.05)


def test_a_proposal_states_by_how_much_the_responses_differ():
    """A gain cannot make a lag of a gain: their difference is known in closed form."""
    preparation = prepare([recording()], noise=specified(0.01))
    blocks = [fj.parse_model("gain >> drive_lag").block, fj.parse_model("gain").block]
    proposal = propose(blocks, preparation, Limits(0.0, 100.0, 1e6), silent)
    response = blocks[0].respond(proposal.drive.values, fj.Grid(proposal.drive.step))
    columns = np.stack([proposal.drive.values, np.ones_like(response)], axis=1)
    rest = response - columns @ np.linalg.lstsq(columns, response, rcond=None)[0]
    assert proposal.difference <= 1.05 * np.std(rest) / 0.01
    assert proposal.difference > 1.0
