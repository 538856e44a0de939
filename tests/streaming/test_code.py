"""The C code, compiled with every warning an error, against Python."""

import subprocess
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._streaming._stream import EPS
from tests.streaming.helpers import (
    BAND,
    COMPILERS,
    HIGH,
    LOW,
    NONLINEAR,
    PLAYS,
    STACK,
    inverse_of,
    model,
    model_of,
)

WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wno-unused-function"]
SANITIZED = ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]

pytestmark = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler here")


def built(folder: Path, compiler: str, *flags: str, main: str = "stage_test.c") -> Path:
    command = [compiler, *WARNINGS, *flags, main, "stage.c", "-o", "program", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder / "program"


def checked(folder: Path, compiler: str, *flags: str) -> str:
    """What the code's own test says of its vector."""
    program = built(folder, compiler, *flags)
    done = subprocess.run([program], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("name", ["stack", "adaptive", "model"])
def test_the_code_passes_its_own_test(name, tmp_path):
    """In double and in single precision, by each compiler, and with gcc's sanitizers."""
    stream = {
        "stack": lambda: inverse_of(STACK, slew=30000.0),
        "adaptive": lambda: inverse_of(PLAYS, adaptive=fj.Adaptation()),
        "model": lambda: model_of(PLAYS),
    }[name]()
    for real in ("double", "float"):
        files = stream.write_c(tmp_path, real=real)
        assert [file.name for file in files] == [
            "stage.h", "stage.c", "stage_test.c", "stage_vector.csv", "Makefile",
        ]  # fmt: skip
        for compiler in COMPILERS:
            flags = SANITIZED if compiler.endswith("gcc") else ["-O1"]
            assert "4096 samples" in checked(tmp_path, compiler, *flags)


@pytest.mark.parametrize("name", NONLINEAR)
def test_every_law_is_the_same_in_c(name, tmp_path):
    inverse_of(NONLINEAR[name]).write_c(tmp_path)
    assert "0 other flags" in checked(tmp_path, COMPILERS[0], "-O1")


def test_a_wrong_code_fails_its_test(tmp_path):
    """A fault put in: one weight changed in its seventh digit."""
    inverse_of(PLAYS).write_c(tmp_path)
    code = (tmp_path / "stage.c").read_text()
    assert code.count("C(0.002)") == 1
    (tmp_path / "stage.c").write_text(code.replace("C(0.002)", "C(0.0020002)"))
    program = built(tmp_path, COMPILERS[0])
    assert subprocess.run([program], cwd=tmp_path, capture_output=True).returncode == 1


def test_a_million_samples_are_those_of_python(tmp_path):
    """A hundred random walks at once in Python, one after the other in C."""
    walks, count = 100, 10_000
    inverse = fj.streaming_inverse(model(STACK), 1e-3, BAND, limits=(LOW, HIGH), slew=30000.0)
    noise = np.random.default_rng(3).standard_normal((walks, count))
    desired = 2.8 + 2.8 * np.sin(np.cumsum(0.03 * noise, axis=1)) + 1e-4 * noise
    with jax.enable_x64(True):

        def step(state, sample):
            output, state = inverse.program.step(jnp.asarray(EPS), state, sample)
            return state, output.output

        def along(state, samples):
            return jax.lax.scan(step, state, samples)[1]

        starts = jax.tree.map(lambda leaf: jnp.stack([jnp.asarray(leaf)] * walks), inverse.start())
        python = np.asarray(jax.jit(jax.vmap(along))(starts, jnp.asarray(desired)))
    inverse.write_c(tmp_path)
    (tmp_path / "many.c").write_text(
        '#include "stage.h"\n#include <stdio.h>\nint main(void)\n{\n'
        "    stage_state s;\n    double x, u, y;\n"
        f"    for (long n = 0; fread(&x, sizeof x, 1, stdin) == 1; ++n) {{\n"
        f"        if (n % {count} == 0) stage_start(&s, 0.0, STAGE_STEP);\n"
        "        stage_step(&s, x, &u, &y);\n"
        "        if (fwrite(&u, sizeof u, 1, stdout) != 1) return 1;\n    }\n    return 0;\n}\n"
    )
    program = built(tmp_path, COMPILERS[0], "-O2", main="many.c")
    done = subprocess.run([program], input=desired.tobytes(), capture_output=True, check=True)
    in_c = np.frombuffer(done.stdout).reshape(walks, count)
    assert np.abs(in_c - python).max() < 1e-9 * (HIGH - LOW)


def test_the_header_says_what_it_is_and_what_it_costs(tmp_path):
    inverse_of(PLAYS).write_c(tmp_path, "piezo", "float")
    header = (tmp_path / "piezo.h").read_text()
    assert header.startswith("/* The inverse of model, sample by sample, written by fracjax.")
    assert "#define PIEZO_STEP 0.001 /* s */" in header
    assert "typedef float real_piezo;" in header
    assert "operations and one search of a root" in header
    code = (tmp_path / "piezo.c").read_text()
    assert [line for line in code.splitlines() if line.startswith("#include")] == [
        '#include "piezo.h"', "#include <float.h>", "#include <math.h>",
    ]  # fmt: skip
    assert "malloc" not in code


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"name": "2nd stage"}, "a C identifier"),
        ({"name": "double"}, "a C identifier"),
        ({"real": "half"}, '"double" or "float"'),
    ],
)
def test_unusable_names_and_types_are_refused(options, said, tmp_path):
    with pytest.raises(fj.InputError, match=said):
        inverse_of(PLAYS).write_c(tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()
