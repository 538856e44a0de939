"""What a fit and a comparison show of themselves, and what they predict."""

import numpy as np
import pandas as pd
import pytest

import fracjax as fj
from tests.fit.creep import CLEAN, DRIVE, SIGMA, STEP, fit, record
from tests.helpers import by_name


@pytest.fixture(scope="module")
def found() -> fj.Fit:
    return fit(record(CLEAN))


@pytest.fixture(scope="module")
def compared() -> fj.Comparison:
    options = {"noise": "10 nm", "starts": 1, "history": "constant", "settling": 0}
    return fj.compare(["creep", "gain"], record(CLEAN), **options)


def test_a_fit_is_short_at_the_prompt_and_complete_in_its_summary(found):
    text = repr(found)
    assert len(text.splitlines()) < 20
    assert text.startswith("creep fitted to recording: error 0.")
    assert "times the noise floor of 0.01 µm" in text
    summary = found.summary()
    assert repr(summary) == summary  # a notebook shows lines and no \n
    for estimate in found.estimates:
        assert estimate.name in text
        assert f"{estimate.value:.2g}"[:4] in summary
    for said in ("± error", "95 % interval", "BIC", "samples used", "mu, k_c"):
        assert said in summary
    value = float(summary.split("mu, k_c")[1].split()[0])
    assert value == pytest.approx(found.correlation[0, 1], abs=1e-4)
    assert found._repr_html_().count("<tr>") > len(found.estimates)


def test_names_are_escaped_in_a_notebook():
    named = fj.Recording(DRIVE, CLEAN + SIGMA, STEP, "V", "um", source="<b>.csv")
    assert "&lt;b&gt;.csv" in named._repr_html_()
    assert "<b>.csv" not in named._repr_html_()


def test_the_correlation_is_that_of_the_derivatives(found):
    """Of an independent computation, by finite differences, as white noise is known."""
    model = found.model
    centre = {n: float(p.value) for n, p in model.parameters.items()}

    def response(name: str, change: float) -> np.ndarray:
        moved = model.with_values(centre | {name: centre[name] + change})
        return fj.simulate(moved, DRIVE, STEP).response

    names = [e.name for e in found.estimates]
    steps = [1e-3 * centre[name] for name in names]
    columns = [
        (response(n, h) - response(n, -h)) / (2 * h) for n, h in zip(names, steps, strict=True)
    ]
    columns.append(np.ones(len(DRIVE)))  # the offset
    covariance = np.linalg.inv(np.stack(columns) @ np.stack(columns).T)[:2, :2]
    expected = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert found.correlation[0, 1] == pytest.approx(expected, abs=2e-3)


def test_parameters_are_reached_by_name_and_an_unknown_one_is_named(found):
    assert found.parameters["mu"] is by_name(found)["mu"]
    with pytest.raises(fj.InputError, match=r'parameter "m": expected one of mu, k_c, found none'):
        _ = found.parameters["m"]


def test_the_tables_hold_the_estimates(found):
    table = found.to_dataframe()
    assert isinstance(table, pd.DataFrame)
    assert list(table.index) == [e.name for e in found.estimates]
    assert table.loc["mu", "value"] == by_name(found)["mu"].value
    samples = record(CLEAN).to_dataframe()
    assert list(samples.columns) == ["time_s", "drive_V", "response_um"]
    np.testing.assert_array_equal(samples["drive_V"], DRIVE)


def test_a_fit_predicts_what_it_simulated_and_other_drives(found):
    np.testing.assert_allclose(found.predict(DRIVE), found.simulations[0], atol=SIGMA / 10)
    np.testing.assert_array_equal(found.predict(record(CLEAN)), found.predict(DRIVE, STEP))
    twice = found.predict(2 * DRIVE) - found.offsets[0]
    np.testing.assert_allclose(twice, 2 * (found.predict(DRIVE) - found.offsets[0]), atol=1e-6)
    other = fj.Recording(DRIVE, CLEAN, STEP, "V", "nm")
    with pytest.raises(fj.InputError, match="expected the units of recording"):
        found.predict(other)


def test_simulate_takes_a_recording_or_a_drive_with_its_step():
    recording = record(CLEAN)
    expected = fj.simulate("creep", DRIVE, STEP).response
    np.testing.assert_array_equal(fj.simulate("creep", recording).response, expected)
    np.testing.assert_array_equal(fj.simulate("creep", DRIVE, "2 ms").response, expected)
    with pytest.raises(fj.InputError, match="found no step; give step in seconds"):
        fj.simulate("creep", DRIVE)
    with pytest.raises(fj.InputError, match="found a recording and a step; omit the step"):
        fj.simulate("creep", recording, STEP)
    with pytest.raises(fj.InputError, match="expected a Model, found a Recording"):
        fj.simulate(recording, recording)  # type: ignore[arg-type]


def lines_of(figure) -> list[np.ndarray]:
    return [np.asarray(line.get_ydata()) for axes in figure.axes for line in axes.lines]


def test_pictures_show_what_was_measured_and_what_remains(found, tmp_path):
    drawn = lines_of(found.plot())
    for signal in (CLEAN + found.residuals[0] * 0, found.residuals[0]):
        assert any(
            line.size == signal.size and np.abs(line - signal).max() < 6 * SIGMA for line in drawn
        )
    path = tmp_path / "residuals.png"
    found.plot_residuals().savefig(path)
    assert path.read_bytes()[:4] == b"\x89PNG"
    assert found.plot()._repr_png_()[:4] == b"\x89PNG"
    assert len(record(CLEAN).plot().axes) == 3
    with pytest.raises(fj.InputError, match="recording: expected a number from 0 to 0, found 1"):
        found.plot(1)


def test_a_comparison_shows_its_models_best_first(compared):
    text = repr(compared)
    assert len(text.splitlines()) < 20
    assert text.startswith("2 models compared: best by BIC and on data held out is creep.")
    assert list(compared.to_dataframe().index) == ["creep", "gain"]
    (panel,) = compared.plot().axes
    assert [label.get_text() for label in panel.get_yticklabels()] == ["creep", "gain"]
    assert len(compared.plot_residuals().axes) == 2


def test_any_result_and_model_is_short_at_the_prompt():
    frequencies = np.geomspace(1, 1e3, 40)
    table = fj.frequency_table(frequencies, np.ones(40), np.zeros(40))
    for thing in (table, fj.parse_model("foh >> minor_loop_memory + creep"), record(CLEAN)):
        assert len(repr(thing).splitlines()) < 20
        assert thing._repr_html_().startswith("<div>")


def test_a_comparison_predicts_as_its_best_fit(compared):
    assert compared.best == "creep"
    np.testing.assert_array_equal(
        compared.predict(2 * DRIVE, STEP, "rest"), compared.fits[0].predict(2 * DRIVE, STEP, "rest")
    )
