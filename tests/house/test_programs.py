"""Compiled programs that are kept between processes: found again, and never a fault."""

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

from fracjax import Grid, _programs, parse_model
from fracjax._computing import Compiled, computing
from fracjax._parameters import set_values

DRIVE, GRID = np.sin(np.arange(60) / 10), Grid(1e-3)
BLOCK = parse_model("foh").block


def slope(block, drive, grid, power: int | float = 1):
    """What the tests compile."""
    return block(drive, grid) * power


# As if it were the package's own: what is defined elsewhere is not kept.
slope.__module__ = "fracjax._tests"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Iterator[Path]:
    """An empty folder, whatever cache of JAX's own the tests run with."""
    monkeypatch.setenv(_programs.FOLDER, str(tmp_path / "programs"))
    before = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    jax.config.update("jax_compilation_cache_dir", None)
    compilation_cache.reset_cache()
    yield tmp_path / "programs"
    jax.config.update("jax_compilation_cache_dir", before)
    compilation_cache.reset_cache()


@pytest.fixture
def lowered(monkeypatch) -> list[str]:
    """What is traced and lowered, and not found."""
    names: list[str] = []
    original = _programs._write

    def write(path, program):
        names.append(path.name)
        original(path, program)

    monkeypatch.setattr(_programs, "_write", write)
    return names


def computed(*arguments) -> np.ndarray:
    """By a function that has no program in this process."""
    with computing():
        return np.asarray(Compiled(slope)(BLOCK, DRIVE, GRID, *arguments))


def expected(power: float = 1) -> np.ndarray:
    with computing():
        return power * np.asarray(BLOCK(jnp.asarray(DRIVE), GRID))


def test_a_program_is_made_once_for_all_values(folder, lowered):
    assert computed() == pytest.approx(expected())
    assert len(lowered) == len(list(folder.iterdir())) == 1
    other = set_values(BLOCK, {"k_l": 3.0})
    with computing():
        moved = np.asarray(Compiled(slope)(other, 2 * DRIVE, GRID))
        assert moved == pytest.approx(np.asarray(other(jnp.asarray(2 * DRIVE), GRID)))
    assert len(lowered) == 1


def test_other_shapes_and_other_static_values_are_other_programs(lowered):
    assert computed(2) == pytest.approx(expected(2))
    assert computed(2.0) == pytest.approx(expected(2))
    assert computed(3) == pytest.approx(expected(3))
    with computing():
        Compiled(slope)(BLOCK, DRIVE[:50], GRID)
        Compiled(slope)(BLOCK, DRIVE, Grid(1e-3, "rest"))
    assert len(set(lowered)) == 5


def test_another_version_compiles_anew(lowered, monkeypatch):
    computed()
    monkeypatch.setattr(_programs, "_origin", lambda: "another version")
    assert computed() == pytest.approx(expected())
    assert len(set(lowered)) == 2


@pytest.mark.parametrize("damage", [lambda b: b[:-9], lambda b: b"", lambda b: b[:99] + b"no!"])
def test_a_damaged_file_is_compiled_anew_and_replaced(folder, lowered, damage):
    computed()
    (path,) = folder.iterdir()
    path.write_bytes(damage(path.read_bytes()))
    assert computed() == pytest.approx(expected())
    assert computed() == pytest.approx(expected())
    assert len(lowered) == 2


def test_where_nothing_can_be_written_it_is_compiled(tmp_path, monkeypatch, lowered):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv(_programs.FOLDER, str(tmp_path / "file" / "programs"))
    assert computed() == pytest.approx(expected())
    monkeypatch.setenv(_programs.FOLDER, "")
    assert computed() == pytest.approx(expected())
    assert len(lowered) == 1  # it was tried once


def test_on_a_full_disk_nothing_is_kept(folder, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    assert computed() == pytest.approx(expected())
    assert list(folder.iterdir()) == []


def test_what_was_used_least_recently_is_dropped(folder, monkeypatch):
    for power in (1, 2):
        computed(power)
    first, second = sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime_ns)
    os.utime(second, (1, 1))
    monkeypatch.setattr(_programs, "LIMIT", 2.5 * first.stat().st_size)
    computed(3)
    assert len(list(folder.iterdir())) == 2
    assert first.exists()
    assert not second.exists()


def test_what_is_defined_elsewhere_is_not_kept(folder):
    def own(drive):
        return 2 * drive

    with computing():
        assert np.asarray(Compiled(own)(DRIVE)) == pytest.approx(2 * DRIVE)
    assert not folder.exists()


def test_a_cache_of_jax_own_takes_precedence(folder, tmp_path):
    jax.config.update("jax_compilation_cache_dir", str(tmp_path / "own"))
    assert computed() == pytest.approx(expected())
    assert not folder.exists()


def test_several_at_once_agree(folder):
    together = threading.Barrier(2, timeout=60)

    def work(_):
        together.wait()
        return computed()

    with ThreadPoolExecutor(2) as pool:
        for result in pool.map(work, range(2)):
            assert result == pytest.approx(expected())
    assert len(list(folder.iterdir())) == 1


# The second solves two equations in each step, by LAPACK, which a program that is read has to load.
@pytest.mark.parametrize(
    "model", ["bouc_wen", "two_lags @ outflow.root_outflow @ last.internal_saturation"]
)
def test_two_processes_at_once_agree(folder, model):
    script = (
        "import numpy as np, fracjax as fj; "
        f"block = fj.parse_model('{model}').block; "
        "u = np.sin(np.arange(60) / 10); "
        "from fracjax._computing import computing; "
        "c = computing(); c.__enter__(); "
        "print(repr(float(block.respond(u, fj.Grid(1e-3)).sum())))"
    )
    environment = os.environ | {_programs.FOLDER: str(folder)}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    started = [
        subprocess.Popen(
            [sys.executable, "-c", script], env=environment,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        )
        for _ in range(2)
    ]  # fmt: skip
    answers = [process.communicate(timeout=120) for process in started]
    answers.append(
        subprocess.Popen(
            [sys.executable, "-c", script], env=environment,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        ).communicate(timeout=120)
    )  # fmt: skip
    assert {error for _, error in answers} == {""}
    assert len({output for output, _ in answers}) == 1
    assert len(list(folder.iterdir())) == 1
