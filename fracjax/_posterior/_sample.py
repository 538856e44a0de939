"""The ensemble sampler: its walkers, its file, and when it has run long enough."""

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
"""Moves of the walkers and their probabilities; chosen by judgement."""
_BATCH = 16
"""Points that are evaluated in one call, so that one compiled program serves all moves."""
BLOCK = 100
"""Fewest steps between two checks of convergence; chosen by judgement."""
_BURN_IN = 5.0
"""Length of the burn-in, in autocorrelation times; chosen by judgement."""
TARGET_ESS = 400
_LARGEST_R_HAT = 1.01
"""Effective draws, and largest R-hat, of a converged chain: ArviZ' and Vehtari et al.'s (2021)."""
_CHUNKS = 4
"""Parts of the run that R-hat compares; chosen by judgement."""
_SETTINGS = "fracjax.settings"

LogDensity = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Chain:
    """All steps of the walkers, and measures of their convergence.

    `coordinates` (n, walkers, D) and `log_density` (n, walkers) are those of all n steps,
    `acceptance` the share of accepted proposals, `autocorrelation` (D,) the autocorrelation times
    in steps, `burn_in` the number of steps at the start to leave out, `r_hat` (D,) the R-hat of
    the other steps, split into quarters, and `ess` (D,) the effective draws in their bulk or tails,
    whichever are fewer, of which `target` are wanted.
    """

    coordinates: np.ndarray
    log_density: np.ndarray
    acceptance: float
    autocorrelation: np.ndarray
    burn_in: int
    r_hat: np.ndarray
    ess: np.ndarray
    target: int

    @property
    def kept(self) -> np.ndarray:
        """Coordinates (steps, walkers, D) after the burn-in."""
        return self.coordinates[self.burn_in :]

    @property
    def converged(self) -> bool:
        """Whether these hold as many effective draws as wanted, with each R-hat below 1.01."""
        return bool(self.ess.min() >= self.target and self.r_hat.max() < _LARGEST_R_HAT)

    @property
    def forecast(self) -> int:
        """The steps that the chain will have once it holds as many effective draws as wanted."""
        return self.burn_in + int(np.ceil(len(self.kept) * self.target / max(self.ess.min(), 1.0)))


def split_r_hat(steps: np.ndarray) -> np.ndarray:
    """R-hat (D,) of steps (n, walkers, D): each quarter of the run, with all walkers, is one chain.

    The walkers of an ensemble depend on each other, so they are not separate chains.  Quarters that
    differ show that the run still drifts.
    Source: Vehtari et al., Bayesian Anal. 16 (2021) 667, through ArviZ.
    """
    import arviz  # takes two seconds, which a fit or a help text saves

    length = len(steps) // _CHUNKS
    columns = np.moveaxis(steps[len(steps) - _CHUNKS * length :], 2, 0)
    return np.array([float(arviz.rhat(column.reshape(_CHUNKS, -1))) for column in columns])


def effective_draws(steps: np.ndarray) -> np.ndarray:
    """Effective draws (D,) in the bulk or the tails, whichever are fewer, of steps (n, walkers, D).

    Source: Vehtari et al., Bayesian Anal. 16 (2021) 667, through ArviZ.
    """
    import arviz

    columns = np.moveaxis(steps, 1, 0)
    return np.array(
        [
            min(float(np.asarray(arviz.ess(column, method=kind))) for kind in ("bulk", "tail"))
            for column in np.moveaxis(columns, 2, 0)
        ]
    )


def chain_of(backend: Backend, target: int) -> Chain:
    """The chain with its autocorrelation times, burn-in (five such times), R-hat and draws."""
    steps = np.asarray(backend.get_chain())

    def times_of(part: np.ndarray) -> np.ndarray:
        """Autocorrelation times (D,) of steps (n, walkers, D)."""
        # A walker that has not moved has no such time; the length of the run takes its place.
        if np.any(np.all(part == part[0], axis=(0, 2))):
            return np.full(part.shape[2], float(len(part)))
        return np.asarray(emcee.autocorr.integrated_time(part, tol=0, quiet=True))

    first_estimate = times_of(steps[len(steps) // 2 :])
    burn_in = min(int(np.ceil(_BURN_IN * first_estimate.max())), len(steps) // 2)
    after_burn_in = steps[burn_in:]
    return Chain(
        coordinates=steps,
        log_density=np.asarray(backend.get_log_prob()),
        acceptance=float(np.mean(backend.accepted) / len(steps)),
        autocorrelation=times_of(after_burn_in),
        burn_in=burn_in,
        r_hat=split_r_hat(after_burn_in),
        ess=effective_draws(after_burn_in),
        target=target,
    )


class ChainFile:
    """The chain on disk, complete at any moment.

    emcee writes into a hidden copy.  After each block of steps the copy is forced to disk and
    replaces the file.  A killed run leaves the last complete block and the state of the random
    generator after it, so a resumed run continues exactly as if it had not been interrupted.
    """

    def __init__(self, path: Path):
        self.path, self.copy = path, path.with_name(f".{path.name}.part")

    def begin(self) -> Backend:
        """A backend without steps."""
        self.copy.unlink(missing_ok=True)
        return HDFBackend(str(self.copy))

    def resume(self, settings: Mapping[str, str]) -> Backend:
        """A backend with the steps in the file, or without steps if there is no file.

        Raises:
            InputError: The file is no chain, or one with other settings.
        """
        if not self.path.exists():
            return self.begin()
        try:
            with h5py.File(self.path) as file:
                stored = json.loads(str(file.attrs[_SETTINGS]))
        except (OSError, KeyError, ValueError):
            raise InputError.at(
                str(self.path), "a chain saved by fracjax", "something else", "leave out --resume"
            ) from None
        for name, value in settings.items():
            if stored.get(name) != value:
                raise InputError.at(
                    str(self.path),
                    f"a chain with {name} {value}",
                    f"one with {stored.get(name)}",
                    "leave out --resume, or give another folder",
                )
        shutil.copyfile(self.path, self.copy)
        return HDFBackend(str(self.copy))

    def checkpoint(self, settings: Mapping[str, str]) -> None:
        """Replace the file by the copy, with its settings."""
        with h5py.File(self.copy, "a") as file:
            file.attrs[_SETTINGS] = json.dumps(dict(settings))
        replacement = self.path.with_name(f".{self.path.name}.whole")
        shutil.copyfile(self.copy, replacement)
        with replacement.open("r+b") as file:
            os.fsync(file.fileno())
        replacement.replace(self.path)

    def end(self) -> None:
        """Delete the hidden files."""
        for hidden in (self.copy, self.path.with_name(f".{self.path.name}.whole")):
            with suppress(OSError):
                hidden.unlink(missing_ok=True)


def in_batches(log_density: LogDensity) -> LogDensity:
    """The same function, called with sixteen rows at a time: one program serves all moves."""

    def batched(points: np.ndarray) -> np.ndarray:
        """Log densities (K,) at points (K, D)."""
        padding = -len(points) % _BATCH
        rows = np.concatenate([points, np.repeat(points[-1:], padding, axis=0)])
        parts = [log_density(rows[k : k + _BATCH]) for k in range(0, len(rows), _BATCH)]
        return np.concatenate([np.asarray(part) for part in parts])[: len(points)]

    return batched


def initial_walkers(
    log_density: LogDensity, walkers: int, size: int, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Standard normal points (walkers, size) and their log densities (walkers,).

    Points with a density far below what the origin's suggests are moved towards the origin, by
    halves.  The limit, 5 per dimension and 20 more below the origin's log density, was chosen by
    judgement.
    """
    points = generator.standard_normal((walkers, size))
    lowest = log_density(np.zeros((1, size)))[0] - 5 * size - 20
    for _ in range(20):  # halves a distance to a millionth
        log_densities = log_density(points)
        low = log_densities < lowest
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
    step: Callable[[int], None],
    target: int = TARGET_ESS,
) -> Chain:
    """Run blocks of steps until the chain has converged, or has `steps` steps.

    The origin is the density's mode, and one unit its width.  `watch` is called with the chain
    after each block, and `step` with the steps done after each.
    """
    batched = in_batches(log_density)
    interrupts: list[KeyboardInterrupt] = []

    def guarded(points: np.ndarray) -> np.ndarray:
        """The log densities; after an interrupt, -∞, so that emcee returns."""
        try:
            return batched(points)
        except KeyboardInterrupt as interrupt:
            # emcee would print it together with the points and a traceback.
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
            points, log_densities = initial_walkers(
                batched, walkers, size, np.random.default_rng(seed)
            )
            generator_state = np.random.RandomState(seed).get_state()
            state = emcee.State(points, log_prob=log_densities, random_state=generator_state)
        else:
            chain = chain_of(backend, target)
            if chain.converged or backend.iteration >= steps:
                return chain
            state = backend.get_last_sample()
        while True:
            done = backend.iteration
            block = min(max(BLOCK, done // 10), steps - done)
            # The walkers are never degenerate here; emcee's check would cost a step per block.
            states = sampler.sample(state, iterations=block, skip_initial_state_check=True)
            for count, next_state in enumerate(states, done + 1):
                if interrupts:
                    raise interrupts[0]
                state = next_state
                step(count)
            if file is not None:
                file.checkpoint(settings)
            chain = chain_of(backend, target)
            watch(chain)
            if chain.converged or len(chain.coordinates) >= steps:
                return chain
    finally:
        if file is not None:
            file.end()
