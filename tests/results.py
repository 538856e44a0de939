"""A small fit, and a diagnosis put together by hand, for what shows results."""

from dataclasses import replace

import jax
import numpy as np

from fracjax._blocks import FOH
from fracjax._diagnose import (
    Axis,
    Candidate,
    Diagnosis,
    HeldOut,
    NamedEffect,
    NextExperiment,
)
from fracjax._fit import Estimate, Fit, fit
from fracjax._models import Model
from fracjax._operators import Grid
from fracjax._path import Visible
from fracjax._protocol import Drive, Limits, Part, Protocol
from fracjax._recording import Recording
from fracjax._report._text import noise_of

STEP = 0.01
CYCLE = np.arange(100) / 100
_SHOWS = Visible("creep", 0.02, "um", ""), Visible("delay", None, "um", "it is met once")


def small_fit() -> Fit:
    """FOH fitted to its own response over four periods, with noise."""
    drive = 50 - 45 * np.cos(2 * np.pi * np.tile(CYCLE, 4))
    with jax.enable_x64(True):
        response = np.asarray(FOH(0.05, 0.05)(jax.numpy.asarray(drive), Grid(STEP)))
    noise = np.random.default_rng(1).normal(0, 0.01, drive.size)
    recording = Recording(drive, response + noise, STEP, "V", "um", source="loop <1>.csv")
    return fit(Model(FOH(), "foh"), recording, starts=2)


def diagnosis_of(fitted: Fit) -> Diagnosis:
    """A diagnosis as `diagnose` gives it, put together by hand."""
    names = ("creep", "drive_lag", "resonance", "saturation")
    scores = (12.0, 11.5, 3.0, 0.4)
    return Diagnosis(
        verdict="confusable",
        sentence="foh leaves out creep & <something>, or an effect that this drive cannot "
        "distinguish from it.",
        base=fitted,
        extended=replace(fitted, model=Model(fitted.model.block, "foh >> creep")),
        effects=(
            NamedEffect(
                name="creep",
                site="response",
                probability=0.7,
                explained_fraction=0.95,
                parameters=(Estimate("mu", 0.012, 0.001, "1", True, False),),
                confusable_with=("drive_lag",),
            ),
        ),
        candidates=tuple(
            Candidate(
                name=name,
                site="response",
                score=score,
                log_evidence=score**2 / 2,
                detectable_amplitude=0.01 * (k + 1),
                concealment=0.9 - 0.2 * k,
                reason=f"reason {k}",
                delta_bic=100.0 if k < 2 else None,
            )
            for k, (name, score) in enumerate(zip(names, scores, strict=True))
        ),
        axes=(
            Axis("time", "s", np.linspace(0, 4, 9), np.arange(8.0), 3.5, ((2.0, 4.0),), 1e-20),
            Axis("frequency", "Hz", np.geomspace(0.1, 50, 6), np.ones(5), 3.0, (), 0.4),
            Axis("harmonics", "1", np.arange(5) + 0.5, np.arange(4.0), 2.0, ((2.5, 3.5),), 1e-3),
        ),
        where="The mismatch depends on time, most at 2 to 4 s.",
        noise=noise_of(fitted),
        numerics=0.02,
        p_value=0.0,
        held_out=HeldOut(
            "stretches set aside in turn", 0.03, 0.011, (0.02, 0.04), (0.01, 0.012), ""
        ),
        next_experiment=NextExperiment(
            "Record steps both ways.",
            ("creep", "drive_lag"),
            0.9,
            Drive("steps", np.repeat([0.0, 40.0], 50), 1e-3),
        ),
        warnings=("The response is clipped.",),
        can_show=_SHOWS,
    )


def small_protocol() -> Protocol:
    """A drive of two parts, and what it shows."""
    parts = Part("rest", 0.0, 0.05, "the noise"), Part("fast path", 0.05, 0.1, "lags")
    drive = Drive("a designed drive of 0.1 s", np.repeat([0.0, 40.0], 50), 1e-3, parts)
    limits = Limits(0.0, 40.0, 1e5)
    return Protocol(drive, limits, 100.0, 0.01, 4.0, ("V", "um"), ("creep",), _SHOWS)
