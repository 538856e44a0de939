"""How numbers are computed while a public function runs, and after."""

import os
import threading

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

from fracjax import _computing
from fracjax._computing import compiled, compiler_options, computing, map_in_threads


def threads() -> set[int]:
    """Threads of every library of linear algebra."""
    np.linalg.norm(scipy.linalg.qr(np.eye(3))[0])
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_small_matrices_have_one_thread_and_the_callers_setting_comes_back():
    with threadpool_limits(2, "blas"):
        with computing():
            assert threads() == {1}
        assert threads() == {2}


def test_numbers_are_double_inside_and_the_callers_setting_comes_back():
    before = jnp.ones(1).dtype
    with computing():
        assert jnp.ones(1).dtype == np.float64
    assert jnp.ones(1).dtype == before


def test_items_are_worked_on_side_by_side_in_double_precision_and_come_in_order(monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    together = threading.Barrier(2, timeout=30)

    def work(k: int) -> tuple[int, np.dtype]:
        together.wait()  # as long as nobody else comes
        return k, jnp.ones(1).dtype

    with jax.enable_x64(False), computing():
        found = map_in_threads(work, range(6))
    assert found == [(k, np.dtype(np.float64)) for k in range(6)]


def test_a_fault_of_any_item_reaches_the_caller():
    with pytest.raises(ZeroDivisionError):
        map_in_threads(lambda k: 1 / (k - 7), range(20))


def test_nothing_is_found_for_no_items():
    assert map_in_threads(lambda k: k, []) == []


def test_arrays_are_traced_and_all_else_compiled_for():
    traces = []

    def work(signals: dict, how: str, factor: float) -> jax.Array:
        traces.append((how, factor))
        return signals["one"] * factor + (signals["two"] if how == "with" else 0.0)

    fast = compiled(work)
    one, two = np.arange(3.0), np.float64(2.0)
    for k in range(3):  # other numbers, the same program
        np.testing.assert_array_equal(
            fast({"one": one + k, "two": two}, "with", 2.0), 2 * one + 2 * k + 2
        )
    np.testing.assert_array_equal(fast({"one": one, "two": two}, "without", 3.0), 3 * one)
    assert traces == [("with", 2.0), ("without", 3.0)]


def test_a_compiler_that_knows_no_option_is_asked_for_nothing(monkeypatch):
    assert compiler_options() == _computing._QUICKER
    monkeypatch.setattr(_computing, "_QUICKER", {"xla_cpu_option_of_no_version": False})
    compiler_options.cache_clear()
    try:
        assert compiler_options() == {}
        assert float(compiled(lambda x: x + 1)(np.float64(1.0))) == 2.0
    finally:
        compiler_options.cache_clear()
