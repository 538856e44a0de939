"""What an oracle must expect of a recording it has not seen, against refits of many recordings."""

import numpy as np
import pytest

from .actuator import Actuator, draw_law, rms
from .oracle import expected_rmse, numbers
from .templates import make_drive
from .truth import EFFECTS, noise

SD = 0.02  # um


@pytest.mark.parametrize("colour", ["white", "ar"])
def test_expectation_is_what_refits_show(colour: str) -> None:
    """An FOH law refitted by least squares, without the noise of the held-out recording."""
    training = make_drive("ladder", 5, 500.0, 1500)
    law = draw_law("foh", training, 5)
    seen, unseen = (
        Actuator("foh", law, drive) for drive in (training, make_drive("steps", 6, 500.0, 1500, 5))
    )
    expected = expected_rmse(seen, unseen, [], colour, SD, 0.0)
    errors = []
    for seed in range(30):
        e = noise(colour, len(seen.plain), SD, np.random.default_rng(seed))
        shape, gains, _ = seen.absorber.fit(seen.plain + e)
        errors.append(rms(unseen.absorber.matrix(shape) @ gains - unseen.plain))
    # Unweighted least squares, by Gauss and Markov the best where the noise is white and no better
    # where it is not; the mean's own sd is a tenth.
    found = rms(np.array(errors))
    assert found > 0.75 * expected
    assert colour == "ar" or found < 1.35 * expected


def test_every_number_counts_once_and_one_more_makes_it_worse() -> None:
    training, other = make_drive("ladder", 5, 500.0, 1500), make_drive("sine", 6, 500.0, 1500, 5)
    law = draw_law("bouc_wen", training, 5)
    seen, unseen = Actuator("bouc_wen", law, training), Actuator("bouc_wen", law, other)
    effect = EFFECTS["sensor_lag"]
    lag = [(effect, {"order": 1, "tau": 0.01})]
    assert numbers(law, lag) == [*((0, name, None) for name in law), (1, "tau", None)]
    alone, both = (expected_rmse(seen, unseen, pairs, "white", SD, 0.0) for pairs in ([], lag))
    assert alone < both
