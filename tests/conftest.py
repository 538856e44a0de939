"""What all tests share: float64, compiled programs, real recordings, a hypothesis profile that
repeats."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import hypothesis
import jax
import pytest

ROOT = Path(__file__).resolve().parents[1]
# Programs that one process has compiled the others read: the workers and all that tests start
# inherit the folder, which is there for one run of the tests.  JAX's own cache takes precedence.
CACHE, OWNER = "FRACJAX_CACHE", "FRACJAX_TESTS_CACHE_OWNER"
if CACHE not in os.environ:
    os.environ |= {CACHE: tempfile.mkdtemp(prefix="fracjax-tests-"), OWNER: str(os.getpid())}

# The layers below the public entry points take float64 as given; the entry points enable it
# themselves.  Set before a test module is read, so that its module-level arrays have it too.
jax.config.update("jax_enable_x64", True)
# Programs run a few times on short recordings: optimised they would run in half the time, and be
# compiled in four times as much.  XLA_FLAGS=--xla_cpu_use_fusion_emitters=false is what users have.
os.environ.setdefault(
    "XLA_FLAGS", "--xla_cpu_use_fusion_emitters=false --xla_backend_optimization_level=0"
)

hypothesis.settings.register_profile("fracjax", derandomize=True, deadline=None)
hypothesis.settings.load_profile("fracjax")


def pytest_unconfigure() -> None:
    if os.environ.get(OWNER) == str(os.getpid()):
        shutil.rmtree(os.environ[CACHE], ignore_errors=True)


@pytest.fixture
def float32_default() -> Iterator[None]:
    """JAX as a user finds it: a public entry point must give float64 results all the same."""
    with jax.enable_x64(False):
        yield


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real recordings: FRACJAX_DATA, or shared/data beside the repository."""
    folder = Path(os.environ.get("FRACJAX_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip("No real recordings here: set FRACJAX_DATA to a folder that holds them.")
    return folder


@pytest.fixture
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def setting():
    """What the catalogue's trials are made for: two slow cycles."""
    from tests.settings import setting_of_cycles

    return setting_of_cycles()


@pytest.fixture(scope="session")
def plain():
    """The fit of a creep law to a recording of itself, under white noise."""
    from tests.fit import creep

    return creep.fit(creep.record(creep.CLEAN))
