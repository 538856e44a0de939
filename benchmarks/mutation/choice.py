"""Which tests a mutant has to survive: those that reach its file, the likeliest to notice it first.

Told by hand: coverage would name, for what JAX traces, only the test that traced it first.  A
survivor may yet be noticed by tests that are not run here (blocks, own models, batch, posterior,
compensation, report, command line).
"""

from __future__ import annotations

from pathlib import PurePath

# What every fit goes through, the tests that look closest first.
_FITS = (
    "fit/fit",
    "fit/uncertainty",
    "prepare/weights",
    "prepare/conditions",
    "prepare/history",
    "fit/robust",
    "solve/starts",
    "solve/step",
    "fit/combinations",
    "fit/profile",
    "fit/summary",
)
_COMPRESSED = ("solve/compressed", "solve/stack", "solve/starts", "crosscheck/crosscheck")
_STACK = ("solve/stack", "batch/stacks", "solve/compressed", "solve/starts", "batch/rows")
_NOISE = ("prepare/noise_sources", "prepare/noise", "prepare/floor", *_FITS, "diagnose/diagnose")
_CROSSCHECK = ("crosscheck/box", "crosscheck/searches", "crosscheck/crosscheck", "solve/compressed")
_CREEP = ("frequency/creep_identification",)
_OUSTALOUP = ("operators/definitions", "operators/responses", "blocks/laws")
_DIAGNOSES = (
    "diagnose/refits",
    "diagnose/held_out",
    "diagnose/sentence",
    "diagnose/diagnose",
)

# By folder, and before these by the files that have tests of their own.
_FOLDERS = {
    "_operators": (
        "operators/convolution_quadrature",
        "operators/rate",
        "operators/grid",
        *_OUSTALOUP,
        *_FITS[:5],
    ),
    "_prepare": (*_FITS, "prepare/noise"),
    "_solve": ("solve/least_squares", *_FITS),
    "_fit": _FITS,
    "_frequency": ("frequency/frequency_fit", *_CREEP),
    "_crosscheck": _CROSSCHECK,
    "_diagnose": ("diagnose/places", *_DIAGNOSES),
    "_inside": (
        "inside/evidence",
        "inside/posterior",
        "inside/inquiry",
        "inside/columns",
        "inside/predictions",
        "inside/named",
        "inside/inside",
    ),
    "_blocks": (
        "blocks/scales",
        "blocks/forces",
        "blocks/ports",
        "blocks/steps",
        "blocks/machines",
    ),
}
_FILES = {
    "_operators": {
        "_definitions": ("operators/definitions",),
        "_grid": ("operators/grid", "prepare/history"),
        "_laplace": ("operators/responses", "operators/convolution_quadrature"),
        "_oustaloup": _OUSTALOUP,
        "_rate": ("operators/rate",),
    },
    "_prepare": {
        "_autoregression": _NOISE[:3],
        "_conditions": ("prepare/conditions",),
        "_layout": ("prepare/conditions", *_COMPRESSED[:1]),
        "_noise": _NOISE,
        "_noise_sources": _NOISE,
        "_noise_stretches": _NOISE[1:],
        "_preparation": ("prepare/history", "prepare/weights"),
        "_setting": ("prepare/noise",),
        "_spelling": ("fit/spelling", "cli/fit"),
        "_tone": ("prepare/floor", "prepare/noise"),
        "_weights": ("prepare/weights",),
    },
    "_solve": {
        "_chains": _COMPRESSED,
        "_compressed": _COMPRESSED,
        "_interpolation": _COMPRESSED,
        "_least_squares": ("solve/least_squares",),
        "_lockstep": _STACK,
        "_numerics": ("solve/step", "solve/numerics", "solve/stack"),
        "_responses": _STACK,
        "_search": ("solve/starts", *_COMPRESSED),
        "_signals": _STACK,
        "_solve": ("solve/starts",),
        "_span": _COMPRESSED,
        "_stack": _STACK,
        "_transformed": _STACK,
    },
    "_fit": {
        "_combinations": ("fit/combinations",),
        "_compare": ("fit/profile", "fit/summary"),
        "_fit": ("fit/fit", "batch/stacks"),
        "_grade": ("fit/grade",),
        "_history": ("prepare/history", "solve/stack"),
        "_linear": ("fit/linear",),
        "_profile": ("fit/profile",),
        "_residuals": ("fit/residuals",),
        "_robust": ("fit/robust",),
        "_rows": ("fit/summary", "batch/rows"),
        "_settle": ("prepare/history", "prepare/noise_sources"),
        "_uncertainty": ("fit/uncertainty", "prepare/conditions"),
        "_whiteness": ("fit/residuals",),
    },
    "_blocks": {
        name: (("blocks/viscoelastic",) if name == "viscoelastic" else ())
        for name in (
            "_inside",
            "_machine",
            "_port",
            "clearance",
            "clipping",
            "cubic_stiffness",
            "curvature",
            "dead_zone",
            "diode",
            "dry_friction",
            "end_stop",
            "filters",
            "hysteretic_spring",
            "impedance",
            "internal_saturation",
            "lag",
            "mass",
            "modes",
            "negative_stiffness",
            "oscillator",
            "position_dependent_gain",
            "quadratic_damping",
            "quadratic_stiffness",
            "root_outflow",
            "static_curve",
            "viscoelastic",
        )
    },
    "_frequency": {"_amplitude_ratios": _CREEP, "_creep_identification": _CREEP},
    "_diagnose": {
        name: (f"diagnose/{test}",)
        for name, test in (
            ("_drive", "drive"),
            ("_held_out", "held_out"),
            ("_jumps", "jumps"),
            ("_places", "places"),
            ("_sentence", "sentence"),
            ("_next_experiment", "next_experiment"),
        )
    },
}
# A file whose own tests are all that can notice it: the others never reach it.
_ALONE = {"_definitions", "_linear", "_grade", "_whiteness", "_spelling", "_stack"}


def sampled(file: str) -> bool:
    """Whether a file takes part: all of a folder, or of the blocks those of machines."""
    path = PurePath(file)
    return path.parent.name != "_blocks" or path.stem in _FILES["_blocks"]


def tests_of(file: str) -> list[str]:
    """The files of tests to run, in order."""
    path = PurePath(file)
    folder = path.parent.name
    own = _FILES.get(folder, {}).get(path.stem, ())
    names = own if path.stem in _ALONE else (*own, *_FOLDERS[folder])
    places = (name.split("/") for name in dict.fromkeys(names))
    return [f"tests/{where}/test_{name}.py" for where, name in places]
