"""The noise that path curves take up, by frequency."""

import numpy as np
import pytest

from fracjax._path import Whitening
from fracjax._path._law import PathLaw, Settled
from fracjax._path._spent import spent_of
from tests.path.helpers import through

DRIVES = [through([0.0, 1.0, 0.2, 0.9, 0.1, 0.8], [120] * 5), through([0.1, 0.8, 0.2], [150] * 2)]
SIZES = [d.size for d in DRIVES]


@pytest.fixture(scope="module")
def settled() -> Settled:
    whitening = Whitening([np.array([1 / 0.02])] * 2, [np.ones(size) for size in SIZES])
    return Settled(PathLaw.of(DRIVES, whitening, 1.2), 0.3, 0.03)


def test_curves_take_what_is_slow_and_leave_what_is_fast(settled):
    for share in spent_of(settled, np.cumsum(SIZES)[:-1]):
        assert share[: share.size // 40].min() > 0.9
        assert share[-share.size // 4 :].max() < 0.25


def test_over_all_frequencies_it_is_the_trace_of_what_they_take(settled):
    """Of a dense matrix, not of probes."""
    size = sum(SIZES)
    taken = np.eye(size) - settled.prior.weighted(np.eye(size))
    ends = np.cumsum(SIZES)[:-1]
    shares = spent_of(settled, ends)
    for own, share in zip(np.split(np.diag(taken), ends), shares, strict=True):
        assert share.mean() == pytest.approx(own.mean(), abs=0.03)


def test_it_is_what_noise_lacks_at_each_frequency(settled):
    """The best guess of a curve with noise leaves σ² (1 - s) of the spectrum σ² of the noise."""
    rng, size = np.random.default_rng(1), sum(SIZES)
    law = settled.law
    prior = np.linalg.inv(law.bends.toarray() / 0.3**2 + np.eye(law.columns) / law.span**2)
    root, basis = np.linalg.cholesky(prior), law.curves.basis.toarray()
    dense = np.concatenate([law.fading * 0.03 * law.span, law.own], axis=1)
    curves = basis @ root @ rng.standard_normal((law.columns, 300))
    curves += dense @ rng.standard_normal((dense.shape[1], 300))
    white = law.whitening(curves) + rng.standard_normal((size, 300))
    ends = np.cumsum(SIZES)[:-1]
    parts = np.split(settled.prior.weighted(white), ends)
    for rest, share, size in zip(parts, spent_of(settled, ends), SIZES, strict=True):
        power = np.mean(np.abs(np.fft.rfft(rest, axis=0)) ** 2, axis=1) / size
        bands = [np.mean(part) for part in np.array_split(power, 12)]
        expected = [np.mean(part) for part in np.array_split(1 - share, 12)]
        np.testing.assert_allclose(bands, expected, atol=0.08)
