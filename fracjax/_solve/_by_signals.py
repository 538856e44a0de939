"""Rows whose responses are combinations of a few signals.

The signals span all responses to a drive, so that a row's problem is a few numbers, by one QR per
row, or per drive where several rows have the same.  Some of the responses at the optimum are
compared with the full model.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from .._blocks import AbstractBlock
from .._prepare import Problem
from ._elimination import eliminate
from ._lockstep import Stack, change_by_shapes, dependences, total_of, with_one
from ._responses import respond_all
from ._row import Optima, Row, blocks_at, constants_of, descend_rows, slopes_at
from ._signals import Signals, stack_of, triangles_of

_SHARE_OF_NOISE = 1e-3
"""Largest error of a row's response [noise standard deviations, over all samples together]: no
parameter is wrong by more than this share of its standard error."""
_CHECKED = 4
"""Rows of a stack whose responses are compared with the full model.  Chosen by judgement."""


def optima_by_signals(rows: Sequence[Row], signals: Signals) -> Optima:
    """The optima of rows by signals that span their responses."""
    block, problems = rows[0].block, [row.problem for row in rows]
    own, triangles = problems[0].own.shape[1], triangles_of(problems, signals)
    terms, of_signals = triangles[:, :, :own], triangles[:, :, own:-1]
    stack = stack_of(signals, triangles, own, problems[0].grid)
    arrivals = descend_rows(block, stack, np.stack([row.positions for row in rows]))
    # From here on by factors of the signals (n,) instead of coordinates (m,).
    by_factors = Stack(signals.parts, np.zeros((1, signals.total)), stack.grid)
    depends, every = dependences(block, stack.grid), np.arange(len(rows))
    chains = by_factors.columns_around(block, depends, every, arrivals.positions)
    constants = constants_of(block, arrivals.positions, problems)
    here = total_of(chains, constants.shape[1] - 1)
    columns = here @ of_signals[:, own:].swapaxes(1, 2)
    gains = eliminate(columns[:, 1:].swapaxes(1, 2), stack.response - columns[:, 0])[0]
    weights = with_one(gains)[:, None]
    mixed, constant = (weights @ here)[:, 0], (weights @ constants[:, :, None])[:, 0]
    changes = change_by_shapes(chains, gains, arrivals.positions.shape[1])
    changes /= slopes_at(block, arrivals.positions)
    factors = np.concatenate([changes, here[:, 1:]], axis=1)
    by_parameter = np.pad(constants[:, 1:], [(0, 0), (changes.shape[1], 0)])
    derivatives = of_signals @ factors.swapaxes(1, 2) + terms[:, :, :1] * by_parameter[:, None]
    responses = signals.respond(mixed) + constant
    sizes = np.linalg.norm((of_signals[:, own:] @ mixed[:, :, None])[:, :, 0], axis=1)
    counted = np.array([int(np.count_nonzero(problem.weights)) for problem in problems])
    # The noise may be unknown as yet, so that the error is compared with the residual.
    residuals = np.sqrt(np.min(arrivals.costs, axis=1) / counted)
    return Optima(
        arrivals=arrivals,
        gains=gains,
        responses=responses,
        derivatives=[
            partial(_derivative, signals, row, *of_row)
            for row, *of_row in zip(every, factors, by_parameter, strict=True)
        ],
        triangles=np.asarray(np.linalg.qr(np.concatenate([derivatives, terms], axis=2), mode="r")),
        accurate=_are_accurate(
            blocks_at(block, arrivals.positions, gains),
            problems,
            responses,
            _SHARE_OF_NOISE * residuals / (sizes + 1e-300),
        ),
    )


def _derivative(
    signals: Signals, row: int, factors: np.ndarray, constants: np.ndarray
) -> np.ndarray:
    """The derivatives (p, L) of a row's response, by factors (p, n) of signals and constants."""
    return signals.mix(slice(row, row + 1), factors[None])[0] + constants[:, None]


def _are_accurate(
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Problem],
    responses: np.ndarray,
    tolerated: np.ndarray,
) -> np.ndarray:
    """Whether the responses (R, L) of rows are those of the full model to the error that each
    tolerates (R,), as a share.

    Some of them are compared; where one differs by more than a row tolerates, all are.
    """
    every = np.arange(len(blocks))
    some = every[:: -(-len(blocks) // _CHECKED)]
    largest = _errors(some, blocks, problems, responses).max()
    if np.all(largest <= tolerated):
        return np.ones(len(blocks), bool)
    return _errors(every, blocks, problems, responses) <= tolerated


def _errors(
    which: np.ndarray,
    blocks: Sequence[AbstractBlock],
    problems: Sequence[Problem],
    responses: np.ndarray,
) -> np.ndarray:
    """The relative errors of some responses (L,), by the full model."""
    errors = []
    exact = respond_all([blocks[at] for at in which], [problems[at] for at in which])
    for at, of_full_model in zip(which, exact, strict=True):
        pair = np.stack([of_full_model - responses[at], responses[at]])
        white = problems[at].whiten(np.concatenate([pair, problems[at].own.T]).T)
        basis = eliminate(white[:, 2:], white[:, 0])[2]
        error, size = np.linalg.norm(white[:, :2] - basis @ (basis.T @ white[:, :2]), axis=0)
        errors.append(float(error) / (float(size) + 1e-300))
    return np.array(errors)
