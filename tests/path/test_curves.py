"""The basis of the path's curves."""

import numpy as np
import pytest

from fracjax._path._curves import KNOTS, curves_of
from tests.path.helpers import through

LADDER = through([0.0, 5.0, 1.0, 4.0, 1.0, 5.0, 0.0], [60] * 6)


def test_the_splines_of_a_sample_sum_to_one_and_their_slopes_to_zero():
    curves = curves_of([LADDER, 0.5 + 0.8 * LADDER])
    np.testing.assert_allclose(curves.basis.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(curves.slope.sum(axis=1), 0.0, atol=1e-11)
    assert curves.basis.sum(axis=1).size == 2 * LADDER.size


def test_the_slope_is_that_of_finite_differences():
    drive = np.linspace(-2.0, 3.0, 40_001)
    curves = curves_of([drive])
    coefficients = np.random.default_rng(0).standard_normal(curves.basis.sum(axis=0).size)
    differences = np.gradient(curves.basis @ coefficients, drive)
    slope = curves.slope @ coefficients
    np.testing.assert_allclose(slope[1:-1], differences[1:-1], atol=1e-3 * np.abs(slope).max())


def test_a_line_has_no_bends():
    curves = curves_of([LADDER])
    # A branch has neighbouring columns, so that their numbers are a line on each.
    line = np.arange(curves.basis.sum(axis=0).size, dtype=float)
    np.testing.assert_allclose(curves.bends @ line, 0.0, atol=1e-12)
    np.testing.assert_allclose(curves.slope @ line, KNOTS / 5.0)
    assert np.abs(curves.bends @ line**2).min() == pytest.approx(2.0)


def test_a_branch_has_columns_of_its_own():
    curves = curves_of([LADDER])
    by_branch = curves.basis[70:100].indices, curves.basis[130:160].indices
    assert not set(by_branch[0].tolist()) & set(by_branch[1].tolist())


@pytest.mark.parametrize(
    ("levels", "share"),
    # Of three cycles the first is not met again: what came before its start is not known.
    [([0.0, 1.0, 0.1, 0.8, 0.2, 0.6], 0.0), ([0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0], 2 / 3)],
)
def test_it_is_known_what_is_met_again(levels, share):
    met = curves_of([through(levels, [50] * (len(levels) - 1))]).met_again
    assert met == pytest.approx(share, abs=0.02)
