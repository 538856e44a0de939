"""A fit and a diagnosis to be reported."""

import pytest

from fracjax._diagnose import Diagnosis
from fracjax._fit import Fit
from tests.results import diagnosis_of, small_fit


@pytest.fixture(scope="package")
def fitted() -> Fit:
    return small_fit()


@pytest.fixture(scope="package")
def diagnosis(fitted: Fit) -> Diagnosis:
    return diagnosis_of(fitted)
