"""What is done to each recording of a batch, and the resulting row."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Generator, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from importlib.metadata import version
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
import pyarrow as pa

from .._fit import Fit, Outcome, fit, fit_all, shape_of
from .._models import MODELS, SIZED, Model, as_model
from .._prepare import HistoryOption, ModelOptions, apply_options, free_parameters_of, model_of
from .._recording import InputError, Recording
from .._solve import LEAST_STARTS, can_stack
from ._jobs import Job

SCHEMA = "fracjax.batch/2"
STATUSES = ("fitted", "not converged", "unreadable", "failed")
SETTINGS = b"fracjax.settings"
_STACK, _ALONE = 64, 4
"""Recordings that are fitted together: enough that Python takes little of the time, few enough to
be shared out evenly; and the same where each is fitted by itself.  Chosen by judgement."""
_MOST_SAMPLES = 2**19
"""Samples of all recordings that are fitted together, above which they are fewer; this limits
memory.  Chosen by judgement."""
_VERSION = version("fracjax")
_TYPES = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}

Row = dict[str, Any]
Rows = Generator[list[Row], None, None]
"""Rows as they are finished, in groups."""


@dataclass(frozen=True)
class Work:
    """What is done to every recording alike.

    `model` may be a name, which is made into a model for each recording, with effects of suitable
    size.  `settling` is in samples, or a time such as "1 s"; `columns` are the options of `read`;
    `options` are other keywords of `fit` that differ from their defaults.
    """

    model: Model | str
    history: HistoryOption | None
    settling: int | str | None
    starts: int
    seed: int
    columns: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def typical(self) -> Model:
        """The model; of a name, the one for an actuator of typical size."""
        return as_model(self.model)

    def model_for(self, recording: Recording) -> Model:
        """The model for one recording; effects and play operators have a size of their own for
        each."""
        if not isinstance(self.model, str) or self.model in MODELS.keys() - SIZED.keys():
            return self.typical
        return model_of(self.model, [recording])

    @property
    def task(self) -> int:
        """Recordings sent to a worker at once, which are fitted again one by one if it dies."""
        return _STACK if self.is_stacked else _ALONE

    @cached_property
    def is_stacked(self) -> bool:
        """Whether recordings alike are fitted together: where `fit` solves a stack of one."""
        return self.starts >= LEAST_STARTS and can_stack(self.typical.block)

    def settings(self) -> dict[str, str]:
        """Everything but the recording that a row depends on, as text, by name."""
        read_options = {name: value for name, value in self.columns.items() if value is not None}
        with np.printoptions(precision=17, threshold=sys.maxsize):
            model_text = eqx.tree_pformat(self.typical, short_arrays=False)
            fit_options = {
                name: " ".join(eqx.tree_pformat(value, short_arrays=False).split())
                for name, value in self.options.items()
            }
        return {
            "schema": SCHEMA,
            "model": self.typical.name,
            "model made by": "name" if isinstance(self.model, str) else "values",
            "model's values": hashlib.sha256(model_text.encode()).hexdigest()[:12],
            "history": self.history or "auto",
            "settling": "auto" if self.settling is None else str(self.settling),
            "starts": str(self.starts),
            "seed": str(self.seed),
            **{name: str(value) for name, value in read_options.items()},
            **fit_options,
        }

    @cached_property
    def labels(self) -> tuple[str, ...]:
        """Labels of the free parameters.

        Raises:
            InputError: The options contradict each other or the model.
        """
        shape_of(self.options.get("loss", "least_squares"))
        of_model = {
            name: value
            for name, value in self.options.items()
            if name in ModelOptions.__annotations__
        }
        block, conditions = apply_options(self.typical, **of_model)
        return free_parameters_of(block, 1, conditions).labels

    def blank(self) -> Row:
        """The row of a recording that was not fitted: every column, in order."""
        return self._blank.copy()

    @cached_property
    def _blank(self) -> Row:
        """The row that `blank` copies."""
        model = self.typical
        row = {
            **dict.fromkeys(("source", "status", "reason"), ""),
            "samples": 0,
            "step_s": np.nan,
            **dict.fromkeys(("drive_unit", "response_unit"), ""),
        }
        for label in self.labels:
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
            "stacked": False,
            "model": model.name,
            "fracjax_version": _VERSION,
            "schema": SCHEMA,
            "key": "",
            "digest": "",
        }

    def table_schema(self) -> pa.Schema:
        """The types of the columns, and the settings as metadata."""
        columns = [(name, _TYPES[type(value)]) for name, value in self.blank().items()]
        return pa.schema(columns, {SETTINGS: json.dumps(self.settings()).encode()})


class _Read(NamedTuple):
    """A recording that waits to be fitted, with the row that its fit completes."""

    row: Row
    recording: Recording
    model: Model


def rows_of(jobs: Sequence[Job], work: Work) -> list[Row]:
    """Read and fit recordings, those alike together; any failure becomes the row's reason."""
    rows: list[Row] = []
    waiting: list[_Read] = []
    for job in jobs:
        row, recording = _read(job, work)
        rows.append(row)
        if recording is None:
            continue
        try:
            waiting.append(_Read(row, recording, work.model_for(recording)))
        except Exception as error:
            row.update(status="failed", reason=one_line(error))
        if sum(len(each.recording) for each in waiting) > _MOST_SAMPLES:
            _complete(waiting, work)
            waiting = []
    _complete(waiting, work)
    return rows


def _complete(waiting: Sequence[_Read], work: Work) -> None:
    """Fit recordings, and complete their rows."""
    options = {"history": work.history, "settling": work.settling, "starts": work.starts,
               "seed": work.seed, **work.options}  # fmt: skip
    if work.is_stacked:
        models, recordings = [each.model for each in waiting], [each.recording for each in waiting]
        outcomes = fit_all(models, recordings, **options)
    else:
        outcomes = [_alone(each, options) for each in waiting]
    for each, (fitted, stacked) in zip(waiting, outcomes, strict=True):
        if isinstance(fitted, Exception):
            each.row.update(status="failed", reason=one_line(fitted))
        else:
            each.row.update(_values_of_fit(fitted), stacked=stacked)


def _alone(each: _Read, options: dict[str, Any]) -> Outcome:
    """The fit of a recording by itself."""
    try:
        return Outcome(fit(each.model, each.recording, **options))
    except Exception as error:
        return Outcome(error)


def _read(job: Job, work: Work) -> tuple[Row, Recording | None]:
    """The row of a recording before its fit, and the recording; None where it cannot be read."""
    row = work.blank() | {"source": job.source, "key": job.key, "digest": job.digest()}
    try:
        recording = job.recording(work.columns)
    except Exception as error:
        return row | {"status": "unreadable", "reason": one_line(error)}, None
    return row | {
        "samples": len(recording),
        "step_s": recording.dt,
        "drive_unit": recording.drive_unit,
        "response_unit": recording.response_unit,
    }, recording


def lost_row(job: Job, work: Work, reason: str) -> Row:
    """The row of a recording whose fit did not return."""
    identity = {"source": job.source, "key": job.key, "digest": job.digest()}
    return work.blank() | identity | {"status": "failed", "reason": reason}


def one_line(error: Exception) -> str:
    """An error as one line, preceded by its type unless it is an InputError."""
    text = " ".join(str(error).split())
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"


def _values_of_fit(result: Fit) -> Row:
    """The columns of a row that come from a fit."""
    row: Row = {"status": "fitted", "reason": "", "converged": result.converged}
    if not result.converged:
        reason = "the fit did not converge; the row holds its best point."
        row |= {"status": "not converged", "reason": reason}
    for estimate in result.estimates:
        row |= {f"{estimate.name}.{name}": value for name, value in estimate.to_dict().items()}
    (take,) = result.preparation.takes
    assert take.noise is not None  # every fit ends with a noise model
    return (
        row
        | asdict(result.scores)
        | {
            "history": take.history,
            "settling_samples": take.settling,
            "known_only_together": "; ".join(result.correlated),
            "noise_sigma": take.noise.sigma,
            "noise_method": take.noise.method,
            "offset": result.offsets[0],
            "oversampling": result.preparation.oversampling,
        }
    )
