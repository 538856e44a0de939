"""Inner products under a covariance of loop shapes, against the dense matrices."""

import numpy as np
import pytest

from fracjax._diagnose._gram import Gram

GENERATOR = np.random.default_rng(5)
RESIDUAL = GENERATOR.standard_normal(120)
COLUMNS = GENERATOR.standard_normal((120, 6))
SHAPES = GENERATOR.standard_normal((120, 9)) * np.geomspace(1, 0.01, 9)
TANGENT = GENERATOR.standard_normal((120, 3))


@pytest.fixture
def gram() -> Gram:
    return Gram(RESIDUAL, COLUMNS, SHAPES, TANGENT, 120)


def beside(signals: np.ndarray) -> np.ndarray:
    basis = np.linalg.qr(TANGENT)[0]
    return signals - basis @ (basis.T @ signals)


@pytest.mark.parametrize("tau", [0.0, 0.1, 3.0])
def test_inner_products_are_those_of_the_dense_covariance(gram, tau):
    shapes = beside(SHAPES)
    covariance = np.eye(120) + tau**2 * shapes @ shapes.T
    solved = np.linalg.solve(covariance, np.column_stack([beside(COLUMNS), beside(RESIDUAL)]))
    inner = gram.under(tau)
    np.testing.assert_allclose(inner.columns, beside(COLUMNS).T @ solved[:, :-1], atol=1e-9)
    np.testing.assert_allclose(inner.along, beside(COLUMNS).T @ solved[:, -1], atol=1e-9)
    assert inner.square == pytest.approx(beside(RESIDUAL) @ solved[:, -1])
    assert inner.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1], abs=1e-9)


def test_columns_may_be_a_further_part_of_the_covariance(gram):
    chosen, sizes = np.array([1, 4]), np.array([0.5, 2.0])
    covariance = (
        np.eye(120) + (beside(COLUMNS)[:, chosen] * sizes**2) @ beside(COLUMNS)[:, chosen].T
    )
    inner = gram.under(0.0).given(chosen, sizes)
    assert inner.square == pytest.approx(
        beside(RESIDUAL) @ np.linalg.solve(covariance, beside(RESIDUAL))
    )
    assert inner.log_determinant == pytest.approx(np.linalg.slogdet(covariance)[1])


def test_the_remainder_is_the_residual_minus_the_most_probable(gram):
    remainder = gram.remainder(1.0, np.array([2]), np.array([1e6]))
    # Free columns explain everything along them.
    assert abs(beside(COLUMNS)[:, 2] @ remainder) < 1e-6
    np.testing.assert_allclose(gram.remainder(0.0, np.zeros(0, int), np.zeros(0)), beside(RESIDUAL))


def test_a_column_that_the_fit_absorbs_completely_is_none():
    columns = np.column_stack([TANGENT @ np.ones(3), COLUMNS[:, 0]])
    gram = Gram(RESIDUAL, columns, SHAPES, TANGENT, 120)
    assert gram.concealments[0] == pytest.approx(1.0)
    assert not gram.columns[:, 0].any()
    assert gram.count == 117
