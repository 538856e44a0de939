"""What a compensation holds, saves, and refuses."""

import numpy as np
import pytest

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._compensate import SCHEMA, load_compensation
from tests.compensate.helpers import HYSTERESIS, SINE, STEP, model, wanted


def test_the_band_of_draws():
    generator = np.random.default_rng(1)
    gains = generator.normal(0.1, 1e-3, (4, 60))
    law = model(blocks.Creep(0.1, 0.01))
    found = fj.compensate(law, wanted(), draws={"k_c": gains, "mu": np.full((4, 60), 0.01)})
    assert found.band is not None
    # Linear in the gain: the band is that of the gain itself.
    low, high = np.percentile(gains.ravel()[np.linspace(0, 239, 200).astype(int)], [2.5, 97.5])
    np.testing.assert_allclose(found.band[0], SINE * low / 0.1, atol=1e-4)
    np.testing.assert_allclose(found.band[1], SINE * high / 0.1, atol=1e-4)
    worst = max(1 - low / 0.1, high / 0.1 - 1) * SINE.max()
    assert found.max_error_of_band == pytest.approx(worst, abs=1e-4)
    assert fj.compensate(law, wanted()).max_error_of_band is None
    with pytest.raises(fj.InputError, match="none of mu"):
        fj.compensate(law, wanted(), draws={"k_c": gains})


@pytest.mark.parametrize("limits", [None, (0.0, 70.0)])
def test_saved_and_loaded_without_loss(tmp_path, limits):
    found = fj.compensate(
        model(blocks.Creep(0.1, 0.01)),
        wanted(source="sine.csv"),
        limits=limits,
        draws={"k_c": np.array([0.1, 0.11]), "mu": np.array([0.01, 0.02])},
    )
    found.save(tmp_path / "compensation.json")
    again = load_compensation(tmp_path / "compensation.json")
    assert again.to_dict() == found.to_dict()
    assert again.to_dict()["schema"] == SCHEMA
    np.testing.assert_array_equal(again.drive, found.drive)
    found.write_drive(tmp_path / "drive.csv")
    recording = fj.read(tmp_path / "drive.csv")
    np.testing.assert_array_equal(recording.drive, found.drive)
    np.testing.assert_array_equal(recording.response, SINE)


def test_it_predicts_the_response_to_another_drive(tmp_path):
    """A gain with the sensor's offset, in closed form."""
    offset = float(SINE.min()) - 1.0
    compensation = fj.compensate("gain", wanted(), offset=offset)
    gain = float(fj.parse_model("gain").parameters["k"].value)
    drive = np.linspace(0.0, 50.0, 30)
    np.testing.assert_allclose(compensation.predict(drive), gain * drive + offset, rtol=1e-12)
    np.testing.assert_allclose(
        compensation.predict(compensation.drive), compensation.predicted, atol=1e-9
    )
    with pytest.raises(fj.InputError, match="expected the units of"):
        compensation.predict(fj.Recording(SINE, SINE, STEP, "V", "nm"))
    compensation.save(tmp_path / "compensation.json")
    with pytest.raises(fj.InputError, match="found one loaded from a file; compensate again"):
        load_compensation(tmp_path / "compensation.json").predict(drive)


@pytest.mark.parametrize("content", ["", "{}", '{"schema": "fracjax.fit/1"}', "[]"])
def test_what_is_no_compensation_is_refused(tmp_path, content):
    path = tmp_path / "compensation.json"
    path.write_text(content)
    with pytest.raises(fj.InputError, match="expected a compensation saved by fracjax"):
        load_compensation(path)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"limits": (70.0, 0.0)}, "the lower limit, then the upper"),
        ({"limits": (np.nan, 0.0)}, "the lower limit, then the upper"),
        ({"slew": 0.0}, "a rate above 0"),
        ({"regularisation": -1.0}, "a time of 0 s or more"),
        ({"offset": np.inf}, "a finite number"),
        ({"history": "never"}, "one of rest, constant, periodic"),
        ({"drive_unit": "volt-ish"}, "expected a unit"),
    ],
)
def test_unusable_calls_are_refused(options, said):
    with pytest.raises(fj.InputError, match=said):
        fj.compensate(model(HYSTERESIS), wanted(), **options)


@pytest.mark.parametrize(
    ("response", "said"),
    [
        (np.zeros(100), "a signal that varies"),
        (np.arange(5.0), "at least 32 samples"),
        (np.full(100, np.nan), "a finite number"),
        (np.ones((50, 2)), "one axis"),
    ],
)
def test_unusable_trajectories_are_refused(response, said):
    with pytest.raises(fj.InputError, match=said):
        fj.Trajectory(response, STEP)


def test_a_model_without_a_drive_is_refused():
    drift = blocks.ThermalDrift(1.0, longest=10.0)
    with pytest.raises(fj.InputError, match="a model with a drive"):
        fj.compensate(model(drift), wanted())
    with pytest.raises(fj.InputError, match="whose response follows its drive"):
        fj.compensate(model(blocks.Creep(0.0, 0.01)), wanted())


def test_a_compensation_shows_itself():
    found = fj.compensate(model(blocks.Creep(0.1, 0.01)), wanted(source="sine.csv"), limits=(0, 70))
    text = repr(found)
    assert len(text.splitlines()) < 20
    assert text.startswith("Drive of ")
    assert "along sine.csv: limited" in text
    assert "upper limit" in found.summary()
    assert "<table>" in found._repr_html_()
    table = found.to_dataframe()
    np.testing.assert_array_equal(table["drive"], found.drive)
    motion, drive, error = found.plot().axes
    assert len(motion.lines) == 2
    np.testing.assert_array_equal(error.lines[0].get_ydata(), found.error)
    assert np.asarray(drive.lines[1].get_ydata())[0] == 0.0  # the lower limit
    assert len(found.plot_residuals().axes) == 1
