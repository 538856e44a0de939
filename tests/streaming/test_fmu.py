"""The FMU, driven by fmpy through the standard's interface."""

import subprocess
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

import fracjax as fj
from fracjax._streaming._program import HELD, LEVEL
from tests.streaming.helpers import COMPILERS, PLAYS, STACK, STEP, SWINGS, inverse_of, model_of

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler here")
COUNT = 600


def simulated(path: Path, inputs: dict[str, np.ndarray], **starts: float) -> np.ndarray:
    """The outputs after each of the samples of the inputs."""
    count = len(next(iter(inputs.values())))
    signals = np.zeros(count, [("time", float), *((name, float) for name in inputs)])
    signals["time"] = STEP * np.arange(count)
    for name, values in inputs.items():
        signals[name] = values
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=STEP * count,
        step_size=STEP,
        output_interval=STEP,
        input=signals,
        start_values=starts,
    )
    return found[1:]


@pytest.fixture(scope="module")
def stack(tmp_path_factory) -> tuple[fj.StreamingInverse, Path]:
    stream = inverse_of(STACK, limits=(0.0, 100.0), slew=20000.0)
    return stream, stream.write_fmu(tmp_path_factory.mktemp("fmu"))


def test_the_fmu_of_an_inverse_drives_as_python_does(stack):
    """Along swings that meet a limit, with a sample that is no number."""
    stream, path = stack
    assert validate_fmu(str(path)) == []
    desired = model_of(STACK).run(SWINGS).output[:COUNT].copy()
    desired[200] = np.nan
    desired[400:430] = 30.0
    found = simulated(path, {"desired": desired}, rest=5.0)
    expected = stream.run(desired, stream.start(5.0))
    np.testing.assert_allclose(found["drive"], expected.output, atol=1e-7)
    np.testing.assert_allclose(found["predicted"], expected.predicted, atol=1e-7)
    np.testing.assert_array_equal(found["flags"], expected.flags)
    assert found["flags"][200] == HELD
    assert np.any(found["flags"] & LEVEL)


def test_an_adaptive_inverse_takes_the_measured_motion_and_a_model_the_drive(tmp_path):
    desired = model_of(PLAYS).run(SWINGS).output[:COUNT]
    adaptive = inverse_of(PLAYS, adaptive=fj.Adaptation())
    path = adaptive.write_fmu(tmp_path, "adaptive")
    found = simulated(path, {"desired": desired, "measured": 0.98 * desired}, rest=5.0)
    expected = adaptive.run(desired, adaptive.start(5.0), measured=0.98 * desired)
    np.testing.assert_allclose(found["drive"], expected.output, atol=1e-7)
    forward = model_of(PLAYS)
    path = forward.write_fmu(tmp_path, "forward")
    assert validate_fmu(str(path)) == []
    found = simulated(path, {"drive": SWINGS[:COUNT]}, rest=5.0)
    expected = forward.run(SWINGS[:COUNT], forward.start(5.0))
    np.testing.assert_allclose(found["response"], expected.output, atol=1e-9)


def test_its_state_is_kept_and_put_back_and_other_steps_are_refused(stack, tmp_path):
    _, path = stack
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    folder = fmpy.extract(str(path), str(tmp_path))
    said = []
    unit = fmpy.instantiate_fmu(
        folder, description, "CoSimulation", logger=lambda *words: said.append(words[-1])
    )
    assert isinstance(unit, FMU3Slave)
    unit.enterInitializationMode()
    unit.exitInitializationMode()

    def drive(aim: float) -> float:
        unit.setFloat64([references["desired"]], [aim])
        unit.doStep(0.0, STEP)
        return unit.getFloat64([references["drive"]])[0]

    drive(1.0)
    kept = unit.serializeFMUState(unit.getFMUState())
    one = [drive(aim) for aim in (2.0, 1.5)]
    unit.setFMUState(unit.deserializeFMUState(kept))
    assert [drive(aim) for aim in (2.0, 1.5)] == one
    with pytest.raises(FMICallException):
        unit.doStep(0.0, 1.5 * STEP)
    assert b"a multiple of 0.001 s" in said[-1] or "a multiple of 0.001 s" in str(said[-1])
    unit.terminate()
    unit.freeInstance()


@pytest.mark.parametrize("compiler", COMPILERS)
def test_the_code_agrees_with_the_headers_of_the_standard(stack, compiler, tmp_path):
    """Its functions have the declarations of the Modelica Association's own headers."""
    with ZipFile(stack[1]) as archive:
        archive.extractall(tmp_path)
    headers = Path(str(fmpy.__file__)).parent / "c-code"
    warnings = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only"]
    for included in (["-I", str(headers), "-include", "fmi3Functions.h"], ["-pedantic"]):
        command = [compiler, *warnings, *included, "stage_fmu.c"]
        done = subprocess.run(command, cwd=tmp_path / "sources", capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_the_same_stream_is_the_same_file(stack, tmp_path):
    stream, path = stack
    assert stream.write_fmu(tmp_path).read_bytes() == path.read_bytes()
    with pytest.raises(fj.InputError, match="a C identifier"):
        stream.write_fmu(tmp_path, "2nd")
