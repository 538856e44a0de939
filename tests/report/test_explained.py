"""What a candidate would explain: all of its own mark, and nothing of noise."""

from dataclasses import replace

import jax
import numpy as np
import pytest

from fracjax._blocks import EFFECTS
from fracjax._report._explained import drawn_candidates, explained_by


@pytest.mark.parametrize("scale", [0.3, -2.0])
def test_a_residual_that_is_the_mark_of_an_effect_is_explained_whole(fitted, scale):
    take = fitted.preparation.takes[0]
    with jax.enable_x64(True):
        problem = fitted.preparation.problems()[0]
        drive = np.asarray(problem.drive)
        block = fitted.model.block
        fine = np.asarray(block.respond(drive, problem.grid))
        effect = EFFECTS["creep"]
        trial = effect.trials(fitted.preparation.setting)[0]
        change = np.asarray(effect.respond(block, trial, drive, fine, problem.grid)) - fine
    mark = scale * change[:: problem.oversampling][: len(take.recording)]
    changed = replace(
        fitted, simulations=(take.recording.response - mark,)
    )  # its residual is the mark
    (curve,) = explained_by(changed, 0, ["creep"])
    assert curve == pytest.approx(mark, abs=1e-6 * np.abs(mark).max())


def test_noise_stays_unexplained(fitted):
    (curve,) = explained_by(fitted, 0, ["creep"])
    residual = fitted.residuals[0]
    free = len(fitted.estimates) + 2
    assert np.sum(curve**2) < 5 * free * residual.var()


def test_named_effects_and_their_look_alikes_are_drawn_first(diagnosis):
    second = replace(diagnosis.effects[0], name="saturation", confusable_with=("resonance",))
    names = [c.name for c in drawn_candidates(replace(diagnosis, effects=(second,)))]
    assert names == ["saturation", "resonance", "creep", "drive_lag"]
