"""The linear inverse for a real-time loop, as data and as C."""

import json
import shutil
import subprocess
from pathlib import Path

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
import fracjax._compensate
from fracjax import blocks
from fracjax._compensate._streaming import _sections
from fracjax._operators import Grid
from tests.compensate.helpers import SINE, model

RATE_STEP = 1e-3
STREAMED = {
    "lfdh": blocks.LFDH(),
    "creep": blocks.Creep(0.1, 0.01),
    "lfdh >> log creep": blocks.LFDH() >> blocks.LogarithmicCreep(0.02, 0.05),
    "pea_dynamics": blocks.PEADynamics(0.1, 0.01, -0.1, 300.0, 0.05),
    "lfdh >> lag": blocks.LFDH() >> blocks.DriveLag(1e-3),
}
COMPILER = shutil.which("gcc") or shutil.which("cc")


def streamed(block, **options) -> fj.StreamingInverse:
    return fj.streaming_inverse(model(block), RATE_STEP, (0.05, 10.0), **options)


def program(inverse, folder: Path, samples: np.ndarray) -> np.ndarray:
    """What the header computes, compiled with every warning an error."""
    inverse.save_header(folder / "inverse.h")
    source = (
        '#include <stdio.h>\n#include "inverse.h"\nint main(void)\n{\n'
        "    fracjax_inverse state;\n    double desired;\n    int first = 1;\n"
        '    while (scanf("%lf", &desired) == 1) {\n'
        "        if (first) fracjax_inverse_start(&state, desired);\n        first = 0;\n"
        '        printf("%.17g\\n", fracjax_inverse_step(&state, desired));\n    }\n'
        "    return 0;\n}\n"
    )
    (folder / "main.c").write_text(source, encoding="utf-8")
    flags = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "-pedantic"]
    command = [str(COMPILER), *flags, "main.c", "-o", "program"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    told = subprocess.run(
        [folder / "program"],
        input="\n".join(map(repr, samples.tolist())),
        capture_output=True,
        text=True,
        check=True,
    )
    return np.array(told.stdout.split(), dtype=float)


@pytest.mark.parametrize("name", STREAMED)
def test_the_streaming_inverse_holds_its_stated_error(name):
    block, inverse = STREAMED[name], streamed(STREAMED[name])
    assert inverse.complete
    assert inverse.error < 0.02
    # Between the frequencies at which the error was stated.
    frequencies = np.geomspace(0.051, 9.7, 333)
    exact = 1 / fj.frequency_response(block, frequencies)
    error = np.abs(inverse.frequency_response(frequencies) / exact - 1)
    assert error.max() < 1.2 * inverse.error


@pytest.mark.parametrize("name", ["lfdh", "pea_dynamics"])
def test_sample_by_sample_it_is_the_inverse_of_the_convolution(name):
    times = RATE_STEP * np.arange(3000)
    desired = 3 + np.sin(2 * np.pi * times) ** 2 + 0.2 * np.sin(2 * np.pi * 4 * times)
    inverse = streamed(STREAMED[name])
    with jax.enable_x64(True):
        grid = Grid(RATE_STEP, "constant")
        exact = np.asarray(STREAMED[name].inverse()(jax.numpy.asarray(desired), grid))
    drive = inverse.run(desired)
    assert drive[0] == pytest.approx(exact[0], rel=1e-9)
    # At the start the motion bends suddenly, at frequencies above the band.
    assert np.abs(drive - exact)[100:].max() < 2 * inverse.error * np.ptp(exact)


@given(st.floats(-300, -1e-6), st.floats(0, 300))
@settings(max_examples=50)
def test_sections_follow_a_straight_motion_exactly(real, imaginary):
    pole = complex(real, imaginary)
    decay, before, now = _sections(np.array([pole]), np.array([1.0]), 0.01)
    # The state's response to v = t from rest, by its closed form.
    t = 0.01 * np.arange(1, 5)
    x = pole * t
    exact = np.where(np.abs(x) < 1e-4, t**2 / 2 * (1 + x / 3), (np.expm1(x) - x) / pole**2)
    state, found = 0j, []
    for n in range(4):
        state = decay[0] * state + before[0] * 0.01 * n + now[0] * 0.01 * (n + 1)
        found.append(state)
    np.testing.assert_allclose(found, exact, rtol=1e-6)


@pytest.mark.skipif(COMPILER is None, reason="there is no C compiler here")
@pytest.mark.parametrize("name", ["lfdh", "pair", "gain"])
def test_the_header_computes_what_python_does(name, tmp_path):
    mode = blocks.QuasiStaticForce(0.5) + blocks.Resonance(20.0, 0.1)
    block = {**STREAMED, "pair": mode, "gain": blocks.QuasiStaticForce(0.2)}[name]
    inverse = streamed(block, offset=-2.5)
    assert inverse.paired.any() == (name == "pair")
    desired = 3 + np.cumsum(np.random.default_rng(0).normal(0, 0.1, 500))
    drive = program(inverse, tmp_path, desired)
    np.testing.assert_allclose(drive, inverse.run(desired), rtol=1e-10)


def test_the_equations_as_data_compute_the_same(tmp_path):
    block = blocks.QuasiStaticForce(0.5) + blocks.Resonance(20.0, 0.1)
    inverse = streamed(block)
    inverse.save(tmp_path / "inverse.json")
    told = json.loads((tmp_path / "inverse.json").read_text(encoding="utf-8"))
    assert told["schema"] == "fracjax.inverse/1"
    desired = SINE + 4
    sections = [(1, row) for row in told["first_order"]] + [(2, r) for r in told["second_order"]]
    states = [0j] * len(sections)
    drive, previous = [], 0.0
    for sample in desired:
        v = sample - desired[0]
        total = told["direct"] * v + told["static"] * (desired[0] - told["offset"])
        for k, (weight, row) in enumerate(sections):
            decay, before, now = (np.ravel(row[key]) @ [1, 1j][: np.size(row[key])]
                                  for key in ("decay", "before", "now"))  # fmt: skip
            states[k] = decay * states[k] + before * previous + now * v
            total += weight * states[k].real
        drive.append(total)
        previous = v
    np.testing.assert_allclose(drive, inverse.run(desired), rtol=1e-10)


def test_of_a_nonlinear_model_the_linear_part_is_inverted():
    law = blocks.FOH(0.05, 0.05, 1e-5, 0.1, -0.1)
    inverse = streamed(law)
    assert not inverse.complete
    exact = 1 / fj.frequency_response(law.linear_part, [0.1, 1.0])
    np.testing.assert_allclose(inverse.frequency_response(np.array([0.1, 1.0])), exact, rtol=1e-3)


@pytest.mark.parametrize(
    ("block", "band", "said"),
    [
        (blocks.LFDH(), (1.0, 0.1), "a band 0 < low < high"),
        (blocks.LFDH(), (1.0, 600.0), "below 500 Hz"),
        (blocks.FOHRateTerm(1.0), (0.1, 10.0), "a model with a linear part"),
        (blocks.PEADynamics(-0.1, 0.2, 0.3), (0.1, 10.0), "whose inverse is stable"),
    ],
)
def test_what_cannot_be_streamed_is_refused(block, band, said):
    with pytest.raises(fj.InputError, match=said):
        fj.streaming_inverse(model(block), RATE_STEP, band)
