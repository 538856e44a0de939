"""What the tests of this folder share."""

import pytest

import fracjax as fj
from tests.fit.creep import CLEAN, fit, record


@pytest.fixture(scope="session")
def plain() -> fj.Fit:
    return fit(record(CLEAN))
