"""The second gradient fitter: jaxopt's bounded L-BFGS.  The only file that knows jaxopt."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from types import ModuleType

import jax.numpy as jnp
import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem, position_of
from .._recording import InputError
from ._box import Found, with_gradient

_TOLERANCE = 1e-10
_STEPS = 200


def require_jaxopt() -> ModuleType:
    """jaxopt, which warns on import that nobody maintains it.  Raises InputError without it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            import jaxopt
    except ImportError:
        raise InputError(
            "jaxopt: expected it to be installed for the bounded fit, found no such package; "
            "install it by `pip install jaxopt`"
        ) from None
    return jaxopt


def bounded(starts: Sequence[AbstractBlock], problems: tuple[Problem, ...]) -> Found:
    """The best of L-BFGS-B from every start, over the unit cube, gains eliminated.

    χ² is in units of the noise already, so that its relative change is what ends a run.
    Source: Byrd, Lu, Nocedal & Zhu, SIAM J. Sci. Comput. 16 (1995) 1190.
    """
    solver = require_jaxopt().ScipyBoundedMinimize(
        fun=lambda position, block: with_gradient(block, problems, position),
        value_and_grad=True,
        jit=False,
        maxiter=_STEPS,
        tol=_TOLERANCE,
    )
    found, looks = [], 0
    for start in starts:
        position = jnp.asarray(position_of(start))
        faces = jnp.zeros_like(position), jnp.ones_like(position)
        result = solver.run(position, faces, start)
        found.append((float(result.state.fun_val), np.asarray(result.params)))
        looks += int(result.state.num_fun_eval)
    cost, position = min(found, key=lambda pair: pair[0])
    return Found(jnp.asarray(position), jnp.asarray(cost), jnp.asarray(looks))
