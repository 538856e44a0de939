"""The place of the mismatch: the score test with places instead of effects as columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.special import fdtrc, ndtri

from .._prepare import Preparation, Problem, kurtosis_of
from .._solve import orthonormal_basis
from ._fitted import Fitted
from ._result import Axis
from ._thresholds import SIGNIFICANCE

# Numbers of bins, and of harmonics: chosen by judgement.
_TIME_BINS = 16
_PHASE_BINS = 24
_LEVEL_BINS = 12
_RATE_BINS = 10
_REVERSAL_BINS = 10
_FREQUENCY_BINS = 14
_HARMONICS = 10
_DOUBT = 3.0
"""Standard deviations under noise alone that are subtracted from an excess; chosen by judgement."""
_INDEPENDENT = 1e-10
"""Smallest eigenvalue of a Gram matrix that counts as independent, over the largest one."""


@dataclass(frozen=True)
class Residual:
    """The whitened residual (ΣL,), and an orthonormal basis (ΣL, r) of the changes that the fit can
    absorb."""

    whitened: np.ndarray
    basis: np.ndarray

    @classmethod
    def beside(cls, error: np.ndarray, tangent: np.ndarray) -> Residual:
        """A whitened error (ΣL,) minus what the fit can absorb along its whitened tangent
        (ΣL, P)."""
        basis = orthonormal_basis(tangent)
        return cls(error - basis @ (basis.T @ error), basis)

    def project(self, columns: np.ndarray) -> np.ndarray:
        """Columns (K, ΣL) minus what the fit can absorb."""
        return columns - (columns @ self.basis) @ self.basis.T


def freedom_of(preparation: Preparation, tails: float) -> float:
    """The degrees of freedom of the noise level, for a residual of this kurtosis: a short rest may
    contain none of a heavy tail."""
    noises = [take.noise for take in preparation.takes if take.noise is not None]
    return 2 / max(*(noise.doubt(tails) for noise in noises), 1e-6) ** 2


def doubt_of(fitted: Fitted, count: float) -> float:
    """Three standard errors of the excess of χ² per sample beside a fit to `count` samples, with
    that of the noise level."""
    freedom = freedom_of(fitted.preparation, fitted.solved.kurtosis)
    return float(3 * np.sqrt(2 / count + 2 / freedom))


def locate(
    preparation: Preparation, problems: tuple[Problem, ...], residual: Residual, freedom: float
) -> list[Axis]:
    """All axes that the recordings have, each with its map of strength.

    `freedom`: the degrees of freedom of the noise level.
    """
    places = _Places(preparation, problems, residual, freedom)
    axes = [places.time(), places.frequency(), places.level(), places.rate(), places.reversal()]
    if places.phases is not None:
        axes += [places.phase(), places.harmonics()]
    return axes


def acting_at(axis: Axis, explained: list[Axis]) -> Axis:
    """An axis with the places where effects change the response at least half as much as at the
    maximum; `explained` are the maps of that change instead of the residual."""
    (same,) = (other for other in explained if other.axis == axis.axis)
    most = same.strength >= 0.5 * same.strength.max()
    return replace(axis, intervals=_stretches(axis.edges, most))


class _Places:
    """The samples' coordinates, padded like the problems: time, drive, rate, reversals, phase."""

    def __init__(
        self,
        preparation: Preparation,
        problems: tuple[Problem, ...],
        residual: Residual,
        freedom: float,
    ):
        self.problems, self.residual, self.freedom = problems, residual, freedom
        first = preparation.takes[0].recording
        self.step = first.dt
        noise = preparation.takes[0].noise
        assert noise is not None  # a diagnosis has one
        self.noise = noise
        counted = residual.whitened[residual.whitened != 0]
        self.kurtosis = max(3.0, noise.kurtosis, kurtosis_of(counted))
        self.units = (first.drive_unit, first.response_unit)
        lengths = [p.response.shape[0] for p in problems]
        self.drive = np.concatenate(
            [
                np.asarray(p.drive)[:: p.oversampling][:n]
                for p, n in zip(problems, lengths, strict=True)
            ]
        )
        steps = [t.recording.dt for t in preparation.takes]
        self.times = np.concatenate([np.arange(n) * h for n, h in zip(lengths, steps, strict=True)])
        self.rates = np.concatenate(
            [
                np.gradient(np.asarray(p.drive), h / p.oversampling)[:: p.oversampling][:n]
                for p, n, h in zip(problems, lengths, steps, strict=True)
            ]
        )
        self.counted = np.concatenate([np.asarray(p.weights) for p in problems]) > 0
        repeats = [t.recording.drive_period() for t in preparation.takes]
        # In periods since the first sample, if every recording's drive has a period.
        self.phases = None
        if all(repeats):
            turns = [np.arange(n) / r.period for n, r in zip(lengths, repeats, strict=True) if r]
            self.phases = np.concatenate(turns)

    def _whiten(self, columns: np.ndarray) -> np.ndarray:
        """Columns (K, ΣL) through each recording's whitening filter."""
        pieces, at = [], 0
        for problem in self.problems:
            length = problem.response.shape[0]
            pieces.append(np.asarray(problem.whiten(columns[:, at : at + length].T)).T)
            at += length
        return np.concatenate(pieces, axis=1)

    def _energy(self, columns: np.ndarray) -> tuple[float, int, float]:
        """The reduction of χ² by a group of columns (K, ΣL) after projection, its degrees of
        freedom, and its variance.

        If the noise has heavy tails, the variance of a group of few samples exceeds that of a χ².
        """
        projected = self.residual.project(self._whiten(columns))
        squares, turned = np.linalg.eigh(projected @ projected.T)
        clear = squares > _INDEPENDENT * max(float(squares[-1]), 1e-300)
        kept = (turned[:, clear] / np.sqrt(squares[clear])).T @ projected
        energy, count = np.sum((kept @ self.residual.whitened) ** 2), max(kept.shape[0], 1)
        tails = (self.kurtosis - 3) * float(np.sum(np.sum(kept**2, axis=0) ** 2))
        return float(energy), count, 2 * count + tails

    def _axis(self, name: str, unit: str, edges: np.ndarray, groups: list[np.ndarray]) -> Axis:
        """An axis of places, each with its group of columns (K, ΣL)."""
        return _map(name, unit, edges, *self._tested(groups))

    def _tested(self, groups: list[np.ndarray]) -> tuple[np.ndarray, float, float]:
        """The p-values (n,) of each group and of all together, by an F distribution, since the
        noise level is an estimate; and the excess of the groups' χ² over that of noise."""
        energies, counts, variances = np.array([self._energy(group) for group in groups]).T
        whole = self._energy(np.concatenate(groups))
        beyond = float(energies.sum() - counts.sum() - _DOUBT * np.sqrt(variances.sum()))
        p_values = self._p_value(energies, counts, variances)
        return p_values, float(self._p_value(*whole)), max(0.0, beyond)

    def _p_value(self, energy, count, variance) -> np.ndarray:
        """The p-value from a scaled χ² with the same mean and variance."""
        return fdtrc(2 * count**2 / variance, self.freedom, energy / count)

    def _binned(self, name: str, unit: str, values: np.ndarray, edges: np.ndarray, *shapes) -> Axis:
        """An axis of bins of a coordinate; in each the residual may follow any of the shapes."""
        index = np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
        shapes = (np.ones_like(values), *shapes)

        inside = [(index == k) & self.counted for k in range(edges.size - 1)]
        groups = [np.stack([shape * here for shape in shapes]) for here in inside]
        return self._axis(name, unit, edges, groups)

    @staticmethod
    def _scaled(values: np.ndarray) -> np.ndarray:
        """Values (ΣL,) with zero mean and unit standard deviation."""
        return (values - values.mean()) / values.std()

    def _quantiles(self, values: np.ndarray, bins: int) -> np.ndarray:
        """Edges of bins that contain equally many counted values."""
        edges = np.unique(np.quantile(values[self.counted], np.linspace(0, 1, bins + 1)))
        return edges if edges.size > 1 else np.array([edges[0], edges[0] + 1.0])

    def time(self) -> Axis:
        """Time from each recording's first sample, in equal bins."""
        used = self.times[self.counted]
        edges = np.linspace(used.min(), used.max() + self.step, _TIME_BINS + 1)
        return self._binned("time", "s", self.times, edges, self._scaled(self.drive))

    def level(self) -> Axis:
        """The drive, in equal bins, rising and falling separately."""
        low, high = self.drive[self.counted].min(), self.drive[self.counted].max()
        edges = np.linspace(low, high, _LEVEL_BINS + 1)
        return self._binned("level", self.units[0], self.drive, edges, np.sign(self.rates))

    def rate(self) -> Axis:
        """The rate of the drive, in bins with equally many samples."""
        edges = self._quantiles(self.rates, _RATE_BINS)
        return self._binned(
            "rate", f"{self.units[0]}/s", self.rates, edges, self._scaled(self.drive)
        )

    def reversal(self) -> Axis:
        """Time since the drive last turned, in logarithmic bins."""
        moving = np.where(
            np.abs(self.rates) > 1e-3 * np.abs(self.rates).max(), np.sign(self.rates), 0
        )
        last = np.maximum.accumulate(np.where(moving != 0, np.arange(moving.size), 0))
        direction = moving[last]
        turns = np.flatnonzero(np.diff(direction) != 0) + 1
        since = (
            np.arange(direction.size)
            - np.concatenate([[0], turns])[
                np.searchsorted(turns, np.arange(direction.size), side="right")
            ]
        )
        elapsed = (since + 0.5) * self.step
        edges = np.geomspace(
            0.5 * self.step, elapsed[self.counted].max() * 1.001, _REVERSAL_BINS + 1
        )
        return self._binned("reversal", "s", elapsed, edges, direction)

    def phase(self) -> Axis:
        """The phase within the drive's period, in equal bins."""
        degrees = self._turns() % 1 * 360
        return self._binned("phase", "deg", degrees, np.linspace(0, 360, _PHASE_BINS + 1))

    def _turns(self) -> np.ndarray:
        """Periods of the drive since the first sample (ΣL,)."""
        assert self.phases is not None  # the caller checks
        return self.phases

    def harmonics(self) -> Axis:
        """The first ten harmonics of the drive's period, each with both quadratures."""
        angles = 2 * np.pi * self._turns()
        groups = [
            np.stack([np.cos(k * angles), np.sin(k * angles)]) * self.counted
            for k in range(1, _HARMONICS + 1)
        ]
        return self._axis("harmonics", "1", np.arange(_HARMONICS + 1) + 0.5, groups)

    def frequency(self) -> Axis:
        """Logarithmic bands of frequency: the part of the residual there that is coherent with the
        drive, in gain or phase, and its power compared with that of the noise.

        The power is compared by an F test of the residual's spectral lines against those of the
        noise, if the noise has a spectrum; a band that a short rest does not resolve has p = 1.
        Heavy tails make the level of the whole noise scatter, and thus all bands together.
        """
        kept = self.residual.whitened[self.counted]
        power = np.abs(np.fft.rfft(kept)) ** 2 / kept.size
        frequencies = np.fft.rfftfreq(kept.size, self.step)[1:]
        power = power[1:]
        edges = np.geomspace(frequencies[0] * 0.999, frequencies[-1] * 1.001, _FREQUENCY_BINS + 1)
        bins = range(_FREQUENCY_BINS)
        index = np.clip(np.searchsorted(edges, frequencies) - 1, 0, _FREQUENCY_BINS - 1)
        read = np.searchsorted(edges, self.noise.lines[0] / self.step) - 1
        p_values = [self._band(power[index == k], self.noise.lines[1][read == k]) for k in bins]
        coherent, whole, _ = self._tested(self._driven(edges))
        either = np.minimum(1.0, 2 * np.minimum(p_values, coherent))
        return _map("frequency", "Hz", edges, either, whole)

    def _driven(self, edges: np.ndarray) -> list[np.ndarray]:
        """For each band the part of the drive in it, and the same a quarter of a period later
        (2, ΣL)."""
        pieces, at = [], 0
        for problem in self.problems:
            drive = self.drive[at : at + problem.response.shape[0]]
            at += drive.size
            lines = np.fft.rfft(drive - drive.mean(), 2 * drive.size)
            frequencies = np.fft.rfftfreq(2 * drive.size, self.step)
            within = [(low <= frequencies) & (frequencies < high) for low, high in pairwise(edges)]
            both = np.stack([lines, 1j * lines]) * np.array(within)[:, None]
            pieces.append(np.fft.irfft(both, axis=2)[:, :, : drive.size])
        return list(np.concatenate(pieces, axis=2) * self.counted)

    def _band(self, power: np.ndarray, noise: np.ndarray) -> float:
        """P(at least this power in a band), from the noise's own spectral lines there."""
        if power.size == 0:
            return 1.0
        tails = self.kurtosis - 3
        freedom = 2 / (1 / power.size + tails / np.count_nonzero(self.counted))
        if self.noise.lines[0].size == 0:
            return float(fdtrc(freedom, self.freedom, power.mean()))
        if noise.size == 0:
            return 1.0
        # A band whose noise is one high line has the degrees of freedom of one line.
        alike = min(1.0, 2 * noise.mean() ** 2 / np.mean(noise**2))
        others = noise.size * alike / self.noise.shared
        of_noise = 2 / (1 / others + tails / self.noise.effective)
        return float(fdtrc(min(freedom, of_noise), of_noise, power.mean() / noise.mean()))


def _map(
    name: str, unit: str, edges: np.ndarray, p_values: np.ndarray, whole: float, excess: float = 0.0
) -> Axis:
    """An axis from its bins' p-values and that of all bins together: |z|-equivalents, threshold,
    and the bins that stand out."""
    strength = -ndtri(np.maximum(p_values, 1e-300) / 2)
    threshold = -float(ndtri(SIGNIFICANCE / p_values.size / 2))
    standing_out = strength >= max(threshold, 0.5 * float(strength.max()))
    p_value = min(1.0, 2 * whole, 2 * float(p_values.min()) * p_values.size)
    intervals = _stretches(edges, standing_out)
    return Axis(name, unit, edges, strength, threshold, intervals, p_value, excess)


def _stretches(edges: np.ndarray, chosen: np.ndarray) -> tuple[tuple[float, float], ...]:
    """The chosen bins (n,) between edges (n+1,), joined where they touch."""
    intervals: list[tuple[float, float]] = []
    for k in np.flatnonzero(chosen):
        low, high = float(edges[k]), float(edges[k + 1])
        if intervals and intervals[-1][1] == low:
            low = intervals.pop()[0]
        intervals.append((low, high))
    return tuple(intervals)
