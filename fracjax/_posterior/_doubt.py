"""What a diagnosis says of the model that a posterior is of."""

from __future__ import annotations

import json
from pathlib import Path

from .._recording import InputError

_SCHEMA = "fracjax.diagnosis/1"


def doubt_of(path: str | Path, model: str) -> str:
    """One sentence about what the model leaves unexplained; nothing where the verdict is `none`.

    From the plain data of a diagnosis.json, which knows nothing of posteriors.
    Raises InputError for what is no diagnosis, or one of another model.
    """
    where = str(path)
    try:
        told = json.loads(Path(path).read_text(encoding="utf-8"))
        if told["schema"] != _SCHEMA:
            raise KeyError(told["schema"])
        verdict, diagnosed = told["verdict"], told["model"]
        names = [name for e in told["effects"] for name in (e["name"], *e["confusable_with"])]
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
    what = joint.join(dict.fromkeys(names)) or "part of the response"
    return f"The model leaves {what} unexplained; intervals hold only if the model is right."
