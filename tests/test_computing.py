"""How numbers are computed while a public function runs, and after."""

import jax.numpy as jnp
import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

from fracjax._computing import computing


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
