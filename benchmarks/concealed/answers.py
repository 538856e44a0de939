"""What a diagnosis said about a case, and how its parameters and units map onto the label's."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path as File

UNITS = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6,
    "Hz": 1.0, "hertz": 1.0, "kHz": 1e3, "rad/s": 0.15915494309189535,
    "V": 1.0, "volt": 1.0, "V/s": 1.0, "V/ms": 1e3, "volt/second": 1.0, "second": 1.0,
    "um": 1.0, "µm": 1.0, "μm": 1.0, "micrometer": 1.0, "nm": 1e-3, "mm": 1e3, "m": 1e6,
    "1": 1.0, "": 1.0, "dimensionless": 1.0, "%": 0.01, "1/V": 1.0, "1/V^2": 1.0, "1/V**2": 1.0,
}  # fmt: skip

# effect -> the label's parameter -> names that others give it; the label's unit beside it.
COUNTERPARTS: dict[str, dict[str, tuple[str, tuple[str, ...]]]] = {
    "creep": {"gain": ("1", ("gain", "gamma", "gain_per_decade"))},
    "drive_lag": {"tau": ("s", ("tau", "time_constant", "lag", "rc"))},
    "delay": {"dead": ("s", ("dead", "dead_time", "delay", "tau", "time"))},
    "sensor_lag": {"tau": ("s", ("tau", "time_constant", "lag", "delay"))},
    "resonance": {
        "frequency": ("Hz", ("frequency", "f0", "natural_frequency", "freq")),
        "zeta": ("1", ("zeta", "damping", "damping_ratio")),
    },
    "electrostriction": {"q": ("1/V", ("q", "quadratic"))},
    "cubic_nonlinearity": {"q": ("1/V^2", ("q3", "q", "cubic"))},
    "saturation": {"u_max": ("V", ("u_max", "limit", "ceiling", "threshold", "level"))},
    "slew_rate_limit": {"rate": ("V/s", ("rate", "slew_rate", "limit", "max_rate"))},
    "thermal_drift": {"tau": ("s", ("tau", "time_constant"))},
    "mains_interference": {"frequency": ("Hz", ("frequency", "f0", "line", "freq"))},
    "backlash": {"radius": ("um", ("radius", "r", "half_width", "threshold"))},
    "quantisation": {"lsb": ("um", ("lsb", "step", "resolution", "size"))},
}
_KINDS = ({"s", "ms", "us", "µs", "μs", "second"}, {"Hz", "hertz", "kHz", "rad/s"}, {"V", "volt"},
          {"V/s", "V/ms", "volt/second"}, {"um", "µm", "μm", "micrometer", "nm", "mm", "m"},
          {"1", "", "dimensionless", "%"}, {"1/V"}, {"1/V^2", "1/V**2"})  # fmt: skip


@dataclass(frozen=True)
class Answer:
    """A diagnosis in the words that the grading needs; `failed` when there is none.

    `can_show` says of effects the smallest size that the drive would show, in um or None; `rms_um`
    is the residual of the last fit.  `chance` is the stated probability that the recommended record
    tells the look-alikes apart, and `after` the answer when that record was there too.
    """

    verdict: str
    effects: tuple[Mapping, ...] = ()
    axes: tuple[Mapping, ...] = ()
    holdout_um: float | None = None
    chance: float | None = None
    after: Answer | None = None
    can_show: tuple[Mapping, ...] = ()
    rms_um: float | None = None

    @property
    def names(self) -> list[str]:
        """Names of the effects, the best first."""
        return [e["name"] for e in self.effects]

    @property
    def first(self) -> str | None:
        return self.names[0] if self.effects else None

    @property
    def reported(self) -> set[str]:
        """All effects that the diagnosis holds possible."""
        return {n for e in self.effects for n in (e["name"], *e["confusable_with"])}

    @property
    def axis(self) -> Mapping | None:
        """Where the diagnosis says that the mismatch shows: the axis that it lists first."""
        return self.axes[0] if self.axes else None


def read_answer(file: File) -> Answer:
    """The answer in a diagnosis.json, and that in `after/`; a file not there is a failed case."""
    if not file.exists():
        return Answer("failed")
    d = json.loads(file.read_text())
    scores = d["fit"].get("extended") or d["fit"]["base"]
    um = UNITS.get(d["fit"].get("unit", ""), float("nan"))
    rmse, rms = (
        None if x is None else x * um for x in map(scores.get, ("holdout_rmse", "train_rmse"))
    )
    chance = d.get("next_experiment", {}).get("probability")
    after = file.parent / "after"
    second = read_answer(after / file.name) if after.exists() else None
    sizes = tuple(x | {"size": _in_um(x["size"], x["unit"])} for x in d.get("can_show", ()))
    effects, axes = tuple(d["effects"]), tuple(d["where"]["axes"])
    return Answer(d["verdict"], effects, axes, rmse, chance, second, sizes, rms)


def _in_um(size: float | None, unit: str) -> float | None:
    return None if size is None else size * UNITS.get(unit, float("nan"))


def label_value(effect: Mapping, parameter: str) -> float | None:
    """The label's number behind a counterpart, None where the two laws have no common one."""
    p = effect["parameters"]
    if effect["key"] == "creep_kelvin_voigt" or p.get("order", 1) > 1:
        return None
    if effect["name"] == "resonance" and parameter == "frequency":
        return 1 / p["period"]
    return p[parameter]


def covered(effect: Mapping, said: Mapping) -> dict[str, bool]:
    """Per parameter that both have (same kind of unit): is the truth in the stated interval?"""
    out = {}
    for parameter, (unit, names) in COUNTERPARTS.get(effect["name"], {}).items():
        value = label_value(effect, parameter)
        found = {k.lower(): v for k, v in said["parameters"].items()}
        stated = next((found[n] for n in names if n in found), None)
        if value is None or stated is None or None in (stated["low"], stated["high"]):
            continue
        if any(unit in k and stated["unit"] in k for k in _KINDS):
            c = UNITS[stated["unit"]] / UNITS[unit]
            out[parameter] = stated["low"] * c <= value <= stated["high"] * c
    return out
