"""Diagnose the third tier's cases by the package's public functions, as its users would.

Of a case it reads the recordings and what cases.json tells: the model, or that there is none, and
the noise's specification where one is given.
"""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..answer import keep, tell_each

if TYPE_CHECKING:
    from fracjax import Diagnosis


def ask(case: dict, exam: Path) -> Diagnosis:
    """The diagnosis of a case's recordings together."""
    import fracjax as fj

    recordings = [fj.read(exam / case["case"] / file) for file in case["files"]]
    model = None if case["believed"] is None else fj.parse_model(case["believed"])
    noise = None if case["noise_um"] is None else f"{case['noise_um']} um"
    return fj.diagnose(model, recordings, noise=noise)


def answer(case: dict, exam: Path, answers: Path) -> str:
    """Diagnose one case; what happened, in a line."""
    return keep(case["case"], answers / case["case"], partial(ask, case, exam))


def answer_all(exam: Path, answers: Path, part: slice, jobs: int) -> None:
    """Answer the cases of a part, a line each."""
    cases = json.loads((exam / "cases.json").read_text())[part]
    tell_each(
        partial(answer, exam=exam, answers=answers),
        [case | {"base": case["believed"] or ""} for case in cases], answers, jobs,
    )  # fmt: skip
