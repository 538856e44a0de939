"""Branches of the path against a Preisach plane, whose memory is what Madelung's rules say."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fracjax._path._memory import SAME, TURN, branches_of, turning_points
from tests.path.helpers import preisach, relays

TOP = 12
"""Levels are whole numbers up to this, and samples half a unit apart."""


@st.composite
def level_lists(draw):
    """Levels that a drive turns at; from 0 to TOP somewhere, so that tolerances are known."""
    levels = draw(st.lists(st.integers(0, TOP), min_size=2, max_size=14))
    at = draw(st.integers(0, len(levels)))
    return [*levels[:at], 0, TOP, *levels[at:]]


def drive_of(levels) -> np.ndarray:
    """Half a unit from sample to sample."""
    places = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(levels)))])
    return np.interp(np.arange(0, places[-1] + 0.25, 0.5), places, levels)


def plane():
    """Relays whose thresholds no sample meets exactly."""
    up, down, weights = relays(3, -1.0, TOP + 1.0)
    return np.floor(2 * up) / 2 + 0.2, np.floor(2 * down) / 2 - 0.2, weights


def assert_one_response_each(branches, drives, responses):
    seen = {}
    for branch, drive, response in zip(
        np.concatenate(branches), np.concatenate(drives), np.concatenate(responses), strict=True
    ):
        first = seen.setdefault((int(branch), round(2 * float(drive))), response)
        assert response == pytest.approx(first, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(level_lists())
def test_a_preisach_plane_has_one_response_per_branch_and_drive(levels):
    drive = drive_of(levels)
    branches, count = branches_of([drive])
    assert_one_response_each(branches, [drive], [preisach(drive, plane())])
    assert set(branches[0]) <= set(range(count))


@settings(max_examples=40, deadline=None)
@given(level_lists(), level_lists())
def test_recordings_share_their_branches(first, second):
    drives = [drive_of(first), drive_of(second)]
    branches, _ = branches_of(drives)
    assert_one_response_each(branches, drives, [preisach(d, plane()) for d in drives])


def test_a_loop_met_in_two_recordings_is_one_branch():
    loop = [0, TOP, 0, TOP, 0]
    (first, second), _ = branches_of([drive_of(loop), drive_of([3, TOP, 0, TOP])])
    # The rise of the second recording is the last but one half cycle of the first.
    np.testing.assert_array_equal(second[-2 * TOP + 1 : -1], first[4 * TOP + 1 : 6 * TOP - 1])
    # Its own fall begins at an unknown past, which it shares with no other recording.
    assert not {*second[: 2 * TOP]} & {*first}


def test_inner_loops_are_wiped_out_and_outer_ones_kept():
    levels = [0, 12, 0, 8, 4, 8, 4, 10, 4]
    drive = drive_of(levels)
    (branches,), _ = branches_of([drive])
    ends = np.concatenate([[0], np.cumsum(2 * np.abs(np.diff(levels)))])
    middles = [int(branches[(a + b) // 2]) for a, b in pairwise(ends)]
    up, down, first, inner, back, again, on, _ = middles
    assert inner == again
    assert back != inner
    # Past 8 the small loop is forgotten, and the branch goes on that was left there.
    assert branches[ends[7] - 1] == first
    assert len({up, down, first, inner, back}) == 5
    assert on in (back, first)


@settings(max_examples=60, deadline=None)
@given(level_lists(), st.integers(0, 2**32 - 1))
def test_turning_points_within_the_tolerance_are_one(levels, seed):
    exact = drive_of(levels)
    rng = np.random.default_rng(seed)
    places = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(levels)))])
    moved = np.asarray(levels) + rng.uniform(-0.2, 0.2, len(levels)) * TURN * TOP
    drive = np.interp(np.arange(0, places[-1] + 0.25, 0.5), places, moved)
    # Samples between levels, which a turning point that moves a little does not reach.
    between = np.flatnonzero(np.arange(exact.size) % 2 == 1)
    (one,), _ = branches_of([exact])
    (other,), _ = branches_of([drive])
    pairs = set(zip(one[between].tolist(), other[between].tolist(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def test_turning_points_further_apart_than_the_tolerance_are_two():
    for apart, count in ((0.5 * SAME, 1), (2 * SAME, 2)):
        ends = [0.0, 1.0, 0.3, 0.9, 0.3 - apart, 0.9]
        drive = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(ends)])
        (branches,), _ = branches_of([drive])
        assert len({int(branches[125]), int(branches[225])} - {int(branches[175])}) == count


@settings(max_examples=25, deadline=None)
@given(level_lists(), st.data())
def test_a_hold_stays_on_its_branch(levels, data):
    drive = drive_of(levels)
    held = data.draw(st.lists(st.integers(1, 4), min_size=drive.size, max_size=drive.size))
    (moving,), count = branches_of([drive])
    (resting,), same = branches_of([np.repeat(drive, held)])
    assert same == count
    np.testing.assert_array_equal(resting, np.repeat(moving, held))


def test_ripple_below_the_tolerance_makes_no_turning_point():
    smooth = np.interp(np.arange(401), [0, 200, 400], [0.0, 1.0, 0.0])
    ripple = 0.45 * TURN * np.sin(2.5 * np.arange(401))
    assert turning_points(smooth, TURN).size == 1
    assert turning_points(smooth + ripple, TURN).size == 1
