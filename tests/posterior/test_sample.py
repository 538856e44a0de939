"""Chains: killed, resumed, interrupted, of walkers that begin well."""

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.signal import lfilter

import fracjax as fj
from fracjax._posterior import split_r_hat
from fracjax._posterior._sample import ChainFile, effective_draws, run_ensemble

SETTINGS = {"model": "bowl"}


def bowl(points: np.ndarray) -> np.ndarray:
    return -np.sum(points**2, axis=1) / 2 - 0.1 * np.sum(points**4, axis=1)


def run_bowl(
    path: Path,
    steps: int = 300,
    *,
    resume: bool = False,
    settings=SETTINGS,
    density=bowl,
    counts: list[int] | None = None,
    target: int = 400,
):
    return run_ensemble(
        density,
        walkers=16,
        size=3,
        steps=steps,
        seed=5,
        file=ChainFile(path),
        resume=resume,
        settings=settings,
        watch=lambda chain: None,
        step=(lambda done: None) if counts is None else counts.append,
        target=target,
    )


def test_a_walker_that_never_moves_is_no_error(tmp_path):
    """It stands on a needle; of it there is no autocorrelation time."""
    needle = []

    def with_needle(points: np.ndarray) -> np.ndarray:
        if not needle and len(np.unique(points, axis=0)) > 1:
            needle.append(points[0].copy())
        on_it = np.all(points == needle[0], axis=1) if needle else np.zeros(len(points), bool)
        return bowl(points) + 1e9 * on_it

    found = run_bowl(tmp_path / "chain.h5", 120, density=with_needle)
    assert not found.converged
    assert np.all(np.isfinite(found.autocorrelation))
    assert found.autocorrelation.max() >= len(found.kept)


KILLED = """
import sys, time
from pathlib import Path
import numpy as np
from fracjax._posterior._sample import ChainFile, effective_draws, run_ensemble

def slowly(points):
    time.sleep(0.002)
    return -np.sum(points**2, axis=1) / 2 - 0.1 * np.sum(points**4, axis=1)

run_ensemble(slowly, walkers=16, size=3, steps=300, seed=5, file=ChainFile(Path(sys.argv[1])),
             resume=False, settings={"model": "bowl"}, watch=lambda chain: None,
             step=lambda done: None)
"""


def test_a_killed_chain_goes_on_as_if_nothing_had_happened(tmp_path):
    whole = run_bowl(tmp_path / "whole.h5")
    path = tmp_path / "killed.h5"
    root = Path(fj.__file__).parents[1]
    worker = subprocess.Popen([sys.executable, "-c", KILLED, str(path)], cwd=root)
    deadline = time.monotonic() + 60
    while not path.exists() and worker.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(0.1)  # into the second block
    worker.send_signal(signal.SIGKILL)
    assert worker.wait() == -signal.SIGKILL
    with h5py.File(path) as file:
        assert file["mcmc"].attrs["iteration"] in (100, 200)
    assert (tmp_path / ".killed.h5.part").exists()
    (tmp_path / ".killed.h5.part").write_bytes(b"torn")
    resumed = run_bowl(path, resume=True)
    np.testing.assert_array_equal(resumed.coordinates, whole.coordinates)
    with h5py.File(path) as file:
        assert file["mcmc"].attrs["iteration"] == 300
    assert {p.name for p in tmp_path.iterdir()} == {"whole.h5", "killed.h5"}


def test_every_step_is_counted(tmp_path):
    counts: list[int] = []
    run_bowl(tmp_path / "chain.h5", 100)
    run_bowl(tmp_path / "chain.h5", 130, resume=True, counts=counts)
    assert counts == [*range(101, 131)]


def test_a_finished_chain_is_taken_as_it_is_and_made_longer(tmp_path):
    first = run_bowl(tmp_path / "chain.h5", 200)
    same = run_bowl(tmp_path / "chain.h5", 200, resume=True)
    np.testing.assert_array_equal(same.coordinates, first.coordinates)
    longer = run_bowl(tmp_path / "chain.h5", 300, resume=True)
    np.testing.assert_array_equal(longer.coordinates[:200], first.coordinates)
    assert len(longer.coordinates) == 300
    anew = run_bowl(tmp_path / "chain.h5", 100)
    assert len(anew.coordinates) == 100


def test_a_chain_of_another_call_is_refused(tmp_path):
    run_bowl(tmp_path / "chain.h5", 100)
    with pytest.raises(fj.InputError, match=r"expected a chain with model vase, found one with"):
        run_bowl(tmp_path / "chain.h5", resume=True, settings={"model": "vase"})
    (tmp_path / "chain.h5").write_bytes(b"no chain")
    with pytest.raises(fj.InputError, match=r"expected a chain saved by fracjax"):
        run_bowl(tmp_path / "chain.h5", resume=True)


def test_an_interrupt_keeps_the_blocks_that_are_done(tmp_path, capsys):
    calls = []

    def interrupted(points):
        calls.append(1)
        if len(calls) > 350:
            raise KeyboardInterrupt
        return bowl(points)

    with pytest.raises(KeyboardInterrupt):
        run_bowl(tmp_path / "chain.h5", density=interrupted)
    with h5py.File(tmp_path / "chain.h5") as file:
        assert file["mcmc"].attrs["iteration"] == 100
    assert [p.name for p in tmp_path.iterdir()] == ["chain.h5"]
    assert capsys.readouterr() == ("", "")


def test_walkers_do_not_begin_where_the_density_is_nothing(tmp_path):
    def cliff(points):
        return np.where(np.abs(points[:, 0]) < 0.5, bowl(points), -np.inf)

    chain = run_bowl(tmp_path / "chain.h5", 100, density=cliff)
    assert np.isfinite(chain.log_density).all()


def test_r_hat_sees_a_drift():
    draws = np.random.default_rng(0).standard_normal((400, 16, 2))
    draws[:, :, 1] += np.linspace(0, 1, 400)[:, None]
    still, drifting = split_r_hat(draws)
    assert still < 1.01 < drifting


def test_effective_draws_are_those_of_independent_ones():
    """Of an autoregression of coefficient a the mean is known as from n (1 - a)/(1 + a) draws."""
    generator = np.random.default_rng(4)
    shocks = generator.standard_normal((2000, 8, 1))
    correlated = np.asarray(lfilter([1.0], [1.0, -0.8], shocks, axis=0))[200:]
    assert effective_draws(shocks)[0] == pytest.approx(16_000, rel=0.15)
    assert effective_draws(correlated)[0] == pytest.approx(14_400 / 9, rel=0.25)


def test_a_chain_ends_with_the_draws_that_are_wanted(tmp_path):
    few, many = (run_bowl(tmp_path / f"{target}.h5", 3000, target=target) for target in (100, 1000))
    for chain, target in ((few, 100), (many, 1000)):
        assert chain.converged
        assert chain.ess.min() >= target
        assert chain.r_hat.max() < 1.01
    assert len(few.coordinates) < len(many.coordinates) < 3000
    # What the short chain foretells of the long one, whose ESS it knows to a third.
    longer = replace(few, target=1000).forecast
    assert longer == pytest.approx(len(many.coordinates), rel=0.5)
