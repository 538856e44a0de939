"""The rows of a batch are the results of fit."""

import numpy as np

import fracjax as fj
from tests.batch.helpers import OUT, STEP, batch, cheap_model, recording, told


def test_rows_are_fits_to_the_last_bit():
    recordings = [recording(k, 232 + 6 * k, f"number {k}") for k in range(4)]
    rows = batch(recordings)
    assert list(rows["source"]) == ["number 0", "number 1", "number 2", "number 3"]
    assert set(rows["status"]) == {"fitted"}
    for given, row in zip(recordings, rows.to_dict("records"), strict=True):
        expected = fj.fit(fj.parse_model("creep"), given, starts=2).to_dict()
        for name, estimate in expected["parameters"].items():
            assert {key: row[f"{name}.{key}"] for key in estimate} == estimate
        for name, score in expected["scores"].items():
            assert row[name] == score
        assert row["offset"] == expected["offsets"][0]
        assert (row["noise_sigma"], row["noise_method"]) == (
            expected["noise"]["sigma"],
            expected["noise"]["method"],
        )
        assert row["history"] == expected["assumptions"][0]["history"]
        assert (row["samples"], row["step_s"]) == (len(given), STEP)
        assert (row["drive_unit"], row["response_unit"]) == ("V", "um")


def test_a_program_serves_a_bucket_of_lengths(monkeypatch):
    """After one recording of each of two buckets nothing is traced, let alone compiled, again."""
    law, traced = fj.blocks.Creep, []
    whole = law.symbol

    def counted(self, s):
        traced.append(1)
        return whole(self, s)

    monkeypatch.setattr(law, "symbol", counted)
    fj.fit_batch(cheap_model(), [recording(0, length) for length in (50, 60)], out=OUT, starts=1)
    first = len(traced)
    assert first > 0
    lengths = (49, 51, 52, 53, 57, 58, 61, 62)
    rows = fj.fit_batch(
        cheap_model(), [recording(0, length) for length in lengths], out=OUT, starts=1
    )
    assert len(traced) == first
    assert list(rows["samples"]) == list(lengths)


def test_precision_is_left_alone(float32_default):
    import jax.numpy as jnp

    (row,) = told([recording(0)])
    assert jnp.ones(1).dtype == np.float32
    found = fj.fit(fj.parse_model("creep"), recording(0), starts=2)
    assert row["rmse"] == found.scores.rmse
