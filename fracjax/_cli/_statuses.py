"""The exit statuses, and the sentence printed with each."""

from __future__ import annotations

import shutil
import sys
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .._fit import Fit
    from .._frequency import FrequencyFit

UNUSABLE, NOT_CONVERGED, INTERRUPTED = 2, 3, 130


def fail(sentence: str, status: int) -> int:
    """Print a sentence on stderr and return the status."""
    if sys.stderr.isatty():
        width = shutil.get_terminal_size().columns
        sentence = textwrap.fill(sentence, width, break_long_words=False, break_on_hyphens=False)
    print(sentence, file=sys.stderr)
    return status


def status_of(fits: Sequence[Fit | FrequencyFit], out: Path | None) -> int:
    """The exit status: 3, with a sentence on stderr, if a fit did not converge, else 0."""
    failed = [fit.model.name for fit in fits if not fit.converged]
    if not failed:
        return 0
    place = "is in the table, and nothing was saved" if out is None else f"was saved in {out}"
    return fail(
        f"The fit of {' and '.join(failed)} did not converge; its best point {place}.",
        NOT_CONVERGED,
    )
