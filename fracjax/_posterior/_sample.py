"""The ensemble sampler: its walkers, its file, and when it has run for long enough."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import emcee
import h5py
import numpy as np
from emcee.backends import Backend, HDFBackend

from .._recording import InputError

MOVES = (
    (emcee.moves.StretchMove(), 0.3),
    (emcee.moves.DEMove(), 0.6),
    (emcee.moves.DESnookerMove(), 0.1),
)
_BATCH = 16
_BLOCK = 100
_BURN_IN = 5.0
_LENGTH = 50.0
_LARGEST_R_HAT = 1.01
_CHUNKS = 4
_SETTINGS = "fracjax.settings"

LogDensity = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Chain:
    """All steps (n, walkers, D), their log-densities (n, walkers), and what they amount to.

    `autocorrelation` (D,) in steps; `burn_in` the steps to be left out; `r_hat` (D,) split over
    quarters of what is left; `converged` when that is 50 autocorrelation times or more, and every
    r_hat below 1.01.
    """

    coordinates: np.ndarray
    log_density: np.ndarray
    acceptance: float
    autocorrelation: np.ndarray
    burn_in: int
    r_hat: np.ndarray

    @property
    def kept(self) -> np.ndarray:
        return self.coordinates[self.burn_in :]

    @property
    def converged(self) -> bool:
        long_enough = len(self.kept) >= _LENGTH * self.autocorrelation.max()
        return bool(long_enough and self.r_hat.max() < _LARGEST_R_HAT)


def split_r_hat(steps: np.ndarray) -> np.ndarray:
    """R-hat (D,) of steps (n, walkers, D): each quarter of the run, all its walkers, is a chain.

    Walkers of one ensemble move by each other, so that they are no chains of their own; quarters
    that differ show a run that still drifts.
    Source: Vehtari et al., Bayesian Anal. 16 (2021) 667, through ArviZ.
    """
    import arviz  # takes two seconds, which a fit or a help text need not wait for

    length = len(steps) // _CHUNKS
    columns = np.moveaxis(steps[len(steps) - _CHUNKS * length :], 2, 0)
    return np.array([float(arviz.rhat(column.reshape(_CHUNKS, -1))) for column in columns])


def judged(backend: Backend) -> Chain:
    """A chain with its autocorrelation time, burn-in (five such times) and R-hat."""
    steps = np.asarray(backend.get_chain())

    def times_of(part: np.ndarray) -> np.ndarray:
        # Of a walker that has not moved at all there is none: it is as long as the run, at least.
        if np.any(np.all(part == part[0], axis=(0, 2))):
            return np.full(part.shape[2], float(len(part)))
        return np.asarray(emcee.autocorr.integrated_time(part, tol=0, quiet=True))

    rough = times_of(steps[len(steps) // 2 :])
    burn_in = min(int(np.ceil(_BURN_IN * rough.max())), len(steps) // 2)
    kept = steps[burn_in:]
    return Chain(
        coordinates=steps,
        log_density=np.asarray(backend.get_log_prob()),
        acceptance=float(np.mean(backend.accepted) / len(steps)),
        autocorrelation=times_of(kept),
        burn_in=burn_in,
        r_hat=split_r_hat(kept),
    )


class ChainFile:
    """The chain on disk, whole at any moment.

    emcee writes into a hidden copy; after each block of steps the copy is forced to disk and takes
    the file's place.  A kill at any moment leaves the last block, and the state of the random
    numbers after it, so that a resumed run goes on as if nothing had happened.
    """

    def __init__(self, path: Path):
        self.path, self.copy = path, path.with_name(f".{path.name}.part")

    def begin(self) -> Backend:
        """A backend without steps."""
        self.copy.unlink(missing_ok=True)
        return HDFBackend(str(self.copy))

    def resume(self, settings: Mapping[str, str]) -> Backend:
        """A backend with the steps there are, none where no file is.

        **Raises:** `InputError` for a file that is no chain, or one of other settings.
        """
        if not self.path.exists():
            return self.begin()
        try:
            with h5py.File(self.path) as file:
                told = json.loads(str(file.attrs[_SETTINGS]))
        except (OSError, KeyError, ValueError):
            raise InputError.at(
                str(self.path), "a chain saved by fracjax", "something else", "leave out --resume"
            ) from None
        for name, wanted in settings.items():
            if told.get(name) != wanted:
                raise InputError.at(
                    str(self.path),
                    f"a chain with {name} {wanted}",
                    f"one with {told.get(name)}",
                    "leave out --resume, or give another folder",
                )
        shutil.copyfile(self.path, self.copy)
        return HDFBackend(str(self.copy))

    def checkpoint(self, settings: Mapping[str, str]) -> None:
        """The copy, with its settings, takes the file's place."""
        with h5py.File(self.copy, "a") as file:
            file.attrs[_SETTINGS] = json.dumps(dict(settings))
        following = self.path.with_name(f".{self.path.name}.whole")
        shutil.copyfile(self.copy, following)
        with following.open("r+b") as file:
            os.fsync(file.fileno())
        following.replace(self.path)

    def end(self) -> None:
        for left in (self.copy, self.path.with_name(f".{self.path.name}.whole")):
            with suppress(OSError):
                left.unlink(missing_ok=True)


def in_batches(log_density: LogDensity) -> LogDensity:
    """The same, called with sixteen rows at a time: one compiled program then serves all moves."""

    def whole(points: np.ndarray) -> np.ndarray:
        padding = -len(points) % _BATCH
        rows = np.concatenate([points, np.repeat(points[-1:], padding, axis=0)])
        parts = [log_density(rows[k : k + _BATCH]) for k in range(0, len(rows), _BATCH)]
        return np.concatenate([np.asarray(part) for part in parts])[: len(points)]

    return whole


def first_walkers(
    log_density: LogDensity, walkers: int, size: int, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Standard normal points (walkers, size) and their log-densities.

    Points far below what the density at the origin lets expect are drawn in, by halves.
    """
    points = generator.standard_normal((walkers, size))
    lowest = log_density(np.zeros((1, size)))[0] - 5 * size - 20
    for _ in range(20):
        heights = log_density(points)
        low = heights < lowest
        if not low.any():
            break
        points[low] /= 2
    return points, log_density(points)


def run_ensemble(
    log_density: LogDensity,
    *,
    walkers: int,
    size: int,
    steps: int,
    seed: int,
    file: ChainFile | None,
    resume: bool,
    settings: Mapping[str, str],
    watch: Callable[[Chain], None],
) -> Chain:
    """Run blocks of steps until the chain has converged, or has `steps`.

    The origin is the density's mode and one unit its width.  `watch` sees the chain after each
    block.
    """
    whole = in_batches(log_density)
    interrupts: list[KeyboardInterrupt] = []

    def guarded(points: np.ndarray) -> np.ndarray:
        try:
            return whole(points)
        except KeyboardInterrupt as interrupt:
            # emcee would print it, with the points and a traceback.
            interrupts.append(interrupt)
            return np.full(len(points), -np.inf)

    match file:
        case None:
            backend = Backend()
        case ChainFile():
            backend = file.resume(settings) if resume else file.begin()
    try:
        sampler = emcee.EnsembleSampler(
            walkers, size, guarded, moves=MOVES, backend=backend, vectorize=True
        )
        if not backend.iteration:
            points, heights = first_walkers(whole, walkers, size, np.random.default_rng(seed))
            numbers = np.random.RandomState(seed).get_state()
            state = emcee.State(points, log_prob=heights, random_state=numbers)
        else:
            chain = judged(backend)
            if chain.converged or backend.iteration >= steps:
                return chain
            state = backend.get_last_sample()
        while True:
            done = backend.iteration
            block = min(max(_BLOCK, done // 10), steps - done)
            # Whitened walkers are never flat; emcee's check would cost a step at every block.
            for following in sampler.sample(state, iterations=block, skip_initial_state_check=True):
                if interrupts:
                    raise interrupts[0]
                state = following
            if file is not None:
                file.checkpoint(settings)
            chain = judged(backend)
            watch(chain)
            if chain.converged or len(chain.coordinates) >= steps:
                return chain
    finally:
        if file is not None:
            file.end()
