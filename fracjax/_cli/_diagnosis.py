"""What `fracjax diagnose` and `fracjax demo` share: a diagnosis saved and told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._jax import prepare_jax
from ._results import Results, Summary
from ._statuses import status_of
from ._tables import doubts

if TYPE_CHECKING:
    from .._diagnose import Diagnosis
    from .._fit import Fit
    from .._models import Model
    from .._recording import Recording
    from .._solve import Progress


def diagnosed(
    model: Model,
    recordings: list[Recording],
    out: Path,
    results: Results,
    progress: Progress,
    **options: Any,
) -> Diagnosis:
    """The diagnosis, saved in the folder `out`."""
    from .._diagnose import diagnose
    from .._io import column_name, write
    from .._report import write_report

    prepare_jax()
    diagnosis = diagnose(model, recordings, progress=progress, **options)
    progress("writing the report")
    results.save(diagnosis.save, out / "diagnosis.json")
    results.save((diagnosis.extended or diagnosis.base).save, out / "fit.json")
    if diagnosis.next_experiment:
        drive = diagnosis.next_experiment.drive
        head = column_name("drive", diagnosis.base.preparation.takes[0].recording.drive_unit)
        write(out / "next_experiment.csv", {"time_s": drive.times, head: drive.values})
        results.saved.append(out / "next_experiment.csv")
    results.save(lambda path: write_report(diagnosis, path), out / "report.html")
    return diagnosis


def concluded(diagnosis: Diagnosis, out: Path, results: Results) -> int:
    """Tell of a diagnosis and return the exit status."""
    fits = [diagnosis.base] + ([diagnosis.extended] if diagnosis.extended else [])
    results.tell(diagnosis.to_dict, lambda: _summary(diagnosis, fits))
    return status_of(fits, out)


def _summary(diagnosis: Diagnosis, fits: list[Fit]) -> Summary:
    from .._report import key_figures

    notes = [diagnosis.where, *(note for found in fits for note in doubts(found))]
    if diagnosis.next_experiment:
        notes.append(f"Next: {diagnosis.next_experiment.sentence}")
    return Summary(diagnosis.sentence, key_figures(diagnosis), notes)
