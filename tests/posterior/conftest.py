"""What the tests of this folder share."""

import pytest

import fracjax as fj
from tests.posterior.helpers import SHARP, Cubic, fit_of, recording_of


@pytest.fixture(scope="session")
def cubic() -> fj.Fit:
    return fit_of(Cubic(), recording_of(Cubic(), 0.05), 0.05)


@pytest.fixture(scope="session")
def sampled(cubic, tmp_path_factory) -> fj.Posterior:
    """The linear model with its noise known, sampled to the end."""
    return fj.sample_posterior(
        cubic,
        noise_model=fj.WhiteNoise(),
        priors=SHARP,
        chain=tmp_path_factory.mktemp("chain") / "chain.h5",
        steps=4000,
    )
