"""Recordings under the two hypotheses on the law: the user's model is exact, or no law is known."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc

from .._blocks import EFFECTS, AbstractBlock, Effect, Setting
from .._computing import part_of_time
from .._parameters import named_parameters, set_values
from .._path import (
    DIRECTIONS,
    Hypothesis,
    Kind,
    Law,
    Motion,
    PathView,
    Posterior,
    Prior,
    Signal,
    Stage,
    apart,
    denoised,
    misfit,
    scanned_modes,
    select,
    view_of,
)
from .._prepare import (
    MOST_SPENT,
    Preparation,
    Residual,
    levels_of_residuals,
    noises_below,
    residual_noises,
)
from .._solve import orthonormal_basis
from ._columns import Group, groups_of
from ._fitted import Fitted
from ._places import Residual as Places
from ._places import doubt_of, freedom_of, locate
from ._thresholds import ADEQUATE, SIGNIFICANCE

FORM = 0.1
"""How far the form of a real effect is from that of its block, over its size: what an effect's
column leaves of it looks like a second effect."""
_OF_PATH, _OF_NOISE = 0.5, 0.2
"""The shares of the time that is left in which path curves are searched for what is in series with
the path, and are where they tell the noise alone; chosen by judgement."""
_CURVE = 64
"""Knots of the curve of the drive by which a residual is tested; chosen by judgement."""
MODEL = "model"
"""The name of the law of the user's model."""


@dataclass(frozen=True, eq=False)
class ModelView:
    """The posterior over effects if the model is exact but for them.

    Attributes:
        fitted: the model.
        groups: the effects' columns.
        posterior: over sets of effects.
        law: the inner products of the columns beside the model's tangent.
        whole: (K,) the length of each whitened column, before what the fit can absorb.
        prior: the covariance of the tangent.
    """

    fitted: Fitted
    groups: list[Group]
    posterior: Posterior
    law: Law
    whole: np.ndarray
    prior: Prior

    @cached_property
    def matrix(self) -> np.ndarray:
        """The columns (ΣL, K) of all groups [response unit]."""
        return np.concatenate([group.columns for group in self.groups], axis=1)

    @property
    def base_misfit(self) -> float:
        """κ - 1 without any effect, the excess of χ² per sample."""
        return misfit(self.law, Hypothesis(0.0, 0.0, MODEL, (), (), ()))

    def misfit_of(self, names: Collection[str]) -> float:
        """κ - 1 beside effects by their columns, or the best where this set was not tried."""
        own = [h for h in self.posterior.hypotheses if set(h.names) == set(names)]
        return misfit(self.law, own[0] if own else self.posterior.best)


View = ModelView | PathView


def misfit_of(fitted: Fitted) -> tuple[float, float]:
    """κ - 1 that a fitted model leaves, and three standard errors of it: no more than noise is left
    where it is not above them."""
    white, prior, count = _residual_of(fitted)
    excess = prior.inner(np.zeros((white.size, 0)), white).square / count - 1
    return excess, min(doubt_of(fitted, count), ADEQUATE - 1)


def _residual_of(fitted: Fitted) -> tuple[np.ndarray, Prior, int]:
    """A model's whitened residual (ΣL,), the prior of its tangent, and how many samples count."""
    prior = Prior(fitted.whitened(fitted.free_directions), lambda signals: signals, 0.0)
    count = int(np.count_nonzero(fitted.counted)) - fitted.tangent.shape[1]
    return fitted.whitened(fitted.error), prior, count


def model_view(fitted: Fitted, unknown: float = 0.0) -> ModelView:
    """The posterior over effects about a fitted model, of which the form of effects that it holds
    already may be `unknown` (`Law`)."""
    white, prior, count = _residual_of(fitted)
    simulations = [
        np.pad(s, (0, len(p.response) - s.size), mode="edge")
        for s, p in zip(fitted.simulations, fitted.problems, strict=True)
    ]
    steps = zip(fitted.preparation.takes, simulations, strict=True)
    motions = [
        Motion(
            s, s, lambda drive: drive, t.recording.dt, error=0.0, periodic=t.history == "periodic"
        )
        for t, s in steps
    ]
    groups, setting = groups_of(fitted), fitted.preparation.setting
    for mode in scanned_modes(motions, fitted.whitened, prior.weighted(white)):
        effect = EFFECTS[mode.effect]
        groups.append(Group(effect, (block_of(effect, mode.shape, setting),), mode.values))
    kinds, at = [], 0
    for group in groups:
        width = group.columns.shape[1]
        kinds.append(Kind(group.effect.name, at, at + width, group.effect.one_sided))
        at += width
    columns = fitted.whitened(np.concatenate([group.columns for group in groups], axis=1))
    inner = prior.inner(columns, white)
    excess = max(inner.square / count - 1, 0.0)
    unknown = max(unknown, FORM**2 * excess / DIRECTIONS)
    law = Law(MODEL, kinds, inner, count, unknown, _apart())
    posterior = select(law)
    whole = np.linalg.norm(columns, axis=0)
    return ModelView(fitted, groups, posterior, law, whole, prior)


def block_of(effect: Effect, shape: dict[str, float], setting: Setting) -> AbstractBlock:
    """A trial block of an effect with the parameters of a shape, as far as it has them: of the
    trials the one nearest to it, as of mains of two frequencies."""
    trials = [_at_shape(trial, shape) for trial in effect.trials(setting)]
    return min(trials, key=lambda pair: pair[0])[1]


def _at_shape(trial: AbstractBlock, shape: dict[str, float]) -> tuple[float, AbstractBlock]:
    """A trial block at a shape, and how far its bounds keep it from that, in ranges."""
    own = named_parameters(trial)
    shares = {key: np.asarray(own[key].to_share(v)) for key, v in shape.items() if key in own}
    within = {key: np.clip(share, 0.0, 1.0) for key, share in shares.items()}
    away = sum(float(np.max(np.abs(shares[key] - within[key]))) for key in shares)
    return away, set_values(trial, {key: own[key].from_share(x) for key, x in within.items()})


def trials_of(stage: Stage, setting: Setting) -> Iterator[tuple[str, AbstractBlock]]:
    """The names and trial blocks of an effect's shape, and before it of the special case that
    may suffice: of two modes each alone."""
    effect, shape = EFFECTS[stage.effect], stage.shape
    if effect.special_case:
        special = EFFECTS[effect.special_case]
        yield special.name, block_of(special, shape, setting)
        other = shape["frequency"] * shape["ratio"]
        second = {"frequency": other, "damping": shape["second_damping"]}
        yield special.name, block_of(special, second, setting)
    yield effect.name, block_of(effect, shape, setting)


def signals_of(preparation: Preparation) -> list[Signal]:
    """What path curves need of prepared recordings; where the noise is not known, white noise of
    the level of the response's second differences."""
    takes = preparation.takes
    levels = levels_of_residuals(
        [Residual(t.recording.response, t.used, t.recording) for t in takes]
    )
    noises = [t.noise or level for t, level in zip(takes, levels, strict=True)]
    signals = []
    for take, problem, noise in zip(takes, preparation.problems(), noises, strict=True):
        samples = len(take.recording)
        weights = np.array(problem.weights[:samples])
        weights[: noise.filter.size - 1] = 0.0
        recording = take.recording
        drive, drive_error = denoised(recording.drive)
        signals.append(
            Signal(
                drive=drive,
                response=recording.response,
                step=recording.dt,
                periodic=take.history == "periodic",
                taps=noise.whitening,
                weights=weights,
                drive_error=drive_error,
            )
        )
    return signals


def path_view(preparation: Preparation) -> tuple[PathView, Preparation]:
    """The posterior over dynamics under path curves, and the preparation whose noise, where it was
    not known, is what the curves leave: path states that are met again show it."""
    share = _OF_NOISE if preparation.has_unknown_noise else _OF_PATH
    view = view_of(signals_of(preparation), part_of_time(share))
    if not preparation.has_unknown_noise:
        return view, preparation
    takes = preparation.takes
    ends = np.cumsum([len(take.recording) for take in takes])[:-1]
    residuals = [
        Residual(part, take.used, take.recording, spent)
        for part, take, spent in zip(np.split(view.residual, ends), takes, view.spent, strict=True)
    ]
    read = [replace(noise, is_leftover=False) for noise in residual_noises(residuals)]
    noises = [take.noise or noise for take, noise in zip(takes, read, strict=True)]
    preparation = preparation.with_noises(noises)
    again = view_of(signals_of(preparation), part_of_time(_OF_PATH))
    if max(float(spent.mean()) for spent in view.spent) > MOST_SPENT:
        # Curves that have as much freedom as there are samples show no effect beside them either.
        alone = [h for h in again.posterior.hypotheses if not h.names]
        again = replace(again, posterior=Posterior.of(alone))
    return again, preparation


def with_residual_as_noise(fitted: Fitted) -> Preparation | None:
    """The preparation whose noises are what a model leaves of each recording, where that is no more
    than the noise in level but of another colour: a short rest shows a level and hardly a colour.
    None where nothing changes."""
    takes = fitted.preparation.takes
    white = fitted.whitened(fitted.error)[fitted.counted]
    if np.mean(white**2) <= ADEQUATE:
        return None
    noises = []
    for take, residual in zip(takes, fitted.residuals, strict=True):
        noise = take.noise
        assert noise is not None  # a diagnosis has one
        level = float(np.std(residual.samples[residual.counted]))
        if noise.method != "static" or level**2 > (1 + 3 * noise.doubt()) * noise.sigma**2:
            return None
        (read,) = residual_noises([residual])
        noises.append(replace(read, is_leftover=False, method=noise.method))
    return fitted.preparation.with_noises(noises)


def with_all_as_noise(fitted: Fitted) -> Fitted | None:
    """The same fit where all that it leaves is noise of that colour.  None where something else
    tells the noise, or where what is left then still depends on anything: on the time, the drive or
    its past, or on a frequency more than its colour says."""
    takes = fitted.preparation.takes
    if any(take.noise is None or take.noise.method != "residual" for take in takes):
        return None
    noises = [replace(n, is_leftover=False) for n in noises_below(fitted.residuals)]
    own = replace(fitted, preparation=fitted.preparation.with_noises(noises))
    residual = Places.beside(own.whitened(own.error), own.whitened(own.tangent))
    freedom = freedom_of(own.preparation, own.solved.kurtosis)
    axes = locate(own.preparation, own.problems, residual, freedom)
    tests = [*(axis.p_value for axis in axes), _chance_of_curves(own, residual, freedom)]
    return None if min(tests) * len(tests) < SIGNIFICANCE else own


def _chance_of_curves(fitted: Fitted, residual: Places, freedom: float) -> float:
    """The p-value of what one curve of the drive for each direction explains of a residual: energy
    at a place does not show what changes sign within it."""
    drives = [take.recording.drive for take in fitted.preparation.takes]
    low, high = min(d.min() for d in drives), max(d.max() for d in drives)
    columns = []
    for drive, problem in zip(drives, fitted.problems, strict=True):
        level = (_CURVE - 1) * (drive - low) / max(high - low, 1e-300)
        hats = np.maximum(1 - np.abs(level[:, None] - np.arange(_CURVE)), 0.0)
        rising = np.gradient(drive)[:, None] > 0
        own = np.concatenate([hats * rising, hats * ~rising], axis=1)
        columns.append(np.pad(own, ((0, len(problem.response) - drive.size), (0, 0))))
    basis = orthonormal_basis(residual.project(fitted.whitened(np.concatenate(columns)).T).T)
    along, count = basis.T @ residual.whitened, int(np.count_nonzero(fitted.counted))
    energy = max(float(residual.whitened @ residual.whitened) / count, 1.0)
    return float(fdtrc(basis.shape[1], freedom, along @ along / basis.shape[1] / energy))


def _apart() -> dict[str, set[str]]:
    """Effects that are not combined: those of one family, and one whose model is another's with
    some parameters zero."""
    barred = apart()
    for effect in EFFECTS.values():
        if effect.special_case:
            barred.setdefault(effect.name, set()).add(effect.special_case)
            barred.setdefault(effect.special_case, set()).add(effect.name)
    return barred
