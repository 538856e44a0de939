"""Plays of a drive against their definition, sample by sample."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fracjax._path._fading import openings_of


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=60), st.floats(0.0, 1.5))
def test_a_play_is_clipped_at_each_sample(levels, width):
    drive, inner = np.array(levels), levels[0]
    behind = []
    for value in levels:
        inner = min(max(inner, value - width), value + width)
        behind.append(inner - value)
    np.testing.assert_allclose(openings_of(drive, [width])[:, 0], behind, atol=1e-12)
