"""Judged candidates and their stages, made up."""

from types import SimpleNamespace
from typing import Any

import numpy as np

import fracjax as fj
from fracjax._diagnose._held_out import Gain
from fracjax._diagnose._judgement import Judged
from fracjax._recording import Recording


def recording_of(case) -> Recording:
    step = float(case.time[1] - case.time[0])
    return Recording(case.voltage, case.displacement, step)


STEP = 2e-3
CYCLES = 12
TIMES = STEP * np.arange(CYCLES * 500)
TONE = 50 - 40 * np.cos(2 * np.pi * TIMES)


def creeping(noise: np.ndarray) -> Recording:
    """A law that the model creep holds exactly, under some noise."""
    law = fj.simulate(fj.parse_model("creep"), TONE, STEP, "constant").response
    return Recording(TONE, law + noise, STEP, "V", "um")


CONVINCING = Gain(
    100.0,
    1.0,
    1.0,
    predicted_folds=(True,),
    base_rmse=2.0,
    extended_rmse=1.0,
    chi_square_per_sample=1.0,
)


def judged_of(
    name: str,
    delta_bic: float,
    *,
    plausible: bool = True,
    gain: Gain = CONVINCING,
    spared: float = 0.0,
    conceded: float = 0.0,
    before: float = 0.0,
    predicts_worse: bool = False,
    left: float = 0.0,
    special_case: str = "",
) -> Judged:
    unseen: Any = None
    refit: Any = SimpleNamespace(
        name=name,
        solved=SimpleNamespace(cost=left, samples=0.0),
        layer=SimpleNamespace(effect=SimpleNamespace(special_case=special_case)),
    )
    return Judged(
        refit=refit,
        delta_bic=delta_bic,
        altogether=before + delta_bic,
        spared=spared,
        conceded=conceded,
        explained=1.0,
        numerics=0.0,
        gain=gain,
        predicts_worse=predicts_worse,
        prediction=unseen,
        predict=unseen,
        plausible=plausible,
    )


def known_to(doubt: float) -> Any:
    """A preparation whose second recording's noise level is known to a share."""
    less, more = (SimpleNamespace(doubt=lambda _, d=d: d) for d in (doubt / 2, doubt))
    return SimpleNamespace(takes=[SimpleNamespace(noise=n) for n in (less, more, None)])


def ended_at(cost: float, excess: float = 0.0, doubt: float = 0.1, free: int = 3) -> Any:
    left = max(1.0, cost / 1000)
    solved = SimpleNamespace(cost=cost, samples=1000, excess_ratio=left, kurtosis=3.0, free=free)
    solved.preparation = known_to(doubt)
    return SimpleNamespace(solved=solved, preparation=solved.preparation, excess=excess)
