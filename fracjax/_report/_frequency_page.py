"""The report of fits to a frequency response."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._frequency import FrequencyFit
from ._fit_figures import bode_plot
from ._text import download, file_name, frequency_figures, frequency_sentence, parameter_rows

_MOST_MODELS = 4
"""Most models drawn, as many as there are colours."""


def frequency_content(fits: Sequence[FrequencyFit]) -> dict[str, Any]:
    """The content of the report of fits to one frequency response, best first."""
    headers, rows = frequency_figures(fits)
    converged = all(fit.converged for fit in fits)
    return {
        "title": f"Frequency response of {Path(fits[0].table.source).name}",
        "sentence": frequency_sentence(fits),
        "badge": "converged" if converged else "not converged",
        "verdict": "none" if converged else "unexplained",
        "headers": headers,
        "rows": rows,
        "facts": [],
        "diagnosis": None,
        "bode": bode_plot(fits[:_MOST_MODELS]),
        "recordings": [],
        "omitted": 0,
        "layers": [],
        "scripts": "",
        "residual_tests": [],
        "models": [
            {
                "name": fit.model.name,
                "estimates": parameter_rows(fit),
                "profiles": None,
                "correlated": fit.correlated,
                "assumptions": [
                    "The model is linear and was fitted to amplitude and phase in steady state."
                ],
            }
            for fit in fits
        ],
        "warnings": [
            f"The fit of {f.model.name} did not converge." for f in fits if not f.converged
        ],
        "downloads": [
            download(f"fit_{file_name(fit.model.name)}.json", fit.to_dict()) for fit in fits
        ],
    }
