"""The numerical error of a fit."""

import numpy as np

import fracjax as fj
from benchmarks.concealed.cases import make_case
from fracjax._fit import settle
from fracjax._prepare import prepare
from fracjax._solve import _numerics, solve_again
from tests.diagnose.helpers import recording_of


def test_the_numerical_error_falls_when_the_grid_is_refined():
    case = make_case("foh", "none", "bursts")
    preparation = prepare([recording_of(case)])
    solved = settle(fj.parse_model("foh").block, preparation, history="constant", starts=1, seed=0)
    errors = []
    for oversampling in (1, 2, 4):
        finer = solve_again([solved], [preparation.with_oversampling(oversampling)])
        errors.append(_numerics._accurate_grids(finer, [np.inf])[0][1])
    assert errors[0] > 4 * errors[1] > 16 * errors[2]
