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
    "diagnose/judgement",
    "diagnose/verdict",
    "diagnose/refit",
    "diagnose/diagnose",
)
_ROUNDS = (
    "diagnose/second_look",
    "diagnose/contenders",
    "diagnose/procedure",
    "diagnose/restarts",
    "diagnose/shortlist",
    "diagnose/unseen_recordings",
    "diagnose/usual_ranges",
    "diagnose/worth_naming",
    "diagnose/noise_beyond",
)
_CROSSCHECK = ("crosscheck/crosscheck", "crosscheck/searches", "crosscheck/box")
_STEPS = ("solve/least_squares", "solve/starts", *_FITS, "solve/compressed", "diagnose/stage")
_OPERATORS = ("operators/convolution_quadrature", "operators/rate", "operators/grid")

# By folder, and by the files that have tests of their own.
_FOLDERS = {
    "_operators": (*_OPERATORS, "operators/definitions", "operators/responses", *_FITS),
    "_prepare": (*_PREPARE, "prepare/noise_sources", *_FITS, "diagnose/diagnose"),
    "_solve": _STEPS,
    "_fit": _FITS,
    "_frequency": ("frequency/frequency_fit", "frequency/creep_identification"),
    "_crosscheck": _CROSSCHECK,
    "_diagnose": (*_DIAGNOSES, *_ROUNDS, "prepare/noise", "diagnose/stage"),
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
    "_problem": ("prepare/noise", *_FITS, "solve/compressed", "diagnose/stage"),
    "_profile": ("fit/profile",),
    "_residuals": ("fit/residuals",),
    "_robust": ("fit/robust", *_FITS),
    "_search": _SEARCHES,
    "_solve": _STEPS,
    "_span": _SEARCHES,
    "_spelling": ("fit/spelling", "cli/fit"),
    "_swarm": ("crosscheck/searches", "crosscheck/crosscheck"),
    "_evidence": ("diagnose/evidence", *_DIAGNOSES),
    "_held_out": ("diagnose/held_out", *_DIAGNOSES),
    "_locate": ("diagnose/locate", *_DIAGNOSES),
    "_sentence": ("diagnose/sentence", *_DIAGNOSES),
    "_next_experiment": ("diagnose/next_experiment", *_DIAGNOSES),
    "_stage": ("diagnose/stage", "solve/starts", "solve/least_squares", *_DIAGNOSES),
    "_codes": ("prepare/noise", *_DIAGNOSES),
    "_curve": ("diagnose/curve", *_DIAGNOSES),
    "_jumps": ("diagnose/jumps", *_DIAGNOSES),
    "_score": ("diagnose/score", "diagnose/score_test", *_DIAGNOSES),
}
# Minutes on every mutant that nothing else has noticed: not run.
SLOW = ("tests/diagnose/test_diagnose.py::test_interference_that_does_not_repeat_is_noise",)


def tests_of(file: str) -> list[str]:
    """The files of tests to run, in order."""
    path = PurePath(file)
    names = _FILES.get(path.stem) or _FOLDERS[path.parent.name]
    folders = (name.split("/") for name in dict.fromkeys(names))
    return [f"tests/{folder}/test_{name}.py" for folder, name in folders]
