"""What the tests of this folder share."""

import pytest

from fracjax._crosscheck import Crosscheck, _crosscheck
from fracjax._prepare._layout import position_of
from fracjax._solve._least_squares import Objective
from tests.crosscheck.helpers import FEW, check, cost_at


@pytest.fixture(scope="session")
def checked() -> Crosscheck:
    return check()


@pytest.fixture(scope="session")
def sabotaged(checked) -> Crosscheck:
    """The gradient fit stopped at its first point."""

    def stopped(block, preparation, starts, seed):
        problems = preparation.problems()
        cost = cost_at(block, problems, position_of(block))
        return _crosscheck.solved_at(
            Objective(block, problems), position_of(block), preparation,
            converged=True, costs=(float(cost),), evaluations=1,
        )  # fmt: skip

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_crosscheck, "fit_block", stopped)
        return check(**FEW)
