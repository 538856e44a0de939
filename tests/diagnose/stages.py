"""A stage with effects, and what a round judges of them."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._judgement import Judged
from fracjax._diagnose._refit import Refit
from fracjax._diagnose._stage import Layer, Stage, wrapped
from fracjax._parameters import set_values
from fracjax._prepare import prepare
from fracjax._solve import solve_from
from tests.diagnose.helpers import CONVINCING
from tests.helpers import specified

STEP = 5e-3
TIMES = STEP * np.arange(600)
DRIVE = 50 - 40 * np.cos(2 * np.pi * TIMES) * np.linspace(1, 0.4, TIMES.size)
NOISE = 0.003 * np.random.default_rng(5).standard_normal(TIMES.size)


def stage_of(names: tuple[str, ...]) -> Stage:
    """LFDH with effects, fitted to a recording that has electrostriction and a lag."""
    truth = fj.parse_model("electrostriction >> lfdh >> drive_lag").block
    truth = set_values(truth, {"second.time_constant": 0.02})
    response = fj.simulate(fj.Model(truth), DRIVE, STEP, "constant").response
    recording = fj.Recording(DRIVE, response + NOISE * np.ptp(response), STEP, "V", "um")
    sigma = 0.003 * float(np.ptp(response))
    told = specified(sigma)
    preparation = prepare([recording], history="constant", noise=told)
    setting = preparation.setting
    base = fj.parse_model("lfdh", setting).block
    layers = tuple(Layer(EFFECTS[n], EFFECTS[n].trials(setting)[0]) for n in names)
    block = wrapped(base, [(layer, layer.trial) for layer in layers])
    return Stage("lfdh", base, layers, solve_from([block], preparation))


NOTHING: Any = None
JUDGED = Judged(
    refit=NOTHING,
    delta_bic=1.0,
    altogether=1.0,
    spared=0.0,
    conceded=0.0,
    explained=1.0,
    numerics=0.0,
    gain=CONVINCING,
    predicts_worse=False,
    prediction=NOTHING,
    predict=NOTHING,
    plausible=True,
)


def judged(stage: Stage, name: str) -> Judged:
    """An effect fitted outermost on a stage, as a round judges it."""
    layer = Layer(EFFECTS[name], EFFECTS[name].trials(stage.preparation.setting)[0])
    solved = solve_from([layer.effect.insert(stage.solved.block, layer.trial)], stage.preparation)
    score: Any = SimpleNamespace(effect=layer.effect, trials=[layer.trial], best=0)
    return replace(
        JUDGED,
        refit=Refit(score, solved),
        delta_bic=stage.solved.bic - solved.bic,
        altogether=stage.solved.bic - solved.bic,
        prediction=SimpleNamespace(),  # type: ignore[arg-type]
        predict=lambda *_: SimpleNamespace(),  # type: ignore[arg-type, return-value]
    )


def cost_of(cost: float, bic: float = 0.0) -> Any:
    left = max(1.0, cost / 1000)
    return SimpleNamespace(
        cost=cost, samples=1000, excess_ratio=left, kurtosis=3.0, bic=bic, preparation=known()
    )


def known() -> Any:
    """Recordings of a noise without doubt."""
    noise = SimpleNamespace(doubt=lambda _: 0.0)
    return SimpleNamespace(takes=[SimpleNamespace(noise=noise)])


def fine_judged(name: str, gained: float, plausible: bool, left: float = 1.0) -> Judged:
    solved = SimpleNamespace(gained=gained, bic=-gained * left, cost=-gained * left, samples=0.0)
    layer = SimpleNamespace(effect=SimpleNamespace(name=name, special_case=""))
    refit: Any = SimpleNamespace(name=name, solved=solved, layer=layer)
    return replace(JUDGED, refit=refit, delta_bic=gained, altogether=gained, plausible=plausible)
