"""A loop on disk, and what a command leaves."""

from pathlib import Path

import numpy as np

from fracjax._diagnose import Axis, Candidate, Diagnosis, HeldOut
from fracjax._fit import Fit
from fracjax._report._text import noise_of

STEP = 0.01
FOLDER = Path("results")


def diagnosis_of(fitted: Fit) -> Diagnosis:
    """A diagnosis that found nothing."""
    return Diagnosis(
        verdict="none",
        sentence="Model and recording agree.",
        base=fitted,
        extended=None,
        effects=(),
        candidates=(Candidate("delay", "drive", 1.0, -1.0, 0.1, 0.5, "no need"),),
        axes=(Axis("time", "s", np.arange(5.0), np.ones(4), 3.0, (), 0.5),),
        where="The residual does not exceed the noise anywhere.",
        noise=noise_of(fitted),
        numerics=0.01,
        p_value=0.4,
        held_out=HeldOut("stretches set aside in turn", 0.1, None, (0.1,), (), ""),
        next_experiment=None,
        warnings=(),
    )


def written() -> set[str]:
    return {path.name for path in FOLDER.iterdir()}
