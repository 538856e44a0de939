"""Pictures of effects: their change is of the loop that they are drawn on."""

import numpy as np
import pytest

from fracjax._blocks import EFFECTS
from fracjax._report._effect_picture import _SPAN, _largest_change, draw_effect


# At the drive, at the response, and beside the model.
@pytest.mark.parametrize("name", ["drive_lag", "backlash", "thermal_drift"])
def test_a_change_is_a_part_of_the_response(name):
    change = _largest_change(EFFECTS[name])
    assert 1e-3 * _SPAN < np.abs(change).max() < 0.5 * _SPAN


def test_a_picture_stacked_for_a_narrow_page_is_higher_than_wide(tmp_path):
    sizes = []
    for stacked in (False, True):
        draw_effect("saturation", tmp_path / "effect.png", stacked=stacked)
        header = (tmp_path / "effect.png").read_bytes()[16:24]
        sizes.append((int.from_bytes(header[:4]), int.from_bytes(header[4:])))
    (wide, low), (narrow, high) = sizes
    assert wide > low
    assert high > narrow
