"""Which other model is nearer."""

import numpy as np

import fracjax as fj
from fracjax._computing import Clock
from fracjax._diagnose._held_out import predict_stretches
from fracjax._diagnose._nearest import nearest_model
from fracjax._prepare import prepare
from tests.diagnose.helpers import TONE, creeping, white


def test_an_interruption_ends_the_comparison_and_marks_the_verdict():
    def interrupted(message: str) -> None:
        raise KeyboardInterrupt

    preparation, clock = prepare([creeping(np.zeros(TONE.size))], noise=white(0.01)), Clock(60.0)
    model = fj.parse_model("creep")
    assert (
        nearest_model(model, 1.0, preparation, None, predict_stretches, interrupted, clock) is None
    )
    assert clock.stopped
