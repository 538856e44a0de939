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
    checks_of,
    inverse_of,
    model,
    model_of,
)

WARNINGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wno-unused-function"]

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
    """In double and in single precision, by each compiler with its sanitizers."""
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
            assert "4096 samples" in checked(tmp_path, compiler, *checks_of(compiler))


@pytest.mark.parametrize("name", NONLINEAR)
def test_every_law_is_the_same_in_c(name, tmp_path):
    inverse_of(NONLINEAR[name]).write_c(tmp_path)
    assert "0 other flags" in checked(tmp_path, COMPILERS[0], "-O1")


FAULTS = r"""
#include "stage.h"
#include <math.h>
#include <stdint.h>
#include <string.h>
#define REQUIRE(what) if (!(what)) return __LINE__ - FIRST
enum { FIRST = __LINE__ };
static stage_state s, kept;
static real_stage u, y, last;
static int step(real_stage aim)
{
    last = u;
    return stage_step(&s, aim, &u, &y);
}
static int in_range(void) { return u >= LOW && u <= HIGH && isfinite(y); }
int main(void)
{
    uint64_t bits = 88172645463325252u;
    real_stage one, two;
    /* never started, and memory that something else has written to */
    REQUIRE(step(2) & STAGE_RESTARTED && in_range());
    REQUIRE(!(step(2) & STAGE_RESTARTED));
    memset(&s, 0xff, sizeof s);
    REQUIRE(step(2) & STAGE_RESTARTED && in_range());
    REQUIRE(!(step(2) & STAGE_RESTARTED));
    /* another step: refused, and the state is as it was */
    kept = s;
    REQUIRE(stage_start(&s, 10, 1.01 * STAGE_STEP) == -1 && !memcmp(&s, &kept, sizeof s));
    REQUIRE(stage_start(&s, 10, NAN) == -1 && stage_start(&s, 10, STAGE_STEP) == 0);
    /* no numbers: the last one again, and said */
    for (int n = 0; n < 300; ++n) step(1 + (real_stage)n / 300);
    kept = s;
    REQUIRE(!step(2));
    one = u;
    s = kept;
    step(2);
    REQUIRE(u == one);
    REQUIRE(step(NAN) & STAGE_HELD && step(INFINITY) & STAGE_HELD && in_range());
    REQUIRE(step(-INFINITY) & STAGE_HELD && in_range());
    /* out of reach: at the limit, no faster than it may, and back */
    while (u < (real_stage)HIGH) {
        REQUIRE(step(1000) & (STAGE_SLEW | STAGE_LEVEL) && in_range());
        REQUIRE(u - last <= (real_stage)(CHANGE * 1.001));
    }
    for (int n = 0; n < 1000; ++n) REQUIRE(step(1000) & STAGE_LEVEL && in_range());
    for (int n = 0; n < 1000; ++n) step(2);
    REQUIRE(!step(2) && fabs((double)y - 2) < 1e-3);
    /* anything at all */
    for (long n = 0; n < 100000; ++n) {
        double aim;
        bits ^= bits << 13, bits ^= bits >> 7, bits ^= bits << 17;
        memcpy(&aim, &bits, sizeof aim);
        two = fabs(aim) < 1e30 || isnan(aim) ? (real_stage)aim : (real_stage)INFINITY;
        step(n % 3 ? two : 2);
        REQUIRE(in_range());
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def limited() -> fj.StreamingInverse:
    return inverse_of(STACK, limits=(0.0, 100.0), slew=20000.0)


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_faults_in_the_loop_are_met_in_c(limited, compiler, real, tmp_path):
    """No numbers, limits, another step, a lost state, anything at all: as documented, in range."""
    limited.write_c(tmp_path, real=real)
    defines = "#define LOW 0\n#define HIGH 100\n#define CHANGE 20.0\n"
    (tmp_path / "faults.c").write_text(defines + FAULTS)
    program = built(tmp_path, compiler, *checks_of(compiler), main="faults.c")
    done = subprocess.run([program], capture_output=True, text=True)
    assert done.returncode == 0, f"line {done.returncode} of main; {done.stderr}"


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
