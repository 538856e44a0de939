"""Which tests a mutant has to survive: those that reach its file, the likeliest to notice it first.

Told by hand: coverage would name, for what JAX traces, only the test that traced it first.  A
survivor may yet be noticed by tests that are not run here (blocks, own models, batch, posterior,
compensation, report, command line).
"""

from __future__ import annotations

from pathlib import PurePath

_FITS = ("fit", "fit_options", "step", "profile")
_SEARCHES = ("compressed", "crosscheck", *_FITS)

# By folder, and by the files that have tests of their own.
_FOLDERS = {
    "_operators": ("operators", "definitions", "responses", *_FITS),
    "_fit": _FITS,
    "_diagnose": ("diagnose", "rounds", "noise", "stage"),
}
_FILES = {
    "_definitions": ("definitions",),
    "_oustaloup": ("definitions",),
    "_amplitude_ratios": ("creep_identification",),
    "_bounded": ("crosscheck",),
    "_box": ("crosscheck", "compressed"),
    "_chains": _SEARCHES,
    "_combinations": ("fit_options", "fit", "profile"),
    "_compare": ("profile", "fit_options"),
    "_compressed": _SEARCHES,
    "_creep_identification": ("creep_identification",),
    "_crosscheck": ("crosscheck",),
    "_evolution": ("crosscheck",),
    "_frequency_fit": ("frequency_fit", "creep_identification"),
    "_frequency_table": ("frequency_fit", "creep_identification"),
    "_interpolation": _SEARCHES,
    "_layout": ("compressed", *_FITS),
    "_least_squares": _SEARCHES,
    "_noise": ("noise", *_FITS, "diagnose"),
    "_numerics": ("step", "diagnose"),
    "_preparation": (*_FITS, "noise", "diagnose"),
    "_problem": ("noise", *_FITS, "compressed", "stage"),
    "_profile": ("profile",),
    "_residuals": ("residuals",),
    "_search": _SEARCHES,
    "_solve": ("stage", *_FITS, "compressed"),
    "_span": _SEARCHES,
    "_spelling": ("fit_options", "cli"),
    "_swarm": ("crosscheck",),
    "_evidence": ("evidence", "diagnose"),
    "_held_out": ("held_out", "diagnose"),
    "_locate": ("locate", "diagnose"),
    "_sentence": ("sentence", "diagnose"),
    "_next_experiment": ("next_experiment", "diagnose"),
    "_stage": ("stage", "diagnose"),
    "_codes": ("noise", "diagnose"),
}
# Minutes on every mutant that nothing else has noticed: not run.
SLOW = ("tests/test_diagnose.py::test_interference_that_does_not_repeat_is_noise",)


def tests_of(file: str) -> list[str]:
    """The files of tests to run, in order."""
    path = PurePath(file)
    names = _FILES.get(path.stem) or _FOLDERS[path.parent.name]
    return [f"tests/test_{name}.py" for name in names]
