"""How numbers are computed: in double precision, and small matrices by one thread each."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import jax
import scipy.linalg  # noqa: F401  its linear algebra is a library of its own, to be found below
from threadpoolctl import ThreadpoolController


@contextmanager
def computing() -> Iterator[None]:
    """Double precision in JAX, and linear algebra of NumPy and SciPy on one thread, while it lasts.

    The matrices of a fit have thousands of rows and a dozen columns: a second thread makes their
    decompositions slower, four times on an idle machine of two cores and forty where another
    process computes too, since OpenBLAS' threads wait for each other by spinning.
    """
    with jax.enable_x64(True), _libraries().limit(limits=1, user_api="blas"):
        yield


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()
