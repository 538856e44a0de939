"""The second gradient method: jaxopt's bounded L-BFGS.  No other file imports jaxopt."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from types import ModuleType

import jax.numpy as jnp
import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, position_of
from .._recording import InputError
from ._box import SearchResult, cost_and_gradient

_TOLERANCE = 1e-10
"""Relative change of χ² at which a run ends; chosen by judgement."""
_STEPS = 200
"""Most steps of a run; chosen by judgement."""


def require_jaxopt() -> ModuleType:
    """The module jaxopt, imported without its warning that it is no longer maintained.

    Raises:
        InputError: It is not installed.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            import jaxopt
    except ImportError:
        raise InputError(
            "jaxopt: expected the package for the bounded fit, found that it is not installed; "
            "install it by `pip install jaxopt`"
        ) from None
    return jaxopt


def bounded_lbfgs(starts: Sequence[AbstractBlock], problems: tuple[Problem, ...]) -> SearchResult:
    """The best result of L-BFGS-B from every start, over the unit cube, with the gains eliminated.

    χ² is in units of the noise, so a run ends by the relative change of χ².
    Source: Byrd, Lu, Nocedal & Zhu, SIAM J. Sci. Comput. 16 (1995) 1190.
    """
    solver = require_jaxopt().ScipyBoundedMinimize(
        fun=lambda position, block: cost_and_gradient(block, problems, position),
        value_and_grad=True,
        jit=False,
        maxiter=_STEPS,
        tol=_TOLERANCE,
    )
    results, evaluations = [], 0
    for start in starts:
        position = jnp.asarray(position_of(start))
        bounds = jnp.zeros_like(position), jnp.ones_like(position)
        result = solver.run(position, bounds, start)
        results.append((float(result.state.fun_val), np.asarray(result.params)))
        evaluations += int(result.state.num_fun_eval)
    cost, position = min(results, key=lambda result: result[0])
    return SearchResult(jnp.asarray(position), jnp.asarray(cost), jnp.asarray(evaluations))
