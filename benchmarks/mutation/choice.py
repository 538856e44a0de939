"""Which tests a mutant has to survive: those that reach its file, the likeliest to notice it first.

Told by hand: coverage would name, for what JAX traces, only the test that traced it first.  A
survivor may yet be noticed by tests that are not run here (blocks, own models, batch, posterior,
compensation, report, command line).
"""

from __future__ import annotations

from pathlib import PurePath

_PREPARE = ("prepare/weights", "prepare/conditions", "prepare/history", "prepare/noise")
_FITS = (
    "fit/fit",
    "fit/uncertainty",
    "fit/combinations",
    "fit/robust",
    *_PREPARE[:3],
    "solve/starts",
    "solve/step",
    "fit/profile",
)
_SEARCHES = ("solve/compressed", "crosscheck/crosscheck", *_FITS)
_DIAGNOSES = (
    "diagnose/selection",
    "diagnose/gram",
    "diagnose/held_out",
    "diagnose/sentence",
    "diagnose/diagnose",
)
_CROSSCHECK = ("crosscheck/crosscheck", "crosscheck/searches", "crosscheck/box")
_STEPS = ("solve/least_squares", "solve/starts", *_FITS, "solve/compressed")
_OPERATORS = ("operators/convolution_quadrature", "operators/rate", "operators/grid")

# By folder, and by the files that have tests of their own.
_FOLDERS = {
    "_operators": (*_OPERATORS, "operators/definitions", "operators/responses", *_FITS),
    "_prepare": (*_PREPARE, "prepare/noise_sources", *_FITS, "diagnose/diagnose"),
    "_solve": _STEPS,
    "_fit": _FITS,
    "_frequency": ("frequency/frequency_fit", "frequency/creep_identification"),
    "_crosscheck": _CROSSCHECK,
    "_diagnose": ("diagnose/nuisance", "diagnose/places", *_DIAGNOSES),
}
_FILES = {
    "_definitions": ("operators/definitions",),
    "_oustaloup": ("operators/definitions",),
    "_amplitude_ratios": ("frequency/creep_identification",),
    "_bounded": _CROSSCHECK,
    "_box": ("crosscheck/box", *_CROSSCHECK[:2], "solve/compressed"),
    "_chains": _SEARCHES,
    "_combinations": ("fit/combinations", "fit/fit", "fit/profile"),
    "_compare": ("fit/profile", "fit/robust"),
    "_compressed": _SEARCHES,
    "_conditions": ("prepare/conditions", *_FITS),
    "_creep_identification": ("frequency/creep_identification",),
    "_crosscheck": _CROSSCHECK,
    "_evolution": ("crosscheck/searches", "crosscheck/crosscheck"),
    "_frequency_fit": ("frequency/frequency_fit", "frequency/creep_identification"),
    "_frequency_table": ("frequency/frequency_fit", "frequency/creep_identification"),
    "_interpolation": _SEARCHES,
    "_layout": ("solve/compressed", *_FITS),
    "_least_squares": ("solve/least_squares", *_SEARCHES),
    "_noise": ("prepare/noise", "prepare/noise_sources", *_FITS, "diagnose/diagnose"),
    "_numerics": ("solve/step", "solve/numerics", "diagnose/diagnose"),
    "_preparation": (*_FITS, "prepare/noise", "diagnose/diagnose"),
    "_problem": ("prepare/noise", *_FITS, "solve/compressed"),
    "_profile": ("fit/profile",),
    "_residuals": ("fit/residuals",),
    "_robust": ("fit/robust", *_FITS),
    "_search": _SEARCHES,
    "_solve": _STEPS,
    "_span": _SEARCHES,
    "_spelling": ("fit/spelling", "cli/fit"),
    "_swarm": ("crosscheck/searches", "crosscheck/crosscheck"),
    "_colour": ("diagnose/colour", *_DIAGNOSES),
    "_held_out": ("diagnose/held_out", *_DIAGNOSES),
    "_nuisance": ("diagnose/nuisance", *_DIAGNOSES),
    "_places": ("diagnose/places", *_DIAGNOSES),
    "_sentence": ("diagnose/sentence", *_DIAGNOSES),
    "_next_experiment": ("diagnose/next_experiment", *_DIAGNOSES),
}


def tests_of(file: str) -> list[str]:
    """The files of tests to run, in order."""
    path = PurePath(file)
    names = _FILES.get(path.stem) or _FOLDERS[path.parent.name]
    folders = (name.split("/") for name in dict.fromkeys(names))
    return [f"tests/{folder}/test_{name}.py" for folder, name in folders]
