"""The numerical environment: double precision, threads for linear algebra, compilation, and a limit
of time."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import cache, cached_property, partial, update_wrapper
from typing import Any, Generic, TypeVar

import jax
import numpy as np
import scipy.linalg  # noqa: F401  loads its own BLAS library, which `_libraries` must see
from threadpoolctl import ThreadpoolController

from ._programs import obtain

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")

_TRACED, _ARRAYS = object(), (np.ndarray, np.generic, jax.Array)
_QUICKER = {"xla_cpu_use_fusion_emitters": False, "xla_cpu_parallel_codegen_split_count": 1}
"""Selects XLA's older loop emitter: programs run as fast and compile in two thirds of the time
(96 programs of all blocks: 10.2 s instead of 15.1 s).  And a program is one object and not many,
which takes a tenth less CPU time to compile."""


class Clock:
    """The time that a computation may take; `stopped` once it is over or the user interrupts."""

    def __init__(self, seconds: float):
        self._end = time.monotonic() + seconds
        self.stopped = self._part_was_short = False

    @property
    def is_over(self) -> bool:
        """Whether nothing further may start."""
        self.stopped = self.stopped or time.monotonic() > self._end
        return self.stopped

    @property
    def was_short(self) -> bool:
        """Whether the time, or a part of it, was over before all was done, or the user has
        interrupted."""
        return self.stopped or self._part_was_short

    def part(self, share: float) -> Callable[[], bool]:
        """A share of the time that is left: whether it is over, whenever it is asked."""
        now = time.monotonic()
        end = now + share * max(self._end - now, 0.0)

        def is_over() -> bool:
            short = self.stopped or time.monotonic() > end
            self._part_was_short = self._part_was_short or short
            return short

        return is_over


_clock: ContextVar[Clock | None] = ContextVar("clock", default=None)


@contextmanager
def _holding(variable: ContextVar[_Item], value: _Item) -> Iterator[None]:
    """A context in which a variable has a value."""
    token = variable.set(value)
    try:
        yield
    finally:
        variable.reset(token)


def within(clock: Clock) -> AbstractContextManager[None]:
    """A context in which fits end, not converged, where they are once the clock's time is over."""
    return _holding(_clock, clock)


def time_is_over() -> bool:
    """Whether the time of the clock that this runs `within` is over."""
    clock = _clock.get()
    return clock is not None and clock.is_over


def part_of_time(share: float) -> Callable[[], bool]:
    """Whether a share of the time that is left to the clock that this runs `within` is over."""
    clock = _clock.get()
    return (lambda: False) if clock is None else clock.part(share)


Count = Callable[[int, int], None]
"""Called with how many are done, from none to all of them, and how many there are."""


def _uncounted(done: int, total: int) -> None:
    """No one counts."""


_count: ContextVar[Count] = ContextVar("count", default=_uncounted)


def counting(count: Count) -> AbstractContextManager[None]:
    """A context in which what `map_in_threads` has done is counted, such as the starts of a fit."""
    return _holding(_count, count)


@contextmanager
def computing() -> Iterator[None]:
    """A context with double precision in JAX, and NumPy's and SciPy's linear algebra on one thread.

    The matrices of a fit have thousands of rows and a dozen columns.  A second thread makes their
    decompositions slower: by a factor of 4 on an idle machine with two cores, and of 40 when
    another process computes too, because the threads of OpenBLAS spin while they wait.
    """
    with jax.enable_x64(True), _libraries().limit(limits=1, user_api="blas"):
        yield


def map_in_threads(work: Callable[[_Item], _Result], items: Sequence[_Item]) -> list[_Result]:
    """The results of `work` for each item, in order, computed by one thread per core.

    This saves time because compiled programs run without the interpreter's lock.
    """
    threads, count = min(os.cpu_count() or 1, len(items)), _count.get()

    def counted(results: Iterator[_Result]) -> list[_Result]:
        listed: list[_Result] = []
        count(0, len(items))
        for result in results:
            listed.append(result)
            count(len(listed), len(items))
        return listed

    if threads < 2:
        return counted(map(work, items))

    def in_double_precision(item: _Item) -> _Result:
        # JAX holds its precision per thread.
        with jax.enable_x64(True):
            return work(item)

    with ThreadPoolExecutor(threads) as pool:
        try:
            return counted(pool.map(in_double_precision, items))
        except BaseException:
            # Where counting raised, as at Stop, what has not begun is not waited for.
            pool.shutdown(wait=False, cancel_futures=True)
            raise


class Compiled(Generic[_Result]):
    """A function of trees, compiled once per structure: arrays are traced, all else is static.

    This does what `equinox.filter_jit` does, without its overhead per call: that binds a signature
    and sets a filter on a logger, for which threads wait on a lock.  Programs are kept between
    processes (`_programs`).
    """

    def __init__(self, work: Callable[..., _Result]):
        update_wrapper(self, work)
        self._work = work
        self._programs: dict[Any, Callable[[list[Any]], _Result]] = {}
        _functions.append(self)

    def __call__(self, *arguments: Any) -> _Result:
        return self.prepared(*arguments)()

    def prepared(self, *arguments: Any) -> Callable[[], _Result]:
        """What computes the result, compiled."""
        leaves, structure = jax.tree_util.tree_flatten(arguments)
        others = tuple(_TRACED if isinstance(leaf, _ARRAYS) else leaf for leaf in leaves)
        arrays = [leaf for leaf in leaves if isinstance(leaf, _ARRAYS)]
        if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
            return partial(self._jitted, arrays, others, structure)
        kinds = tuple((a.shape, a.dtype, getattr(a, "weak_type", False)) for a in arrays)
        key = others, structure, kinds
        if key not in self._programs:
            self._programs[key] = obtain(
                self._work, lambda: self._jitted, arrays, others, structure
            )
        return partial(self._programs[key], arrays)

    @cached_property
    def _jitted(self) -> Any:
        """The function of its arrays, and statically of all else and the structure of both."""

        def run(arrays: list[Any], others: tuple[Any, ...], structure: Any) -> _Result:
            traced = iter(arrays)
            leaves = [next(traced) if other is _TRACED else other for other in others]
            return self._work(*structure.unflatten(leaves))

        return jax.jit(run, static_argnums=(1, 2), compiler_options=compiler_options())

    def forget(self) -> None:
        """Free the memory of its programs."""
        self._programs.clear()


def compiled(work: Callable[..., _Result]) -> Compiled[_Result]:
    """The function, compiled."""
    return Compiled(work)


_functions: list[Compiled[Any]] = []


def forget_programs() -> None:
    """Free the memory of all compiled programs of this process."""
    for function in _functions:
        function.forget()
    jax.clear_caches()


@cache
def compiler_options() -> dict[str, bool | int]:
    """The options for XLA's compiler; none if its version does not know them."""
    try:
        jax.jit(lambda: 0, compiler_options=_QUICKER).lower().compile()
    except jax.errors.JaxRuntimeError:
        return {}
    return _QUICKER


@cache
def _libraries() -> ThreadpoolController:
    """The libraries for linear algebra that are loaded."""
    return ThreadpoolController()
