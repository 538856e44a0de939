r"""Any rate-independent law as a prior: free curves of the path, and memory that fades along it.

The whitened response is normal with the covariance

    1 + B Λ⁻¹ Bᵀ + τ² F Fᵀ,    Λ = bᵀb / ρ² + 1 / S²

with B the curves of all branches, b their bends, ρ the roughness, F the fading memory of size τ and
S the response's range.  ρ and τ have the values of the largest evidence.

Source: Rasmussen & Williams, Gaussian Processes (2006), 5.4.1.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ._curves import Curves, curves_of
from ._drive import unresolved
from ._fading import fading_memory
from ._filters import Filter
from ._prior import Prior, log_likelihood
from ._whitening import Whitening

ROUGHNESSES = np.array([10.0, 30.0, 100.0, 300.0])
"""Standard deviations ρ of a curve's second differences that are tried, over the noise.  A smoother
curve knows more than was recorded: at 2 a dynamic effect was named on 9 of 14 recordings of random
Preisach planes and others that had none, since its few coefficients described their roughness, at
10 on none."""
FADINGS = np.array([0.003, 0.0, 0.03, 0.3, 1.0])
"""Sizes τ of fading memory that are tried, over the response's span."""
_LOOSE = 0.02
"""How far the path behind a filter may be from its curve, over the noise."""
_LEAST = 1e-9
"""The same at least, where a filter is so slow that its equations had no digits left."""
_WEAK = 1e-6
"""The precision of what is between two filters, over that of its range: no pivot is zero."""
_PROBES = 8
"""Probes of a law's freedom, which they give to some percents."""


@dataclass(frozen=True, eq=False)
class PathLaw:
    """The prior of path curves for some recordings, under one noise.

    Attributes:
        drive: (ΣN,) of all recordings.
        curves: the curves of all branches.
        fading: (ΣN, F) columns of fading memory, at most 1 in size, at all nodes of a filter.
        own: (ΣN, Q) what only one recording has, such as its offset [response unit].
        whitening: of the noise.
        span: the range of the responses [response unit].
        noise: the innovation of the noise [response unit].
        filter: between the path and the response, if any.
        loose: (ΣN,) how far the path may be from its curve, where the drive between two samples is
            not known [response unit]; without a filter that is in the noise.
    """

    drive: np.ndarray
    curves: Curves
    fading: np.ndarray
    own: np.ndarray
    whitening: Whitening
    span: float
    noise: float
    filter: Filter | None = None
    loose: np.ndarray | float = 0.0

    @classmethod
    def of(
        cls,
        drives: Sequence[np.ndarray],
        whitening: Whitening,
        span: float,
        error: float = 0.0,
        filter: Filter | None = None,
    ) -> PathLaw:
        """The prior for the drives (N,) of recordings of one actuator, of an rms `error`."""
        low = min(d.min() for d in drives)
        width = max(d.max() for d in drives) - low
        sizes = [d.size for d in drives]
        recording = np.repeat(np.arange(len(drives)), sizes)
        own = (recording[:, None] == np.arange(1, len(drives))).astype(float)
        drive = np.concatenate(drives)
        nodes = drive if filter is None else filter.nodes(drive)
        fading = _fading(drives, nodes, (low, width, error))
        loose = np.concatenate([unresolved(d) for d in drives]) * span / width
        noise = whitening.innovation
        if filter is None:
            whitening = whitening.loosened(loose)
        curves, own = curves_of(drives, error), span * own
        return cls(
            drive, curves, fading, own, whitening, span, noise=noise, filter=filter, loose=loose
        )

    @property
    def columns(self) -> int:
        """How many splines there are."""
        shape: Any = self.curves.basis.shape
        return int(shape[1])

    @cached_property
    def basis(self) -> sp.csr_array:
        """The curves' basis, whitened."""
        return sp.csr_array(self.whitening(self.curves.basis))

    @cached_property
    def gram(self) -> sp.csc_array:
        """The inner products of the whitened basis."""
        return sp.csc_array(self.basis.T @ self.basis)

    @cached_property
    def bends(self) -> sp.csc_array:
        """The inner products of the curves' bends."""
        return sp.csc_array(self.curves.bends.T @ self.curves.bends)

    @cached_property
    def dense(self) -> np.ndarray:
        """Fading memory and what only one recording has, whitened."""
        return self.whitening(np.concatenate([self.filtered(self.fading), self.own], axis=1))

    def nodes(self, drive: np.ndarray) -> np.ndarray:
        """A drive (ΣN,) where the path behind it is asked for: at the samples, and where a filter
        is, halfway before each of them."""
        return drive if self.filter is None else self.filter.nodes(drive)

    def splines(self, nodes: np.ndarray) -> sp.csr_array:
        """The basis of the curves at the nodes of a drive, on each sample's branch."""
        parts = np.split(nodes, nodes.size // self.drive.size)
        return sp.csr_array(sp.vstack([self.curves.at(part) for part in parts]))

    def filtered(self, signals: np.ndarray) -> np.ndarray:
        """Signals of the path at the nodes behind the filter (ΣN, …)."""
        return signals if self.filter is None else self.filter(signals)

    def beside(self, clear: np.ndarray) -> np.ndarray:
        """The columns at the nodes of what fades and of what only one recording has, of those that
        are `clear`."""
        own = np.tile(self.own, (self.fading.shape[0] // self.drive.size, 1))
        return np.concatenate([self.fading, own], axis=1)[:, clear]

    def settled(self, response: np.ndarray) -> Settled:
        """The prior with the roughness and the fading of the largest evidence for a response
        (ΣN,)."""
        white = self.whitening(response)

        def evidence(settled: Settled) -> float:
            inner = settled.prior.inner(np.zeros((white.size, 0)), white)
            return float(log_likelihood(inner.square, inner.log_determinant, self.whitening.count))

        fading, best = float(FADINGS[0]), None
        for roughness in ROUGHNESSES:
            one = Settled(self, float(roughness) * self.noise, fading)
            value = evidence(one)
            if best is not None and value < best[0]:
                break
            best = value, one
        assert best is not None  # there are roughnesses
        for other in (best[1].with_fading(float(f)) for f in FADINGS[1:]):
            best = max(best, (evidence(other), other), key=lambda pair: pair[0])
        return best[1]


def _fading(
    drives: Sequence[np.ndarray], nodes: np.ndarray, scale: tuple[float, float, float]
) -> np.ndarray:
    """The columns of fading memory at the nodes of the drives of recordings, of a `scale`: where
    their range begins, how large it is, and their rms error."""
    size = sum(d.size for d in drives)
    if nodes.size == size:
        return np.concatenate([fading_memory(d, *scale) for d in drives])
    ends = np.cumsum([d.size for d in drives])[:-1]
    parts = []
    for drive, before in zip(drives, np.split(nodes[size:], ends), strict=True):
        whole = fading_memory(np.column_stack([before, drive]).ravel(), *scale)
        parts.append(whole.reshape(drive.size, 2, -1))
    at_samples, halfway = (np.concatenate([p[:, k] for p in parts]) for k in (1, 0))
    return np.concatenate([at_samples, halfway])


class Settled:
    """The prior of path curves of one roughness [response unit], and of one fading over the
    response's span."""

    def __init__(self, law: PathLaw, roughness: float, fading: float, rough: Any = None):
        self.law, self.roughness, self.fading = law, roughness, fading
        if rough is None:
            rough = _Rough(law, roughness) if law.filter is None else _Filtered(law, roughness)
        self._rough: _Reduced = rough
        kinds, own = law.fading.shape[1], law.own.shape[1]
        sizes = np.concatenate([np.full(kinds, fading * law.span), np.ones(own)])
        self._clear = sizes > 0
        self._sizes = sizes[self._clear]
        self.prior = Prior(
            law.dense[:, self._clear] * self._sizes,
            rough.reduced,
            rough.log_determinant,
            rough.reduced_dense(self._clear) * self._sizes,
        )

    def with_fading(self, fading: float) -> Settled:
        """The same roughness with another fading."""
        return Settled(self.law, self.roughness, fading, self._rough)

    @cached_property
    def probed(self) -> tuple[np.ndarray, np.ndarray]:
        """White noise (ΣN, K), the same for all laws, and what the law takes out of it."""
        counted = self.law.whitening.counted
        probes = np.random.default_rng(0).choice([-1.0, 1.0], (counted.size, _PROBES))
        probes *= counted[:, None]
        return probes, probes - self.prior.weighted(probes)

    @cached_property
    def freedom(self) -> float:
        """How many coefficients the law spends on any response, and on errors of its drive: the
        trace of what it takes out of noise, by a few probes (Hutchinson, Commun. Stat. Simul. 18
        (1989) 1059)."""
        probes, taken = self.probed
        return float(np.sum(probes * taken)) / _PROBES + self.law.whitening.lost

    def path(self, response: np.ndarray) -> Path:
        """The most probable curves behind a response (ΣN,)."""
        return self.behind(self.law.whitening(response))

    def behind(self, white: np.ndarray) -> Path:
        """The same behind whitened responses (ΣN, …)."""
        law = self.law
        sized = (self.prior.coefficients(white).T * self._sizes).T
        rest = white - law.dense[:, self._clear] @ sized
        return Path(law, self._clear, self._rough.coefficients(rest), sized)

    def curve(self, response: np.ndarray) -> Curve:
        """The most probable curve behind a response (ΣN,), as the filter answers it."""
        path, law = self.path(response), self.law
        dense = law.beside(path.clear) @ path.sized
        before = law.splines(law.nodes(law.drive)) @ path.coefficients + dense
        return Curve(
            law.filtered(before),
            before[: law.drive.size],
            law.curves.slope @ path.coefficients,
            lambda drive: law.filtered(law.splines(law.nodes(drive)) @ path.coefficients + dense),
        )


@dataclass(frozen=True, eq=False)
class Path:
    """Curves with their coefficients (M, …), and dense columns with theirs (k, …), of those that
    are `clear`."""

    law: PathLaw
    clear: np.ndarray
    coefficients: np.ndarray
    sized: np.ndarray

    def through(self, law: PathLaw) -> np.ndarray:
        """The response (ΣN, …) of the drives of another law, on the same branches, and of its
        filter."""
        splines = self.law.splines(law.nodes(law.drive))
        return law.filtered(splines @ self.coefficients + law.beside(self.clear) @ self.sized)


class _Reduced(ABC):
    """Curves of one roughness, and what they leave of whitened signals."""

    _law: PathLaw
    log_determinant: float

    @abstractmethod
    def coefficients(self, white: np.ndarray) -> np.ndarray:
        """The most probable coefficients of the splines."""

    @abstractmethod
    def reduced(self, white: np.ndarray) -> np.ndarray:
        """Whitened signals (ΣN, k) times the inverse covariance."""

    @cached_property
    def _dense(self) -> np.ndarray:
        """The law's dense columns, reduced: the same for all fadings."""
        return self.reduced(self._law.dense)

    def reduced_dense(self, clear: np.ndarray) -> np.ndarray:
        """Those of the law's dense columns that are `clear`, reduced."""
        return self._dense if clear.all() else self.reduced(self._law.dense[:, clear])


class _Rough(_Reduced):
    """Curves of one roughness, seen directly."""

    def __init__(self, law: PathLaw, roughness: float):
        prior = _precision(law, roughness)
        self._law, self._factor = law, _factor(sp.csc_array(law.gram + prior))
        self.log_determinant = _log_determinant(self._factor) - _log_determinant(_factor(prior))

    def coefficients(self, white: np.ndarray) -> np.ndarray:
        """The most probable coefficients of the splines."""
        return self._factor.solve(np.asarray(self._law.basis.T @ white))

    def reduced(self, white: np.ndarray) -> np.ndarray:
        """Whitened signals (ΣN, k) times the inverse covariance."""
        return white - self._law.basis @ self.coefficients(white) if white.size else white


class _Filtered(_Reduced):
    """The same behind filters A z = B x: the responses z are unknowns beside the coefficients, and
    so are the multipliers of these equations, so that all matrices are sparse and none has the
    square of a small number."""

    def __init__(self, law: PathLaw, roughness: float):
        assert law.filter is not None  # else the curves are seen directly
        whitening, sections = law.whitening.matrix, law.filter.sections
        size = law.drive.size
        before: Any = -law.splines(law.nodes(law.drive))
        equations, deviations = [], []
        for k, one in enumerate(sections):
            loose = np.hypot(_LOOSE * law.noise, law.loose if k == 0 else 0.0)
            deviations.append(np.maximum(loose * np.abs(one.gain), _LEAST * law.noise))
            # The unknowns are the responses of all sections, the last first, and coefficients.
            row: list[Any] = [None] * (len(sections) + 1)
            row[-2 - k], row[-1 - k] = one.after, one.before @ before
            equations.append(row)
            before = -sp.eye_array(size)
        within = sp.block_array(equations, format="csr")
        prior, variances = _precision(law, roughness), np.concatenate(deviations) ** 2
        weak = sp.eye_array(size) * (_WEAK / law.span**2)
        between = [weak for _ in sections[1:]]
        beside = sp.block_diag([whitening.T @ whitening, *between, prior])
        self._law, self._whitening, self._size = law, whitening, size
        self._splines = slice(size * len(sections), size * len(sections) + law.columns)
        self._factor = _factor(
            sp.csc_array(sp.block_array([[beside, within.T], [within, -sp.diags_array(variances)]]))
        )
        of_prior = _log_determinant(_factor(prior)) + 2 * law.filter.log_determinant
        self.log_determinant = _log_determinant(self._factor) - of_prior

    def _solved(self, white: np.ndarray) -> np.ndarray:
        along = np.asarray(self._whitening.T @ white)
        nothing = np.zeros((self._factor.shape[0] - self._size, *along.shape[1:]))
        return self._factor.solve(np.concatenate([along, nothing]))

    def coefficients(self, white: np.ndarray) -> np.ndarray:
        """The most probable coefficients of the splines."""
        return self._solved(white)[self._splines]

    def reduced(self, white: np.ndarray) -> np.ndarray:
        """Whitened signals (ΣN, k) times the inverse covariance."""
        if not white.size:
            return white
        return white - self._whitening @ self._solved(white)[: self._size]


def _precision(law: PathLaw, roughness: float) -> sp.csc_array:
    """The inverse covariance of the splines' coefficients."""
    return sp.csc_array(law.bends / roughness**2 + sp.eye_array(law.columns) / law.span**2)


class Curve(NamedTuple):
    """A curve behind a response: its values (ΣN,) [response unit] after the filter and before it,
    its slope by the drive (ΣN,) before it, and its values where the drive (ΣN,) is another on the
    same branches."""

    values: np.ndarray
    before: np.ndarray
    slope: np.ndarray
    at: Callable[[np.ndarray], np.ndarray]


def _factor(matrix: sp.csc_array):
    """The factors of a symmetric matrix, positive or quasi-definite (Vanderbei, SIAM J. Optim. 5
    (1995) 100), in any order."""
    return splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )  # fmt: skip


def _log_determinant(factor) -> float:
    """The logarithm of a factored positive matrix's determinant."""
    return float(np.log(np.abs(factor.U.diagonal())).sum())
