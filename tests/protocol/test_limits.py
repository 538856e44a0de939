"""Limits are read with their units; what excludes every drive is refused in one sentence."""

from math import inf

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fracjax as fj
from fracjax._protocol import Limits, parse_limits, recorded_limits
from fracjax._protocol._limits import limits_of

STEP = 1e-3
TIMES = STEP * np.arange(4000)


def recording(frequency: float = 1.0) -> fj.Recording:
    drive = 50 - 40 * np.cos(2 * np.pi * frequency * TIMES)
    return fj.Recording(drive, 0.1 * drive, STEP, "V", "um")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0..100 V, 50 V/ms", (0, 100, 5e4)),
        ("-20..120V,3 kV/s", (-20, 120, 3e3)),
        ("0..0.1 kV, 50 V/s", (0, 100, 50)),
        ("5..60, 1 V/ms", (5, 60, 1e3)),
    ],
)
def test_limits_are_read_with_their_units(text, expected):
    limits = parse_limits(text, [recording()])
    assert (limits.low, limits.high, limits.slew) == pytest.approx(expected)


def test_without_a_slew_ten_times_the_fastest_recorded_change():
    limits = parse_limits("0..100 V", [recording()])
    assert limits.slew == pytest.approx(10 * 2 * np.pi * 40, rel=1e-3)
    recorded = recorded_limits([recording()])
    assert (recorded.low, recorded.high) == pytest.approx((10, 90), abs=1e-3)
    assert recorded.slew == limits.slew


@pytest.mark.parametrize(
    "text", ["", "100 V", "100..0 V", "0..100 m", "0..100 V, 0 V/s", "0..100 V, 5 V", "a..b V"]
)
def test_limits_that_are_none_are_refused_in_a_sentence(text):
    with pytest.raises(fj.InputError) as refused:
        parse_limits(text, [recording()])
    assert "--limits" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_current_limits_the_rate_through_the_capacitance():
    """du/dt = I/C, and the smaller of it and the slew rate counts, in any order."""
    alone, unit = limits_of("0..100 V, 30 mA", capacitance="3 uF")
    assert (alone.slew, unit) == (pytest.approx(1e4), "V")
    for text in ("0..100 V, 30 mA, 5 V/ms", "0..100 V, 5 V/ms, 30 mA"):
        assert limits_of(text, capacitance="3 uF")[0].slew == pytest.approx(5e3)
    assert limits_of("0..0.1 kV, 30 mA", capacitance="3 uF")[0].slew == pytest.approx(10.0)
    assert limits_of("0..100 V")[0].slew == inf


@pytest.mark.parametrize(
    ("text", "capacitance", "remedy"),
    [
        ("0..100 V, 2 A", None, "--capacitance"),
        ("0..100 V, 2 A", "0 uF", "--capacitance"),
        ("0..100 um, 2 A", "3 uF", "um/s"),
        ("0..0 V, 1 V/s", None, "wider range"),
        ("100..0 V, 1 V/s", None, '"0..100 V"'),
        ("0..100", None, "in this form"),
    ],
)
def test_what_is_missing_is_said(text, capacitance, remedy):
    with pytest.raises(fj.InputError, match=remedy):
        limits_of(text, "", capacitance)


@given(
    code=st.floats(1e-3, 0.5), slew=st.floats(1.0, 1e4), step=st.floats(1e-4, 1e-1),
    seed=st.integers(0, 99),
)  # fmt: skip
def test_whole_codes_keep_every_limit(code, slew, step, seed):
    limits = Limits(-3.3, 7.1, slew, code)
    if slew * step < code:
        with pytest.raises(fj.InputError, match="Hz or less"):
            limits.in_codes(step)
        return
    coded = limits.in_codes(step)
    assert coded.slew <= slew * (1 + 1e-9)
    assert -3.3 - 1e-9 <= coded.low < coded.high <= 7.1 + 1e-9
    moves = np.random.default_rng(seed).uniform(-1, 1, 200) * coded.slew * step
    drive = np.clip(np.cumsum(moves), coded.low, coded.high)
    rounded = coded.rounded(drive)
    assert np.abs(np.diff(rounded)).max() <= slew * step * (1 + 1e-9)
    assert rounded / code == pytest.approx(np.round(rounded / code), abs=1e-6)
