"""What `fracjax diagnose` and `fracjax demo` share: to save and to print a diagnosis."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._results import Results, Summary
from ._statuses import status_of
from ._tables import fit_notes

if TYPE_CHECKING:
    from .._diagnose import Diagnosis
    from .._fit import Fit
    from .._models import Model
    from .._recording import Recording
    from .._solve import Progress


def diagnose_and_save(
    model: Model | None,
    recordings: list[Recording],
    out: Path,
    results: Results,
    progress: Progress,
    **options: Any,
) -> Diagnosis:
    """The diagnosis, whose files are saved in the folder `out`."""
    from .._diagnose import diagnose
    from .._io import column_name, write

    diagnosis = diagnose(model, recordings, progress=progress, **options)
    progress("writing the report")
    results.save(diagnosis.save, out / "diagnosis.json")
    results.save((diagnosis.extended or diagnosis.base).save, out / "fit.json")
    if diagnosis.next_experiment:
        drive = diagnosis.next_experiment.drive
        header = column_name("drive", diagnosis.base.preparation.takes[0].recording.drive_unit)
        write(out / "next_experiment.csv", {"time_s": drive.times, header: drive.values})
        results.saved.append(out / "next_experiment.csv")
    for number, approximation in enumerate(diagnosis.linear_approximations, 1):
        approximation.table.write(out / f"frequency_response_{number}.csv")
        results.saved.append(out / f"frequency_response_{number}.csv")
    results.save_report(diagnosis, out / "report.html", options.get("seed", 0))
    return diagnosis


def conclude(diagnosis: Diagnosis, out: Path, results: Results) -> int:
    """Print a diagnosis and return the exit status."""
    fits = [diagnosis.base] + ([diagnosis.extended] if diagnosis.extended else [])
    results.show(diagnosis.to_dict, lambda: _summary(diagnosis, fits))
    return status_of(fits, out)


def _summary(diagnosis: Diagnosis, fits: list[Fit]) -> Summary:
    """The verdict, the scores, and what to note: where, about the fits, and the next experiment."""
    from .._report import diagnosis_figures

    notes = [diagnosis.where, *(note for fit in fits for note in fit_notes(fit))]
    if diagnosis.next_experiment:
        notes.append(f"Next: {diagnosis.next_experiment.sentence}")
    return Summary(diagnosis.sentence, diagnosis_figures(diagnosis), notes)
