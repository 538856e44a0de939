"""The report: a result as one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from .._recording import InputError, found_in
from ._page import write_page
from ._provenance import provenance

if TYPE_CHECKING:
    from .._compensate import Compensation
    from .._crosscheck import Crosscheck
    from .._diagnose import Diagnosis
    from .._fit import Comparison, Fit
    from .._frequency import FrequencyFit
    from .._posterior import Posterior
    from .._protocol import Protocol
    from .._streaming import Promise

    Reported = (
        Fit | FrequencyFit | Comparison | Diagnosis | Crosscheck | Posterior | Compensation
        | Promise | Protocol
        | Sequence[Fit] | Sequence[FrequencyFit]
    )  # fmt: skip


class _Kind(NamedTuple):
    """How results of a class become a page.

    Attributes:
        home: the module of the function of the page's content.
        content: that function.
        template: the page's template.
    """

    home: str
    content: str
    template: str = "report.html.jinja"


# By name, so that a fit's report does not import the diagnosis, nor the sampler.
_KINDS = {
    "Fit": _Kind("_fit_page", "fit_content"),
    "Comparison": _Kind("_fit_page", "comparison_content"),
    "FrequencyFit": _Kind("_frequency_page", "frequency_content"),
    "Crosscheck": _Kind("_crosscheck_page", "crosscheck_content"),
    "Diagnosis": _Kind("_diagnosis_page", "diagnosis_content"),
    "Posterior": _Kind("_posterior_page", "posterior_content", "posterior.html.jinja"),
    "Protocol": _Kind("_protocol_page", "protocol_content", "protocol.html.jinja"),
    "Compensation": _Kind("_compensation_page", "compensation_content", "compensation.html.jinja"),
    "Promise": _Kind("_promise_page", "promise_content", "promise.html.jinja"),
}
_IN_SEQUENCES = ("Fit", "FrequencyFit")


def write_report(
    result: Reported, path: str | Path, *, command: str | None = None, seed: int | None = None
) -> None:
    """Write a result as one self-contained HTML file.

    Args:
        result: A fit, a cross-check, a comparison, a diagnosis, a posterior, a compensation, a
            protocol or the promise of an inverse in a loop, or a sequence of fits to the same data.
        path: The file to write.
        command: What was called to get the result, which the report states.
        seed: The seed of its random numbers, likewise.

    Raises:
        InputError: When the result is none of these.
    """
    fits = list(result) if isinstance(result, Sequence) else [result]
    names = {type(each).__name__ for each in fits}
    name = names.pop() if len(names) == 1 else ""
    if name not in _KINDS or (isinstance(result, Sequence) and name not in _IN_SEQUENCES):
        raise InputError.at("report", "a result of fracjax", found_in(result), "give one")
    kind = _KINDS[name]
    content_of = getattr(import_module(f".{kind.home}", __package__), kind.content)
    content = content_of(fits if name in _IN_SEQUENCES else result)
    content["provenance"] = provenance(_sources(name, fits[0]), command, seed)
    write_page(kind.template, content, path)


def _sources(name: str, result: Any) -> list[str]:
    """The names of all recordings of a result of a class."""
    match name:
        case "Diagnosis":
            return [*_sources("Fit", result.base), result.held_out.source]
        case "Crosscheck":
            return _sources("Fit", result.fit)
        case "Comparison":
            return _sources("Fit", result.fits[0])
        case "Fit":
            return [take.recording.source for take in result.preparation.takes]
        case "FrequencyFit":
            return [result.table.source]
        case "Protocol":
            return [*result.after]
        case "Posterior":
            return [band.source for band in result.bands]
        case "Promise":
            return []
    return [result.source]
