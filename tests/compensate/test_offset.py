"""The sensor's zero of a stage at rest."""

import numpy as np

import fracjax as fj
from fracjax import blocks
from fracjax._compensate import settled_offset

STEP, COUNT = 0.01, 1000
DRIVE = 50 - 50 * np.cos(2 * np.pi * STEP * np.arange(COUNT))


def test_a_fit_from_zero_reads_the_same_when_the_stage_has_rested():
    """Creep after a curve that is not zero at zero: its transient is made up for on average."""
    bent = blocks.SensorNonlinearity(0.05, 0.0, centre=5.0, span=10.0)
    law = blocks.QuasiStaticForce(0.1) >> bent >> blocks.LogarithmicCreep(0.05, 0.01)
    model, offset = fj.Model(law, "bent"), -2.0
    read = fj.simulate(model, DRIVE, STEP, "rest").response + offset
    settled = settled_offset(model, offset, "rest", STEP * COUNT)
    stream = fj.streaming_model(model, STEP, (0.01, 10.0), limits=(0, 100), offset=settled)
    error = (read - stream.run(DRIVE, stream.start(0.0)).output)[COUNT // 10 :]
    span = np.ptp(read)
    assert np.abs(error).max() < 0.003 * span
    assert abs(settled - offset) > 0.005 * span
    assert settled_offset(model, offset, "constant", STEP * COUNT) == offset


def test_a_law_that_is_zero_at_zero_needs_no_change():
    model = fj.Model(blocks.FOH(0.05, 0.05, 0.0, 0.1, -0.1), "foh")
    assert settled_offset(model, 1.5, "rest", 10.0) == 1.5
