"""The level from which an effect is named is the posterior's own on the expected recording."""

from dataclasses import replace

import numpy as np
import pytest

from fracjax._path._expansion import apart, family_of
from fracjax._path._named import SURE, levels
from fracjax._path._posterior import Kind, Law, search
from fracjax._path._prior import Inner

COUNT = 2000
TIMES = np.linspace(0, 1, COUNT)
COLUMNS = {
    "creep": [np.log1p(TIMES / 0.01), np.log1p(TIMES / 0.1)],
    "mains_interference": [np.cos(300 * TIMES), np.sin(300 * TIMES)],
    "thermal_drift": [np.exp(-TIMES / 0.2)],
    "gain_drift": [np.exp(-TIMES / 0.22)],
    "drive_lag": [30 * np.exp(-TIMES / 0.19)],
}


def law_of(*names: str) -> Law:
    """A law of white noise with columns of effects: of creep two shapes, of others all at once."""
    signals, kinds = [], []
    for name in names:
        at, own = len(signals), COLUMNS[name]
        signals += own
        width = 1 if name == "creep" else len(own)
        kinds += [Kind(name, k, k + width, name == "creep") for k in range(at, len(signals), width)]
    matrix = np.stack(signals, axis=1)
    inner = Inner(matrix.T @ matrix, np.zeros(len(signals)), 0.0, 0.0)
    return Law("path", kinds, inner, COUNT, 0.002, apart())


def probability(law: Law, k: int, level: float) -> float:
    """That the effect of the k-th column or one of its family is there, on the recording that is
    expected where it has a detectability."""
    gram = law.inner.columns
    share = law.tempered(0.0).count / law.count
    along = gram[k] * level / np.sqrt(share * gram[k, k])
    square = COUNT + level**2 / share
    posterior = search(replace(law, inner=Inner(gram, along, square, 0.0)), 0.0)
    name = next(kind.name for kind in law.kinds if kind.start <= k < kind.stop)
    return sum(posterior.probability_of(n) for n in {name, *family_of(name)})


@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_at_its_level_an_effect_is_as_likely_as_what_is_named(k):
    law = law_of("creep", "mains_interference")
    level = float(levels(law, np.eye(4))[k])
    assert 3 < level < 6
    assert probability(law, k, level) == pytest.approx(SURE, abs=0.01)
    assert probability(law, k, 0.8 * level) < 0.8 * SURE


def test_what_looks_alike_must_be_larger_to_be_named():
    alone = levels(law_of("thermal_drift"), np.eye(1))[0]
    law = law_of("thermal_drift", "gain_drift")
    beside = float(levels(law, np.eye(2))[0])
    assert beside > 3 * alone
    assert probability(law, 0, beside) == pytest.approx(SURE, abs=0.01)


def test_what_is_the_same_is_never_named():
    law = law_of("thermal_drift", "thermal_drift")
    law = replace(law, kinds=[law.kinds[0], law.kinds[1]._replace(name="gain_drift")])
    assert np.all(levels(law, np.eye(2)) == np.inf)


def test_what_is_in_series_has_one_size():
    """A lag of this shape is far larger than a drift that is only just seen."""
    alone = levels(law_of("thermal_drift"), np.eye(1))[0]
    beside = levels(law_of("thermal_drift", "drive_lag"), np.eye(2))[0]
    assert beside == pytest.approx(alone, rel=0.02)
