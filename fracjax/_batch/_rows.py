"""What is done to each recording of a batch, and the row that comes of it."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Generator
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import equinox as eqx
import numpy as np
import pyarrow as pa

from .._fit import Fit, fit, shape_of
from .._models import Model, as_model
from .._prepare import HistoryOption, ModelOptions, apply_options, free_parameters_of, model_of
from .._recording import InputError, Recording
from ._jobs import Job

SCHEMA = "fracjax.batch/1"
STATUSES = ("fitted", "not converged", "unreadable", "failed")
SETTINGS = b"fracjax.settings"
_VERSION = version("fracjax")
_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}

Row = dict[str, Any]
Rows = Generator[list[Row], None, None]
"""Rows as they are done, some at a time."""


@dataclass(frozen=True)
class Work:
    """What is done to every recording alike.

    A model's name is made a model for each recording anew, with effects of the size that suits it.
    `settling`: samples, or a time such as "1 s"; `columns`: the options of `read`; `asked`: other
    keywords of `fit`, where they ask for something.
    """

    model: Model | str
    history: HistoryOption | None
    settling: int | str | None
    starts: int
    seed: int
    columns: dict[str, Any] = field(default_factory=dict)
    asked: dict[str, Any] = field(default_factory=dict)

    def typical(self) -> Model:
        """The model, or one of its name for a stack of common size."""
        return as_model(self.model)

    def model_for(self, recording: Recording) -> Model:
        return model_of(self.model, [recording])

    def settings(self) -> dict[str, str]:
        """All that a row depends on beside its recording, as text, by name."""
        given = {name: value for name, value in self.columns.items() if value is not None}
        with np.printoptions(precision=17, threshold=sys.maxsize):
            exact = eqx.tree_pformat(self.typical(), short_arrays=False)
            wishes = {
                name: " ".join(eqx.tree_pformat(wish, short_arrays=False).split())
                for name, wish in self.asked.items()
            }
        return {
            "schema": SCHEMA,
            "model": self.typical().name,
            "model made by": "name" if isinstance(self.model, str) else "values",
            "model's values": hashlib.sha256(exact.encode()).hexdigest()[:12],
            "history": self.history or "auto",
            "settling": "auto" if self.settling is None else str(self.settling),
            "starts": str(self.starts),
            "seed": str(self.seed),
            **{name: str(value) for name, value in given.items()},
            **wishes,
        }

    def labels(self) -> tuple[str, ...]:
        """What is fitted, by name.  Raises InputError where what is asked makes no sense."""
        shape_of(self.asked.get("loss", "least_squares"))
        of_model = {n: w for n, w in self.asked.items() if n in ModelOptions.__annotations__}
        block, conditions = apply_options(self.typical(), **of_model)
        return free_parameters_of(block, 1, conditions).labels

    def blank(self) -> Row:
        """The row of a recording that was not fitted: every column, in order."""
        model = self.typical()
        row = {
            **dict.fromkeys(("source", "status", "reason"), ""),
            "samples": 0,
            "step_s": np.nan,
            **dict.fromkeys(("drive_unit", "response_unit"), ""),
        }
        for label in self.labels():
            row |= dict.fromkeys((f"{label}.value", f"{label}.standard_error"), np.nan)
            row |= dict.fromkeys((f"{label}.low", f"{label}.high"), np.nan)
            row |= {f"{label}.unit": "", f"{label}.identified": False, f"{label}.at_bound": False}
        return row | {
            "known_only_together": "",
            **dict.fromkeys(("rmse", "e_r", "nrmse_percent", "r_squared", "bic"), np.nan),
            "noise_sigma": np.nan,
            "noise_method": "",
            "offset": np.nan,
            "history": "",
            "settling_samples": 0,
            "oversampling": 0,
            "converged": False,
            "model": model.name,
            "fracjax_version": _VERSION,
            "schema": SCHEMA,
            "key": "",
            "digest": "",
        }

    def table_schema(self) -> pa.Schema:
        """The columns' types, and the settings as metadata."""
        columns = [(name, _TYPES[type(value)]) for name, value in self.blank().items()]
        return pa.schema(columns, {SETTINGS: json.dumps(self.settings()).encode()})


def row_of(job: Job, work: Work) -> Row:
    """Read and fit one recording; whatever goes wrong becomes the row's reason."""
    row = work.blank() | {"source": job.source, "key": job.key, "digest": job.digest()}
    try:
        recording = job.recording(work.columns)
    except Exception as error:
        return row | {"status": "unreadable", "reason": sentence(error)}
    row |= {
        "samples": len(recording),
        "step_s": recording.dt,
        "drive_unit": recording.drive_unit,
        "response_unit": recording.response_unit,
    }
    try:
        found = fit(
            work.model_for(recording),
            recording,
            history=work.history,
            settling=work.settling,
            starts=work.starts,
            seed=work.seed,
            **work.asked,
        )
    except Exception as error:
        return row | {"status": "failed", "reason": sentence(error)}
    return row | _figures(found)


def lost_row(job: Job, work: Work, reason: str) -> Row:
    """The row of a recording whose fit never came back."""
    told = {"source": job.source, "key": job.key, "digest": job.digest()}
    return work.blank() | told | {"status": "failed", "reason": reason}


def sentence(error: Exception) -> str:
    """What went wrong in one line, with the kind of error where it is not one of ours."""
    text = " ".join(str(error).split())
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"


def _figures(found: Fit) -> Row:
    """A fit in one row."""
    told = found.to_dict()
    row: Row = {"status": "fitted", "reason": "", "converged": told["converged"]}
    if not told["converged"]:
        told_so = "the fit did not converge; the row holds its best point."
        row |= {"status": "not converged", "reason": told_so}
    for label, estimate in told["parameters"].items():
        row |= {f"{label}.{name}": value for name, value in estimate.items()}
    return (
        row
        | told["scores"]
        | told["assumptions"][0]
        | {
            "known_only_together": "; ".join(told["known_only_together"]),
            "noise_sigma": told["noise"]["sigma"],
            "noise_method": told["noise"]["method"],
            "offset": told["offsets"][0],
            "oversampling": told["oversampling"],
        }
    )
