"""A drive keeps every limit in every sample, is as long as asked for, and meets its path again."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fracjax._path._memory import branches_of
from fracjax._protocol import Limits, readings_of
from fracjax._protocol._drive import Pen, corners_rounded
from fracjax._protocol._multisine import GROUP, excited_lines, multisine
from fracjax._protocol._recipe import Recipe, drive_of

FAST = Limits(0.0, 100.0, 1e6)
STEP = 1e-2


def made(duration: float = 30.0, **changed):
    drive = drive_of(Recipe(**changed), FAST, duration, STEP, 0.2 / STEP)
    assert drive is not None
    return drive


def part_of(drive, name: str) -> np.ndarray:
    """The samples of the last part of a name."""
    part = next(p for p in reversed(drive.parts) if p.name == name)
    return drive.values[round(part.start / drive.step) : round(part.stop / drive.step) + 1]


recipes = st.builds(
    Recipe,
    slow=st.floats(0.05, 1.0),
    ratio=st.floats(4.0, 60.0),
    passes=st.integers(1, 4),
    between=st.integers(0, 1),
    rungs=st.integers(0, 3),
    minor=st.floats(0.0, 0.8),
    holds=st.floats(0.0, 1.0),
    tones=st.floats(0.0, 0.3),
    size=st.floats(0.01, 0.4),
    tilt=st.floats(0.0, 1.0),
    biases=st.integers(1, 3),
    again=st.floats(0.0, 1.5),
    rests=st.floats(0.01, 0.2),
)


_HARDLY_A_REST = Recipe(
    slow=1.0, ratio=4.0, passes=1, between=0, rungs=0, minor=0.0, holds=0.0, tones=0.0, size=0.25,
    tilt=0.0, biases=1, again=0.0, rests=0.015625,
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@example(recipe=_HARDLY_A_REST, low=0.0, span=1.0, strokes=1.0, duration=6.0, codes=0)
@given(
    recipe=recipes, low=st.floats(-300.0, 50.0), span=st.floats(1.0, 1000.0),
    strokes=st.floats(0.3, 1e4), duration=st.floats(5.0, 60.0), codes=st.integers(0, 4000),
)  # fmt: skip
def test_every_limit_is_kept_in_every_sample(recipe, low, span, strokes, duration, codes):
    code = span / (codes + 200) if codes else 0.0
    slew = strokes * span
    if slew * STEP < code:
        return
    limits = Limits(low, low + span, slew, code).in_codes(STEP)
    drive = drive_of(recipe, limits, duration, STEP, 0.2 / STEP)
    if drive is None:
        return
    values, slack = drive.values, 1e-9 * span
    assert values.size == round(duration / STEP)
    assert values.min() >= low - slack
    assert values.max() <= low + span + slack
    assert np.abs(np.diff(values)).max() <= slew * STEP * (1 + 1e-9) + slack
    # It starts and ends at rest, where there is no drive or nearest to it.
    nearest = np.clip(0.0, low, low + span)
    assert abs(values[0] - nearest) <= code + slack
    assert np.ptp(values[:4]) == np.ptp(values[-4:]) == 0
    assert values[-1] == pytest.approx(values[0], abs=slack)
    assert [p.stop for p in drive.parts[:-1]] == [p.start for p in drive.parts[1:]]


def test_the_same_path_is_travelled_at_two_rates_and_again():
    drive = made(300.0)
    slow, fast, again = (part_of(drive, n) for n in ("slow path", "fast path", "first part again"))
    for own in (slow, fast, again):
        assert (own.min(), own.max()) == pytest.approx((0, 100))
    # Two passes ten times as fast.
    assert slow.size / fast.size == pytest.approx(5, rel=0.1)
    rates = [np.median(np.abs(np.diff(own))) for own in (fast, slow, again)]
    assert rates[0] / rates[1] == pytest.approx(10, rel=0.05)
    assert rates[2] == pytest.approx(rates[1], rel=0.05)
    (branch,), _ = branches_of([drive.values])
    changes = np.flatnonzero(np.diff(branch, prepend=-1))
    visits = np.bincount(branch[changes])
    assert np.mean(visits[branch] > 1) > 0.8


def test_holds_go_both_ways_over_three_decades():
    values = part_of(made(600.0, holds=0.6), "holds")
    starts = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    lengths = np.diff(np.append(starts, values.size))
    # Stays at the ends of the range are turns.
    held = {v: lengths[values[starts] == v].max() for v in (70.0, 30.0, 50.0, 90.0, 10.0)}
    for long, short in ((70.0, 90.0), (30.0, 10.0)):
        assert held[long] / held[short] == pytest.approx(100, rel=0.2)


def test_a_drive_that_does_not_fit_is_none():
    assert drive_of(Recipe(), Limits(0.0, 100.0, 5.0), 30.0, STEP, 20.0) is None
    assert drive_of(Recipe(), FAST, 1.0, STEP, 20.0) is None


def test_tones_are_odd_random_phase_lines_with_detection_lines():
    wave = multisine(1000, 199, 0.5)
    assert np.abs(wave).max() == pytest.approx(1)
    spectrum = np.abs(np.fft.rfft(wave))
    excited = np.flatnonzero(spectrum > 1e-9 * spectrum.max())
    assert np.all(excited % 2 == 1)
    assert excited.max() <= 199
    # One of every four odd lines is empty.
    groups = [np.isin(odd, excited).sum() for odd in np.arange(1, 193, 2).reshape(-1, GROUP)]
    assert groups == [GROUP - 1] * len(groups)
    assert np.array_equal(excited, excited_lines(199, np.random.default_rng(0)))
    # Amplitudes fall as the root of frequency; odd lines make the second half minus the first.
    assert spectrum[excited] * excited**0.5 == pytest.approx(spectrum[1], rel=1e-9)
    assert np.roll(wave, 500) == pytest.approx(-wave, abs=1e-12)


def test_the_pen_takes_the_shortest_time_that_is_allowed():
    pen = Pen(Limits(0.0, 10.0, 20.0), 0.1)  # 2 a sample
    pen.begin("there and back", "a test")
    pen.go(10.0)
    assert pen.samples == 1 + 5 + 4
    pen.go(0.0, 2.0)
    values = pen.drive("").values
    assert np.abs(np.diff(values[:6])) == pytest.approx(2.0)
    assert np.diff(values[10:30]) == pytest.approx(-0.5)
    assert corners_rounded(values)[[7, -1]] == pytest.approx([10.0, 0.0])


def test_a_long_drive_is_read_evenly_and_its_fast_stretch_for_itself():
    slow = np.linspace(0, 1, 10_000)
    fast = 0.5 + 0.5 * np.cos(2 * np.pi * np.arange(600) / 30)
    drive = np.concatenate([slow, fast, 1 - slow])
    whole, stretch = readings_of(drive, 1000)
    assert (whole.start, whole.stop, whole.every) == (0, drive.size, 21)
    assert stretch.start < 10_000 < 10_600 < stretch.stop
    own = drive[stretch.samples]
    lines = np.interp(np.arange(stretch.start, stretch.stop),
                      np.arange(stretch.start, stretch.stop, stretch.every), own)  # fmt: skip
    assert np.abs(lines - drive[stretch.start : stretch.stop]).max() <= 0.01
    kept = np.arange(0, drive.size, whole.every)
    assert not whole.counted[(kept > 10_000) & (kept < 10_600)].any()
    assert whole.counted.mean() > 0.9
    assert len(readings_of(slow, 1000)) == 1


def test_one_fast_change_is_read_with_what_comes_after_it():
    """Of a long recording of a relaxation seventeen samples were read, which are no recording."""
    drive = np.clip((np.arange(90_000) - 3) / 5.0, 0.0, 1.0)
    _, stretch = readings_of(drive, 12_000)
    assert stretch.start == 0
    assert 1000 <= len(range(stretch.start, stretch.stop, stretch.every)) <= 12_000
