"""How numbers are computed: in double precision, and small matrices by one thread each."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, wraps
from typing import Any, TypeVar

import jax
import numpy as np
import scipy.linalg  # noqa: F401  its linear algebra is a library of its own, to be found below
from threadpoolctl import ThreadpoolController

_Item = TypeVar("_Item")
_Found = TypeVar("_Found")

_TRACED, _ARRAYS = object(), (np.ndarray, np.generic, jax.Array)
# XLA's older way of emitting loops: programs are as fast, and compiled in two thirds of the time.
_QUICKER = {"xla_cpu_use_fusion_emitters": False}


@contextmanager
def computing() -> Iterator[None]:
    """Double precision in JAX, and linear algebra of NumPy and SciPy on one thread, while it lasts.

    The matrices of a fit have thousands of rows and a dozen columns: a second thread makes their
    decompositions slower, four times on an idle machine of two cores and forty where another
    process computes too, since OpenBLAS' threads wait for each other by spinning.
    """
    with jax.enable_x64(True), _libraries().limit(limits=1, user_api="blas"):
        yield


def side_by_side(work: Callable[[_Item], _Found], items: Sequence[_Item]) -> list[_Found]:
    """What the work finds for each item, in order, on a thread per core.

    Compiled programs run without the interpreter's lock.
    """
    threads = min(os.cpu_count() or 1, len(items))
    if threads < 2:
        return [work(item) for item in items]

    def precisely(item: _Item) -> _Found:
        # JAX keeps its precision by thread.
        with jax.enable_x64(True):
            return work(item)

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(precisely, items))


def compiled(work: Callable[..., _Found]) -> Callable[..., _Found]:
    """The work on trees, compiled once per structure: arrays are traced, all else is static.

    As `equinox.filter_jit`, without what that does beside every call: a signature bound, a filter
    on a logger, which is behind a lock that threads wait for.
    """

    def run(arrays: list[Any], others: tuple[Any, ...], structure: Any) -> _Found:
        traced = iter(arrays)
        leaves = [next(traced) if other is _TRACED else other for other in others]
        return work(*structure.unflatten(leaves))

    @cache
    def program() -> Callable[..., _Found]:
        return jax.jit(run, static_argnums=(1, 2), compiler_options=compiler_options())

    @wraps(work)
    def call(*arguments: Any) -> _Found:
        leaves, structure = jax.tree_util.tree_flatten(arguments)
        others = tuple(_TRACED if isinstance(leaf, _ARRAYS) else leaf for leaf in leaves)
        pairs = zip(leaves, others, strict=True)
        return program()([leaf for leaf, other in pairs if other is _TRACED], others, structure)

    return call


@cache
def compiler_options() -> dict[str, bool]:
    """What XLA is asked for; nothing where its version knows none of it."""
    try:
        jax.jit(lambda: 0, compiler_options=_QUICKER)()
    except jax.errors.JaxRuntimeError:
        return {}
    return _QUICKER


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()
