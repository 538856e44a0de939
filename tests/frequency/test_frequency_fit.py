"""Fits to frequency responses: truth recovered, errors honest, tables read as they are written."""

import json
from typing import Any

import numpy as np
import pytest

import fracjax as fj
from fracjax._cli import run
from fracjax._io import write_text
from tests.helpers import by_name, without_progress

FREQUENCIES = np.geomspace(0.1, 500, 30)
TRUE = {"k_0": 0.02, "k_delta": 0.12, "chi": 0.2, "delta": 0.3, "mu": 0.6}
LAW = fj.parse_model("lfdh").with_values(TRUE)
EXACT = fj.frequency_response(LAW.block, FREQUENCIES)
OF_AMPLITUDE, OF_PHASE = 2e-3, 0.1  # relative, degrees


def table(seed: int = 0, exact=EXACT, errors: bool = True, scale: float = 1.0, **options):
    generator = np.random.default_rng(seed)
    count = len(exact)
    amplitude = np.abs(exact) * (1 + scale * OF_AMPLITUDE * generator.standard_normal(count))
    phase = np.degrees(np.angle(exact)) + scale * OF_PHASE * generator.standard_normal(count)
    if errors:
        options |= {
            "amplitude_errors": OF_AMPLITUDE * np.abs(exact),
            "phase_errors_deg": np.full(count, OF_PHASE),
        }
    return fj.frequency_table(FREQUENCIES[:count], amplitude, phase, **options)


def fit(data, model: str | fj.Model = "lfdh", **options: Any) -> fj.FrequencyFit:
    model = fj.parse_model(model) if isinstance(model, str) else model
    options = {"starts": 3, **options}
    return fj.fit_frequency_response(model, data, **options)


@pytest.fixture(scope="module")
def found() -> fj.FrequencyFit:
    return fit(table())


def test_a_response_without_noise_gives_the_law_back():
    exact = fj.frequency_table(FREQUENCIES, np.abs(EXACT), np.degrees(np.angle(EXACT)))
    estimates = by_name(fit(exact))
    for name, true in TRUE.items():
        assert estimates[name].value == pytest.approx(true, rel=1e-4), name


def test_the_law_is_recovered_within_its_errors(found):
    assert found.converged
    for name, estimate in by_name(found).items():
        assert abs(estimate.value - TRUE[name]) < 4 * estimate.standard_error, name
    assert found.amplitude_rms_dB == pytest.approx(OF_AMPLITUDE * 20 / np.log(10), rel=0.3)
    assert found.phase_rms_deg == pytest.approx(OF_PHASE, rel=0.3)
    assert max(found.start_costs) == pytest.approx(min(found.start_costs), rel=1e-6)


def test_standard_errors_are_the_scatter():
    """Of a straight law, creep: 60 tables, 95 % intervals, and the scatter itself."""
    law = fj.parse_model("creep").with_values({"k_c": 0.08, "mu": 0.02})
    exact = fj.frequency_response(law.block, FREQUENCIES)
    draws = [by_name(fit(table(seed, exact), "creep", starts=1)) for seed in range(60)]
    for name, true in (("k_c", 0.08), ("mu", 0.02)):
        covered = sum(d[name].interval[0] <= true <= d[name].interval[1] for d in draws)
        assert covered >= 52, name  # 1 % of the binomial
        scatter = np.std([draw[name].value for draw in draws], ddof=1)
        errors = np.mean([draw[name].standard_error for draw in draws])
        assert errors == pytest.approx(scatter, rel=0.3), name


def test_without_errors_the_scatter_is_read_from_what_is_left():
    """Ten times the noise: ten times the errors, at the same relative weights."""
    one, ten = (fit(table(3, errors=False, scale=k)) for k in (0.1, 1.0))
    for name in TRUE:
        ratio = by_name(ten)[name].standard_error / by_name(one)[name].standard_error
        assert ratio == pytest.approx(10, rel=0.3), name


def test_phases_may_wind():
    """Two modes in a row, -360 degrees in all, written within ±180."""
    first = fj.blocks.PEADynamics(0.08, 0.01, -0.1, 20.0, 0.05)
    law = fj.Model(first >> fj.blocks.PEADynamics(1.0, 0.0, -0.1, 90.0, 0.03, fixed_gain=True))
    exact = fj.frequency_response(law.block, FREQUENCIES)
    data = fj.frequency_table(FREQUENCIES, np.abs(exact), np.degrees(np.angle(exact)))
    assert np.any(np.abs(np.diff(np.angle(exact))) > np.pi)
    start = law.with_values({"pea_dynamics_2.frequency": 80.0, "pea_dynamics_1.damping": 0.08})
    estimates = by_name(fit(data, start, fixed={"second.creep_gain": 0, "second.mu": -0.1}))
    # Which of them is first, nothing tells.
    modes = sorted(
        estimates[f"{part}.frequency"].value for part in ("pea_dynamics_1", "pea_dynamics_2")
    )
    assert modes == pytest.approx([20.0, 90.0], rel=1e-4)


def test_priors_ties_and_fixed_values_hold_here_too(found):
    free = by_name(found)["delta"]
    mean, sd = free.value + free.standard_error, 0.5 * free.standard_error
    narrow = by_name(fit(table(), priors={"delta": fj.Normal(mean, sd)}))["delta"]
    wanted = (1 / free.standard_error**2 + 1 / sd**2) ** -0.5
    assert narrow.standard_error == pytest.approx(wanted, rel=0.1)
    held = fit(table(), fixed={"delta": 0.3}, tied={"k_delta": ("k_0", 6.0)})
    assert by_name(held).keys() == {"chi", "mu", "k_0"}
    assert float(held.model.parameters["k_delta"].value) == pytest.approx(
        6 * by_name(held)["k_0"].value
    )


def test_it_is_saved_as_a_fit_that_others_load(found, tmp_path):
    found.save(tmp_path / "fit.json")
    loaded = fj.load_model(tmp_path / "fit.json")
    np.testing.assert_allclose(
        fj.frequency_response(loaded.block, FREQUENCIES), found.fitted, rtol=1e-12
    )
    told = json.loads((tmp_path / "fit.json").read_text())
    assert told["kind"] == "frequency response"
    assert told["parameters"]["mu"]["value"] == by_name(found)["mu"].value


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: fit(table(), "foh"), 'model "foh": expected a linear model with a transfer'),
        (lambda: fit(table(exact=EXACT[:2])), "at least 3 different ones, found 2 among 2"),
        (
            lambda: fit(table(exact=EXACT[:3]), "lfdh >> creep"),
            "expected more than 7 amplitudes and phases for 7 parameters, found 6",
        ),
        (lambda: fit(table(), fixed={"nu": 1.0}), '"nu": expected one of'),
        (lambda: fj.frequency_table([1, 2, 3], [1, 1], [0, 0, 0]), "a list of 3 numbers"),
        (lambda: fj.frequency_table([1, 2, 3], [1, 0, 1], [0, 0, 0]), "finite numbers above 0"),
        (lambda: fj.frequency_table([1, 2, 2], [1, 1, 1], [0, 0, 0]), "found 2 among 3"),
    ],
)
def test_what_cannot_be_fitted_is_refused(call, said):
    with pytest.raises(fj.InputError, match=said):
        call()


# Tables -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "heads",
    [
        ("frequency_Hz", "amplitude [um/V]", "phase_deg", "amplitude error [um/V]", "phase_sd_deg"),
        ("f [kHz]", "magnitude_dB", "angle [rad]", "magnitude_std_dB", "angle error [rad]"),
        ("omega [rad/s]", "gain (um/V)", "phase [°]", "sigma gain", "sigma phase [rad]"),
    ],
)
def test_tables_are_read_as_they_are_written(heads, tmp_path):
    wanted = table()
    frequency = {"k": 1e-3, "r": 2 * np.pi}.get(heads[0].split("[")[-1][0], 1.0)
    decibels = heads[1].endswith("dB")
    amplitude = np.abs(wanted.response)
    assert wanted.amplitude_errors is not None
    assert wanted.phase_errors is not None
    columns = (
        FREQUENCIES * frequency,
        20 * np.log10(amplitude) if decibels else amplitude,
        np.angle(wanted.response) if "rad" in heads[2] else np.degrees(np.angle(wanted.response)),
        wanted.amplitude_errors * (20 / np.log(10) if decibels else amplitude),
        wanted.phase_errors if "rad" in heads[4] else np.degrees(wanted.phase_errors),
    )
    write_text(tmp_path / "table.csv", dict(zip(heads, columns, strict=True)))
    read = fj.read_frequency_table(tmp_path / "table.csv")
    for name in ("frequencies_Hz", "response", "amplitude_errors", "phase_errors"):
        np.testing.assert_allclose(getattr(read, name), getattr(wanted, name), rtol=1e-9)
    stated = "/" in heads[1]
    units = ("V", "um") if stated else ("drive units", "response units")
    assert (read.drive_unit, read.response_unit) == units


@pytest.mark.parametrize(
    ("heads", "said"),
    [
        (("frequency_Hz", "phase_deg"), 'a column for amplitude, such as "amplitude'),
        (("frequency_Hz", "gain"), "for amplitudes alone there are tfocim and ofocim"),
        (("frequency_Hz", "gain", "amplitude", "phase"), "one column for amplitude"),
        (("frequency [V]", "gain", "phase"), "expected a value in Hz"),
    ],
)
def test_tables_that_do_not_tell_are_refused(heads, said, tmp_path):
    values = [FREQUENCIES, *([np.ones(30)] * (len(heads) - 1))]
    write_text(tmp_path / "table.csv", dict(zip(heads, values, strict=True)))
    with pytest.raises(fj.InputError, match=said):
        fj.read_frequency_table(tmp_path / "table.csv")


@pytest.fixture
def on_disk(empty_folder) -> str:
    data = table()
    columns = {
        "frequency_Hz": data.frequencies_Hz,
        "amplitude [um/V]": np.abs(data.response),
        "phase_deg": np.degrees(np.angle(data.response)),
    }
    write_text(empty_folder / "table.csv", columns)
    return "table.csv"


def test_from_the_command_line(on_disk, tmp_path, capsys):
    call = ["fit", on_disk, "--frequency-response", "--out", "results"]
    assert run([*call, "--model", "creep", "--model", "lfdh", "--fix", "mu=0.1"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("lfdh describes table.csv best of 2 models by BIC, to ")
    assert without_progress(err) == ""
    files = {path.name for path in (tmp_path / "results").iterdir()}
    assert files == {"fit.json", "fit_creep.json", "fit_lfdh.json", "report.html"}
    assert fj.load_model(tmp_path / "results" / "fit.json").name == "lfdh"
    page = (tmp_path / "results" / "report.html").read_text()
    assert "amplitude [µm/V]" in page
    assert "phase [degrees]" in page


def test_calls_that_make_no_sense(on_disk, capsys):
    call = ["fit", on_disk, "--frequency-response", "--out", "results"]
    # The second of these is sized by the table first.
    for model in ("foh", "prandtl_ishlinskii"):
        assert run([*call, "--model", model]) == 2
        assert "expected a linear model" in capsys.readouterr().err
    assert run([*call, "--model", "lfdh", "--mask", "1 s..2 s"]) == 2
    assert "takes one table, and neither --mask nor --own" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("column", "factor"),
    [
        ("frequency_Hz", 1.0), ("frequency [kHz]", 1e3), ("frequency (mHz)", 1e-3),
        ("frequency_rad/s", 1 / (2 * np.pi)), ("frequency [rad/s]", 1 / (2 * np.pi)),
        ("frequency / kHz", 1e3), ("frequency", 1.0),
    ],
)  # fmt: skip
def test_the_unit_of_the_frequency_is_read_however_it_is_written(column, factor, tmp_path):
    path = tmp_path / "table.csv"
    rows = "".join(f"{f},{a},{p}\n" for f, a, p in ((1, 0.1, -1), (10, 0.09, -5), (100, 0.05, -40)))
    path.write_text(f"{column},amplitude [um/V],phase_deg\n{rows}")
    found = fj.read_frequency_table(path)
    assert found.frequencies_Hz == pytest.approx(factor * np.array([1, 10, 100]))
