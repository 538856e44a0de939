r"""From which detectability an effect is named: what the posterior says of the expected recording.

Of an effect of the size a along d the expected inner products with all columns D are a DᵀPd, and
the expected χ² is n + a² dᵀPd.  What the posterior over no effect and one says of them has its
prior odds, Occam's factor of all shapes and sizes, and whatever looks alike.  What is in series
with the path is of one size for each shape, and looks like something else at that size alone; more
effects than one explain no single one better.
"""

from __future__ import annotations

import numpy as np
from scipy.special import log_ndtr

from ._chain import IN_SERIES
from ._expansion import family_of
from ._posterior import EACH, SIZES, Law
from ._prior import log_likelihood

SURE = 0.95
"""The probability at which an effect, or one of its look-alikes, is named; by convention."""
_RANGE = (1.0, 1e3)
"""Detectabilities that are tried."""
_HALVINGS = 14
"""How often their range is halved."""


def levels(law: Law, directions: np.ndarray) -> np.ndarray:
    """The detectability (K,), as the law tempers it, from which what each of some directions (K, K)
    adds is named, one for each column, of its effect; inf where something else is as likely at any.

    `law` has the inner products of the columns.
    """
    law = law.tempered(0.0)
    gram, kinds, count = law.inner.columns, law.kinds, law.count
    names = np.array([kind.name for kind in kinds])
    owners = np.repeat(names, [kind.stop - kind.start for kind in kinds])
    alike = np.array([[own == name or own in family_of(name) for name in owners] for own in names])
    square = np.einsum("kj,ki,ij->j", directions, gram, directions)
    seen = square > 0
    along = gram @ directions / np.sqrt(np.where(seen, square, 1.0))
    taken, determinant, scores = _answers(law, along)
    starts = [kind.start for kind in kinds]
    exact = np.isin(names, IN_SERIES)[:, None] & ~alike
    shapes = np.array([np.count_nonzero(names == name) for name in names])
    prior = (np.log(EACH) - np.log(shapes))[:, None]
    one_sided = np.array([kind.one_sided for kind in kinds])

    def named(a: np.ndarray) -> np.ndarray:
        """Whether each direction is named at the detectabilities (J,)."""
        none = log_likelihood(count + a**2, 0.0, count)
        rest = count + a**2 * (1 - taken)
        evidence = log_likelihood(rest, determinant, count) - np.log(SIZES.size)
        score = a * scores / np.sqrt(np.maximum(1.0, rest / count))
        evidence[one_sided] += np.log(2) + log_ndtr(score[one_sided])
        as_it_is = count + a**2 - 2 * a * along[starts] + np.diag(gram)[starts, None]
        exactly = log_likelihood(as_it_is, 0.0, count)
        each = prior + np.where(exact, exactly, np.logaddexp.reduce(evidence, axis=1))
        whole = np.logaddexp(np.logaddexp.reduce(each, axis=0), none)
        return np.logaddexp.reduce(np.where(alike, each, -np.inf), axis=0) - whole > np.log(SURE)

    low, high = (np.full(square.size, end) for end in _RANGE)
    never = ~seen | ~named(high)
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        is_named = named(middle)
        low, high = np.where(is_named, low, middle), np.where(is_named, middle, high)
    return np.where(never, np.inf, high)


def _answers(law: Law, along: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For each kind, size and direction (kinds, sizes, J), of detectability 1 and with inner
    products (K, J): what the kind takes of χ², the logarithm of its determinant (kinds, sizes, 1),
    and its score, of one column."""
    shape = len(law.kinds), SIZES.size, along.shape[1]
    taken, scores, determinant = np.empty(shape), np.zeros(shape), np.empty((*shape[:2], 1))
    variance = SIZES[:, None] ** 2
    for k, kind in enumerate(law.kinds):
        own = slice(kind.start, kind.stop)
        values, turned = np.linalg.eigh(law.inner.columns[own, own])
        values = np.maximum(values, 0.0)
        shares = variance / (1 + variance * values)
        parts = turned.T @ along[own]
        taken[k] = shares @ parts**2
        determinant[k, :, 0] = np.log1p(variance * values).sum(axis=1)
        if kind.one_sided:
            scores[k] = np.sqrt(shares) * parts
    return taken, determinant, scores
