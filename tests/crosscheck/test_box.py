"""The box that searches stay in."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fracjax._blocks import LFDH
from fracjax._parameters import named_parameters
from fracjax._prepare._layout import layout_of, position_of, with_shapes_at


@given(st.lists(st.floats(0, 1), min_size=3, max_size=3))
def test_the_cube_spans_the_bounds_and_no_more(shares):
    block = LFDH()
    moved = with_shapes_at(block, jnp.asarray(shares))
    for name, size in layout_of(block).shapes:
        parameter = named_parameters(moved)[name]
        assert size == 1
        slack = 1e-12 * abs(parameter.upper)
        assert parameter.lower - slack <= parameter.value <= parameter.upper + slack
    np.testing.assert_allclose(position_of(moved), shares, atol=1e-9)


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_the_corners_are_the_bounds(end):
    moved = named_parameters(with_shapes_at(LFDH(), jnp.full(3, end)))
    for name, _ in layout_of(LFDH()).shapes:
        bound = moved[name].upper if end else moved[name].lower
        assert float(moved[name].value) == pytest.approx(float(bound), rel=1e-12)
