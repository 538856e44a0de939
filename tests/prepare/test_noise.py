"""The noise floor: where it varies, where a drive comes twice, and what the codes tell of it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._prepare import Residual, measured_noise, noises_below, residual_noises
from fracjax._prepare._autoregression import autoregression, removed_power
from fracjax._prepare._noise_sources import measured_noises, read_from_residuals
from fracjax._prepare._noise_stretches import Stretch, noise_in
from fracjax._prepare._setting import setting_of
from fracjax._prepare._tone import tone_in
from fracjax._recording import Recording

STEP = 2e-3
REST, MOVE, STAIRS = 200, 60, 15
SIGMA = 0.02


def staircase() -> np.ndarray:
    """Rests at levels up and down, with soft edges: they lie all over the record."""
    levels = np.random.default_rng(1).uniform(10, 90, STAIRS + 1)
    edge = 0.5 - 0.5 * np.cos(np.pi * np.arange(MOVE) / MOVE)
    pieces = [
        piece
        for low, high in pairwise(levels)
        for piece in (np.full(REST, low), low + (high - low) * edge)
    ]
    return np.concatenate([*pieces, np.full(REST, levels[-1])])


def recorded(drive: np.ndarray, noise: np.ndarray) -> Recording:
    return Recording(drive, 0.1 * drive + noise, STEP, "V", "um")


def test_noise_that_is_the_same_everywhere_has_no_course():
    drive, seen = staircase(), 0
    for seed in range(20):
        noise = SIGMA * np.random.default_rng(seed).standard_normal(drive.size)
        found = measured_noise(recorded(drive, noise))
        assert found is not None
        assert found.sigma == pytest.approx(SIGMA, rel=0.08)
        seen += found.size_at(drive.size) is not None
    assert seen == 0


@pytest.mark.parametrize("pole", [0.0, 0.8, -0.5])
def test_a_mean_is_known_as_well_as_the_colour_lets_it(pole):
    sigma = SIGMA / np.sqrt(1 - pole**2)
    noise = fj.Noise(sigma, "um", "specification", np.array([1, -pole]), SIGMA)
    samples = noise.samples_to_average(0.1)
    assert samples == pytest.approx(100 * (1 + pole) / (1 - pole))
    white = SIGMA * np.random.default_rng(1).standard_normal((4000, 300 + round(samples)))
    means = np.asarray(lfilter([1.0], [1.0, -pole], white))[:, 300:].mean(axis=1)
    assert np.std(means) == pytest.approx(0.1 * sigma, rel=0.06)


def test_heavy_tails_are_no_course():
    drive = staircase()
    noise = SIGMA / np.sqrt(2) * np.random.default_rng(3).standard_t(4, drive.size)
    found = measured_noise(recorded(drive, noise))
    assert found is not None
    assert found.size_at(drive.size) is None


def test_the_course_of_a_varying_noise_is_followed():
    drive = staircase()
    size = 1 + 0.6 * np.sin(4 * np.pi * np.arange(drive.size) / drive.size)
    noise = SIGMA * size * np.random.default_rng(2).standard_normal(drive.size)
    found = measured_noise(recorded(drive, noise))
    assert found is not None
    course = found.size_at(drive.size)
    assert course is not None
    inside = slice(REST, -REST)
    wanted = size / np.sqrt(np.mean(size**2))
    assert np.sqrt(np.mean((course[inside] / wanted[inside] - 1) ** 2)) < 0.25
    # The whitened noise is of the same size everywhere, to what a dozen pieces can tell.
    parts = np.array_split((noise / (found.sigma * course))[inside], 6)
    np.testing.assert_allclose([part.std() for part in parts], 1.0, atol=0.25)


def test_what_rings_after_a_step_is_no_course():
    drive = staircase()
    since = np.arange(drive.size) % (REST + MOVE)
    ringing = 5 * SIGMA * np.exp(-since / 25) * np.sin(2 * np.pi * since / 9)
    noise = ringing + SIGMA * np.random.default_rng(4).standard_normal(drive.size)
    found = measured_noise(recorded(drive, noise))
    assert found is not None
    assert found.size_at(drive.size) is None


@pytest.mark.parametrize("steady", [True, False])
def test_noise_of_a_drive_given_twice_is_what_does_not_repeat(steady):
    generator = np.random.default_rng(5)
    turns = 2 * np.pi * np.arange(1000) / 1000
    once = 50 + 30 * np.sin(3 * turns) * np.sin(turns) + 10 * np.sin(7 * turns)
    other = once if steady else 50 + 30 * np.sin(5 * turns + 1)
    drive = np.concatenate([once, other])
    mismatch = 3 * SIGMA * np.sin(drive / 7)
    residual = mismatch + SIGMA * generator.standard_normal(2000)
    recording = Recording(drive, 0.1 * drive, STEP, "V", "um")
    (found,) = residual_noises([Residual(residual, np.ones(2000, bool), recording)])
    assert found.is_leftover
    assert found.method == ("repeats" if steady else "residual")
    # The mismatch, three times as large, is smooth: second differences do not show it.
    assert found.sigma == pytest.approx(SIGMA, rel=0.06 if steady else 0.1)


@pytest.mark.parametrize("pole", [0.0, 0.9])
def test_a_line_that_the_filter_leaves_out_shows_in_the_whitened_squares(pole):
    generator = np.random.default_rng(6)
    noise = np.asarray(lfilter([SIGMA], [1.0, -pole], generator.standard_normal(4000)))
    recording = recorded(100 * np.sin(np.arange(4000) ** 1.5 / 3e3), np.zeros(4000))
    used = np.ones(4000, bool)
    (alone,) = noises_below([Residual(noise, used, recording)])
    assert alone.whitened_square == pytest.approx(1.0, abs=0.05)
    tone = 0.4 * np.exp(-np.arange(4000) / 2000) * np.sin(np.arange(4000) / 12)
    (found,) = noises_below([Residual(noise + tone, used, recording)])
    line = np.mean(np.asarray(lfilter(found.whitening, 1.0, tone)) ** 2)
    assert line > 0.5
    assert found.whitened_square == pytest.approx(1.0 + line, rel=0.1)


@pytest.mark.parametrize("codes", [0.0, 1.5])
def test_steps_as_coarse_as_the_noise_count_as_noise(codes):
    """Of a step q they add q²/12 to its variance, and hide nothing that could be named."""
    drive = staircase()
    response = 0.1 * drive + SIGMA * np.random.default_rng(6).standard_normal(drive.size)
    if codes:
        response = codes * SIGMA * np.round(response / (codes * SIGMA))
    diagnosis = fj.diagnose(fj.parse_model("lfdh"), Recording(drive, response, STEP, "V", "um"))
    assert diagnosis.verdict == "none"
    assert diagnosis.noise.sigma == pytest.approx(SIGMA * np.sqrt(1 + codes**2 / 12), rel=0.05)


def test_of_a_rest_a_parabola_and_logarithms_of_time_are_no_noise():
    x = np.linspace(0, 1, 300)
    slow = 1 - 2 * x + 3 * x**2 + 0.5 * np.log(x + 0.02) - np.log(x + 0.2)
    assert np.abs(Stretch.without_relaxation(slow, 0).samples).max() < 1e-10
    assert np.std(Stretch.without_relaxation(slow + x**5, 0).samples) > 1e-3


@pytest.mark.parametrize("samples", [400, 1200])
def test_slow_noise_is_told_in_full_where_slow_terms_were_taken_off(samples):
    generator, memory = np.random.default_rng(11), 0.9
    found, sizes = [], []
    for _ in range(60):
        white = generator.standard_normal(samples + 300)
        stretch = Stretch.without_relaxation(np.asarray(lfilter([1], [1, -memory], white))[300:], 0)
        told = noise_in([stretch], "um", "static")
        found.append((told.innovation / told.filter.sum()) ** 2)
        sizes.append(told.sigma)
    slowest, size = 1 / (1 - memory) ** 2, 1 / np.sqrt(1 - memory**2)
    # A median over the spectrum alone would cut it to a third, and the five terms take more.
    assert np.exp(np.mean(np.log(found))) == pytest.approx(slowest, rel=0.3)
    assert np.median(sizes) == pytest.approx(size, rel=0.1)


def test_what_terms_take_of_noise_is_what_they_take_on_average():
    generator, taps = np.random.default_rng(12), np.array([1.0, -0.8])
    terms = Stretch.without_relaxation(np.zeros(150), 0).terms
    noise = np.asarray(lfilter([1], taps, generator.standard_normal((4000, 550))))[:, 400:]
    taken = np.mean(np.sum((noise @ terms) ** 2, axis=1))
    assert removed_power((taps, 1.0), terms) == pytest.approx(taken, rel=0.03)


def test_a_line_does_not_colour_slow_noise():
    noise = np.asarray(lfilter([1], [1, -0.9], np.random.default_rng(13).standard_normal(4000)))
    line = 3.0 * np.sin(2 * np.pi * 0.12 * np.arange(4000))
    for told, alone in zip(
        autoregression([noise + line])[0][:2], autoregression([noise])[0][:2], strict=True
    ):
        assert told == pytest.approx(alone, abs=0.03)


@pytest.mark.parametrize("periods", [3, 4])
def test_of_few_periods_the_decay_of_a_memory_and_a_drift_are_no_noise(periods):
    """Of three there is one second difference, and nothing tells when it has settled."""
    period = 400
    times = STEP * np.arange(periods * period)
    drive = 50 - 40 * np.cos(2 * np.pi * np.arange(times.size) / period)
    slow = 0.5 * np.log1p(times / 0.05) - 2.0 * np.exp(-times / 1.5)
    noise = SIGMA * np.random.default_rng(4).standard_normal(times.size)
    found = measured_noise(recorded(drive, slow + noise))
    assert found is not None
    assert found.method == "repeats"
    assert found.sigma == pytest.approx(SIGMA, rel=0.1)
    assert found.filter.size == 1


def test_a_rest_whose_code_never_changes_tells_no_noise():
    """The noise is smaller than the converter's step there, not nought."""
    drive = staircase()
    noise = SIGMA * np.random.default_rng(0).standard_normal(drive.size)
    coarse = 20 * SIGMA * np.round(recorded(drive, noise).response / (20 * SIGMA))
    quantised = Recording(drive, coarse, STEP, "V", "um")
    starts = [start for start, _ in quantised.static_stretches(0.2)]
    assert len(starts) > 10
    found = measured_noise(quantised)
    assert found is None or found.sigma > 1e-3 * SIGMA
    # Nor one that is left for a single sample, which is less than rounding makes of a motion.
    step = 20 * SIGMA
    stuck = step * np.round(drive / step)
    for start, stop in quantised.static_stretches(0.2):
        stuck[start:stop] = stuck[stop - 1]
        stuck[(start + stop) // 2] += step
    assert measured_noise(Recording(drive, stuck, STEP, "V", "um")) is None
    held = Recording(drive, drive.copy(), STEP, "V", "um")
    assert measured_noise(held) is None


def test_a_repeat_recording_tells_the_noise_of_one():
    drive = staircase()
    noises = SIGMA * np.random.default_rng(12).standard_normal((2, drive.size))
    first, second = (recorded(drive, noise) for noise in noises)
    found = measured_noise(first, second)
    assert found is not None
    assert found.method == "repeats"
    assert found.sigma == pytest.approx(SIGMA, rel=0.05)


def test_a_repeat_is_one_only_where_its_drive_is_that_of_the_recording():
    drive = staircase()
    noise = SIGMA * np.random.default_rng(5).standard_normal((2, drive.size))
    first = recorded(drive, noise[0])
    for off, refused in ((0.5e-2, False), (1.5e-2, True)):
        other = Recording(drive + off * np.ptp(drive), 0.1 * drive + noise[1], STEP, "V", "um")
        if refused:
            with pytest.raises(fj.InputError, match="found another drive"):
                measured_noise(first, other)
        else:
            found = measured_noise(first, other)
            assert found is not None
            assert found.sigma == pytest.approx(SIGMA, rel=0.05)


def moving(seed: int, sigma: float = SIGMA, step: float = STEP, source: str = "moving"):
    """A recording that shows no noise: its drive neither rests nor comes again."""
    times = STEP * np.arange(800)
    drive = 50 + (20 + seed) * np.sin(2 * np.pi * (0.5 + times) * times)
    noise = sigma * np.random.default_rng(seed).standard_normal(800)
    return Recording(drive, 0.1 * drive + noise, step, "V", "um", source=source)


def test_each_repeat_is_that_of_the_recording_whose_drive_it_has():
    recordings = [moving(1, 0.01), moving(2, 0.03), moving(3)]
    repeats = [moving(2, 0.03), moving(1, 0.01)]
    repeats = [
        replace(r, response=r.response + s * np.random.default_rng(9).standard_normal(800))
        for r, s in zip(repeats, (0.03, 0.01), strict=True)
    ]
    found = measured_noises(recordings, repeats, 0.5, [None] * 3)
    sigmas = [noise and noise.sigma * np.sqrt(2) for noise in found]
    # The third has none, and what is longest of the others; all are as long.
    assert sigmas[:2] == pytest.approx([0.01, 0.03], rel=0.1)
    assert found[0] is not None
    assert found[2] is not None
    assert (found[2].method, found[2].sigma) == ("repeats", found[0].sigma)


def test_a_repeat_of_none_of_the_recordings_is_refused():
    recordings = [moving(1, source="one"), moving(2, source="two")]
    with pytest.raises(fj.InputError, match=r"with the drive of one \(800.*or two.*another drive"):
        measured_noises(recordings, [moving(3)], None, [None] * 2)


def test_a_rest_recorded_apart_tells_the_noise_of_what_is_recorded_at_its_rate():
    drive = staircase()
    size = 1 + 0.6 * np.sin(4 * np.pi * np.arange(drive.size) / drive.size)
    rest = recorded(drive, SIGMA * size * np.random.default_rng(2).standard_normal(drive.size))
    same, other = moving(1), moving(2, step=2 * STEP)
    of_rest, of_same, of_other = measured_noises([rest, same, other], [], None, [None] * 3)
    assert of_rest is not None
    assert of_same is not None
    assert of_other is not None
    assert (of_same.method, of_same.sigma) == ("static", of_rest.sigma)
    # How its size changes is the rest's own affair.
    assert of_rest.size_at(800) is not None
    assert of_same.size_at(800) is None
    # At another rate its size is told, as by a specification, and its colour is not.
    assert (of_other.method, of_other.sigma) == ("specification", of_rest.sigma)
    assert of_other.is_leftover
    told = measured_noises([rest, other], [], 0.5, [None] * 2)[1]
    assert told is not None
    assert told.sigma == 0.5
    assert measured_noises([same, other], [], None, [None] * 2) == [None, None]


def test_the_noise_is_read_from_the_slowest_line_that_nothing_was_taken_from():
    noise = np.random.default_rng(6).standard_normal(1000)
    for taken, first in ((0, 1), (1, 2), (4, 3)):
        terms = np.linalg.qr(np.vander(np.linspace(-1, 1, 1000), taken))[0]
        found = noise_in([Stretch(noise - terms @ (terms.T @ noise), 0, terms)], "um", "static")
        assert found.lines[0].min() == pytest.approx(first / found.lines[0].size / 2, rel=0.01)


def test_a_specification_is_believed_where_nothing_shows_the_noise():
    times = STEP * np.arange(800)
    drive = 50 + 20 * np.sin(2 * np.pi * (0.5 + times) * times)
    moving = recorded(drive, np.zeros(800))
    assert measured_noise(moving) is None
    (told,) = measured_noises([moving], [], 0.07, [None])
    assert told is not None
    assert (told.sigma, told.method, told.unit) == (0.07, "specification", "um")
    assert told.whitening == pytest.approx([1 / 0.07])
    # Its size is told, its colour is that of what a fit leaves.
    white = np.random.default_rng(8).standard_normal(800)
    residual = np.asarray(lfilter([1.0], [1.0, -0.6], white))
    residual *= 0.075 / residual.std()
    (found,) = read_from_residuals([(told, Residual(residual, np.ones(800, bool), moving))])
    assert (found.sigma, found.method) == (0.07, "specification")
    assert found.filter == pytest.approx([1.0, -0.6], abs=0.08)
    assert found.innovation == pytest.approx(0.07 * np.sqrt(1 - 0.6**2), rel=0.05)
    # In a residual clearly larger than the noise there is a mismatch, with a colour of its own.
    larger = Residual(1.1 * residual, np.ones(800, bool), moving)
    assert read_from_residuals([(told, larger)])[0] is told
    rest = recorded(staircase(), SIGMA * np.random.default_rng(7).standard_normal(staircase().size))
    (shown,) = measured_noises([rest], [], 0.07, [None])
    assert shown is not None
    assert (shown.method, shown.sigma) == ("static", pytest.approx(SIGMA, rel=0.08))


def test_several_recordings_are_as_large_as_the_largest_of_each():
    small, large = (
        Recording(
            c + a * np.sin(2 * np.pi * f * STEP * np.arange(n)),
            a * np.cos(np.arange(n)),
            h,
            "V",
            "um",
        )
        for c, a, f, n, h in ((10, 5, 3, 600, STEP), (50, 40, 1, 400, 2 * STEP))
    )
    one, other, both = (setting_of(listed) for listed in ([small], [large], [small, large]))
    assert (one.drive_low, one.drive_high) == pytest.approx((5, 15), abs=0.1)
    assert both.drive_low == min(one.drive_low, other.drive_low)
    assert both.drive_high == max(one.drive_high, other.drive_high)
    for name in ("response_span", "duration", "top_frequency", "top_rate", "rms_rate"):
        values = [getattr(s, name) for s in (one, other)]
        assert values[0] != values[1]
        assert getattr(both, name) == max(values)
    for name in ("step", "response_low", "resolution"):
        assert getattr(both, name) == min(getattr(s, name) for s in (one, other))


def test_a_rest_recorded_beside_is_no_drive():
    """Its measured drive is noise, the fastest there is; a slight drive is one."""
    white = np.random.default_rng(3).standard_normal(600)
    driven = Recording(50 + 40 * np.sin(np.arange(600) / 30), white, STEP, "V", "um")
    rest, slight = (Recording(50 + size * white, white, STEP, "V", "um") for size in (0.01, 1.0))
    alone, beside_rest, beside_slight = map(
        setting_of, ([driven], [driven, rest], [driven, slight])
    )
    for name in ("top_frequency", "top_rate", "rms_rate"):
        assert getattr(beside_rest, name) == getattr(alone, name)
    assert beside_slight.top_frequency > 10 * alone.top_frequency


# Tones --------------------------------------------------------------------------------------------


def test_a_tone_in_the_rests_is_told():
    drive = staircase()
    times = STEP * np.arange(drive.size)
    tone = 0.6 * SIGMA * np.sqrt(2) * np.sin(2 * np.pi * 37.3 * times)
    noise = SIGMA * np.random.default_rng(6).standard_normal(drive.size)
    found = measured_noise(recorded(drive, noise + tone))
    assert found is not None
    assert found.tone is not None
    assert found.tone.frequency / STEP == pytest.approx(37.3, abs=0.5)
    assert found.tone.rms == pytest.approx(0.6 * SIGMA, rel=0.2)


@pytest.mark.parametrize(("periods", "is_tone"), [(3, False), (12, True)])
def test_what_turns_fewer_than_six_times_is_drift_and_no_tone(periods, is_tone):
    line = np.sin(2 * np.pi * periods * np.arange(2000) / 2000)
    noise = np.random.default_rng(0).standard_normal(2000)
    assert (tone_in([noise + line], np.ones(1), 1.0, 1.0) is not None) == is_tone


def test_where_nothing_varies_there_is_no_tone():
    assert tone_in([np.zeros(2000)], np.ones(1), 1.0, 1.0) is None


def test_noise_alone_has_no_tone_at_either_end_of_its_spectrum(monkeypatch):
    """However small: a false one would hide a weaker tone elsewhere."""
    monkeypatch.setattr("fracjax._prepare._tone._LEAST_SHARE", 0.0)
    for draw in np.random.default_rng(3).standard_normal((40, 10_000)):
        assert tone_in([draw - draw.mean()], np.ones(1), 1.0, 1.0) is None


def test_noise_of_any_colour_holds_no_tone():
    drive, seen = staircase(), 0
    for seed in range(60):
        generator = np.random.default_rng(seed)
        noise = generator.standard_normal(drive.size) * generator.gamma(4, 0.25, drive.size)
        reddened = lfilter([1.0], [1.0, -(seed % 3) * 0.45], noise)
        found = measured_noise(recorded(drive, SIGMA * np.asarray(reddened)))
        seen += found is not None and found.tone is not None
    assert seen == 0


def test_a_diagnosis_warns_of_a_tone():
    drive = staircase()
    times = STEP * np.arange(drive.size)
    noise = SIGMA * np.random.default_rng(8).standard_normal(drive.size)
    tone = SIGMA * np.sin(2 * np.pi * 83.0 * times)
    found = fj.diagnose(fj.parse_model("foh"), recorded(drive, noise + tone))
    (told,) = [warning for warning in found.warnings if "a tone near" in warning]
    assert float(told.split(" Hz")[0].split()[-1]) == pytest.approx(83.0, abs=0.5)
