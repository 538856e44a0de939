"""What curves leave of an effect, and of what they take for their own."""

import numpy as np
import pytest

from fracjax._path._absorbed import unabsorbed
from fracjax._path._dynamics import Columns

ROWS = 400


def of_curves() -> tuple[np.ndarray, np.ndarray]:
    """Directions (N, 5) that curves absorb, and (N, 3) that they do not see, all orthonormal."""
    q = np.linalg.qr(np.random.default_rng(0).standard_normal((ROWS, 8)))[0]
    return q[:, :5], q[:, 5:]


def inner(columns: np.ndarray, curves: np.ndarray) -> np.ndarray:
    rest = columns - curves @ (curves.T @ columns)
    return rest.T @ rest


@pytest.mark.parametrize(("share", "is_there"), [(0.05, True), (0.008, True), (0.002, False)])
def test_an_effect_is_there_where_curves_leave_enough_of_it(share, is_there):
    curves, others = of_curves()
    column = 30 * (np.sqrt(1 - share**2) * curves[:, :1] + share * others[:, :1])
    one = Columns("creep", {"onset": 1.0}, column, True)
    (seen,), turn = unabsorbed([one], column, inner(column, curves))
    np.testing.assert_allclose(seen.values, column if is_there else 0 * column)
    np.testing.assert_array_equal(turn, [[float(is_there)]])


def test_of_a_group_the_directions_that_are_left_stay_whole():
    """A gain that curves absorb does not hide the offset beside it, and as large as before."""
    curves, others = of_curves()
    gain = 50 * curves[:, 0] + 0.1 * others[:, 1]
    group = np.column_stack([gain, 3 * others[:, 0] + curves[:, 1]])
    one = Columns("degradation", {"path": 3.0}, group, False)
    (seen,), _ = unabsorbed([one], group, inner(group, curves))
    assert seen.values.shape == group.shape
    assert not seen.values[:, 1].any()
    offset = seen.values[:, 0] * np.sign(seen.values[:, 0] @ group[:, 1])
    np.testing.assert_allclose(offset, group[:, 1], atol=0.02 * np.abs(group).max())


def test_what_belongs_in_series_is_left_to_its_chain():
    curves, _ = of_curves()
    one = Columns("sensor_lag", {"corner": 3.0, "order": 1.0}, curves[:, :1], True)
    (seen,), turn = unabsorbed([one], curves[:, :1], inner(curves[:, :1], curves))
    assert seen.values is not one.values
    np.testing.assert_array_equal(turn, [[1.0]])
