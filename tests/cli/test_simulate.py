"""The command simulate."""

import json

import numpy as np
import pytest

from fracjax._cli import run
from fracjax._io import read, write_text
from tests.cli.helpers import STEP
from tests.helpers import failure


def test_simulate_what_was_fitted(loop, fitted):
    fitted.save("fit.json")
    assert run(["simulate", loop, "--fit", "fit.json", "--out", "s.csv", "--quiet"]) == 0
    simulated = read("s.csv")
    recording = read(loop)
    np.testing.assert_array_equal(simulated.drive, recording.drive)
    assert (simulated.drive_unit, simulated.response_unit) == ("V", "um")
    if fitted.preparation.takes[0].history == "constant":
        expected = fitted.simulations[0]
        span = np.ptp(expected)
        np.testing.assert_allclose(simulated.response, expected, atol=1e-3 * span)


def test_simulate_needs_the_drive_alone_and_minds_its_unit(fitted, capsys):
    fitted.save("fit.json")
    times = STEP * np.arange(200)
    volts = 50 * np.sin(times) ** 2
    write_text("volts.csv", {"time_s": times, "voltage_V": volts})
    write_text("millivolts.csv", {"voltage_mV": 1000 * volts})
    assert run(["simulate", "volts.csv", "--fit", "fit.json", "--out", "a.csv"]) == 0
    call = ["simulate", "millivolts.csv", "--rate", "100Hz", "--fit", "fit.json", "--out", "b.csv"]
    assert run([*call, "--history", "rest"]) == 0
    a, b = read("a.csv"), read("b.csv")
    np.testing.assert_allclose(a.drive, b.drive, rtol=1e-12)
    np.testing.assert_allclose(a.response, b.response, rtol=1e-6, atol=1e-9)
    write_text("metres.csv", {"time_s": times, "drive_m": volts})
    capsys.readouterr()
    assert run(["simulate", "metres.csv", "--fit", "fit.json", "--out", "c.csv"]) == 2
    assert "expected a value in V" in failure(capsys)


@pytest.mark.parametrize("model", ["foh", "bouc_wen"])
@pytest.mark.parametrize("history", ["constant", "periodic"])
def test_simulate_at_nominal_values(loop, model, history, capsys):
    call = ["simulate", loop, "--model", model, "--out", "s.csv", "--output-unit", "nm", "--json"]
    assert run([*call, "--history", history]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["error"] < 1e-3
    response = read("s.csv").response
    assert told["range"] == [response.min(), response.max()]
    if history == "periodic":
        np.testing.assert_allclose(response[:100], response[-100:], rtol=1e-3, atol=1e-2)
