"""The viscoelastic layer beside a Mittag-Leffler function."""

import numpy as np
import pytest
from scipy.special import erfcx

import fracjax as fj
from fracjax._blocks import ViscoelasticLayer
from fracjax._parameters import set_values


def test_a_layer_relaxes_as_a_mittag_leffler_function():
    """Of order 1/2 after a step: 1 - Δ E_½(-√(t/τ)), E_½(-x) = exp(x²) erfc(x); of order near 1 an
    exponential."""
    times = np.arange(1, 400) * 1e-2
    block = ViscoelasticLayer(0.3, 0.5, 0.5)
    found = fj.step_response(block, np.append(0.0, times))[1:]
    np.testing.assert_allclose(found[20:], (1 - 0.3 * erfcx(np.sqrt(times / 0.5)))[20:], atol=2e-4)
    single = set_values(block, {"order": 1.0})
    found = fj.step_response(single, np.append(0.0, times))[1:]
    np.testing.assert_allclose(found, 1 - 0.3 * np.exp(-times / 0.5), atol=1e-4)


def test_a_layer_stiffens_from_one_to_the_share_that_is_left():
    block = ViscoelasticLayer(0.3, 1.0, 0.4)
    slow, fast = np.abs(fj.frequency_response(block, [1e-12, 1e12]))
    assert slow == pytest.approx(1, abs=1e-4)
    assert fast == pytest.approx(0.7, abs=1e-4)
    # A layer that the motion passes through leads instead.
    leading = set_values(block, {"strength": -0.3})
    assert (
        np.angle(fj.frequency_response(leading, 0.2))
        > 0
        > np.angle(fj.frequency_response(block, 0.2))
    )
