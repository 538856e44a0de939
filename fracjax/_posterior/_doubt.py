"""What a diagnosis of the model says about its intervals."""

from __future__ import annotations

import json
from pathlib import Path

from .._fit import Fit
from .._recording import InputError

_SCHEMA = "fracjax.diagnosis/1"


def misfit_of(fit: Fit) -> str:
    """One sentence about why the model does not describe the recording; empty where it does."""
    if not fit.shortcomings:
        return ""
    return (
        f"The model does not describe {fit.preparation.takes[0].recording.source}: "
        f"{', and '.join(fit.shortcomings)}; intervals hold only if the model is right."
    )


def doubt_of(path: str | Path, model: str) -> str:
    """One sentence about what the model leaves unexplained; empty if the verdict is `none`.

    It is made from the plain data of a diagnosis.json, which does not depend on posteriors.

    Raises:
        InputError: The file is no diagnosis, or a diagnosis of another model.
    """
    where = str(path)
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != _SCHEMA:
            raise KeyError(content["schema"])
        verdict, diagnosed = content["verdict"], content["model"]
        names = [name for e in content["effects"] for name in (e["name"], *e["confusable_with"])]
    except (OSError, KeyError, TypeError, ValueError):
        raise InputError.at(
            where, f'a diagnosis (schema "{_SCHEMA}")', "something else", "run `fracjax diagnose`"
        ) from None
    if diagnosed != model:
        raise InputError.at(
            where, f"a diagnosis of {model}", f"one of {diagnosed}", "diagnose this model"
        )
    if verdict == "none":
        return ""
    joint = " or " if verdict == "confusable" else " and "
    mismatch = joint.join(dict.fromkeys(names)) or "part of the response"
    return f"The model leaves {mismatch} unexplained; intervals hold only if the model is right."
