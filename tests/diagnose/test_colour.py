"""The colour of a misfit."""

import numpy as np
import pytest
from scipy.signal import lfilter

from fracjax._diagnose._colour import colour_of
from fracjax._diagnose._fitted import Corrected
from fracjax._prepare import Preparation, prepare
from tests.diagnose.helpers import TIMES, creeping, white


def test_a_coloured_series_is_whitened_to_unit_variance():
    white = np.random.default_rng(0).standard_normal(20_000)
    coloured = 3 * np.asarray(lfilter([1.0], [1.0, -1.4, 0.6], white))
    taps = colour_of(coloured)
    whitened = np.asarray(lfilter(taps, [1.0], coloured))[20:]
    assert whitened.std() == pytest.approx(1.0, rel=0.02)
    assert abs(np.corrcoef(whitened[1:], whitened[:-1])[0, 1]) < 0.02
    np.testing.assert_allclose(3 * taps[:3], [1.0, -1.4, 0.6], atol=0.05)


def test_a_line_of_the_drive_is_part_of_it():
    times = np.arange(4000)
    taps = colour_of(np.sin(0.02 * times) + 0.01 * np.random.default_rng(1).standard_normal(4000))
    slow = np.sin(0.02 * times)
    assert np.asarray(lfilter(taps, [1.0], slow))[50:].std() < 0.3 * taps[0] * slow.std()


def test_white_noise_has_none():
    taps = colour_of(2 * np.random.default_rng(2).standard_normal(3000))
    assert taps.size == 1
    assert taps[0] == pytest.approx(0.5, rel=0.05)


def test_another_noise_leaves_the_correction_of_the_grid_as_it_is():
    """Problems of another noise are made from the uncorrected ones, not corrected twice."""
    prepared = prepare([creeping(np.zeros(TIMES.size))], noise=white(0.01))
    defect = 1e-3 * np.arange(len(prepared.problems()[0].response))
    own = {name: getattr(prepared, name) for name in Preparation.__dataclass_fields__}
    corrected = Corrected(**own, defects=(defect,))
    (problem,) = corrected.with_noises([white(0.02)]).problems()
    np.testing.assert_array_equal(problem.response, prepared.problems()[0].response - defect)
    assert problem.whitening[0] == pytest.approx(corrected.problems()[0].whitening[0] / 2)
