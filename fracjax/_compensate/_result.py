"""The compensation as plain data, saved and loaded without loss."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .._io import column_name, write
from .._operators import History
from .._recording import InputError, _runs
from ._unbounded import TOLERANCE

SCHEMA = "fracjax.compensation/1"
JSON = "compensation.json"
_MISSED = 1e-3
_SIGNALS = ("desired", "drive", "predicted")

Verdict = Literal["followed", "limited", "approximate"]


@dataclass(frozen=True)
class Stretch:
    """From `start` to `stop` [s]: a limit that binds, or the trajectory missed by up to `largest`.

    `kind`: "lower limit", "upper limit", "slew limit" or "missed"; `largest` [drive, drive/s or
    response] is the limit, or the largest predicted error.
    """

    kind: str
    start: float
    stop: float
    largest: float


@dataclass(frozen=True, eq=False)
class Compensation:
    """A drive (N,), the response that the model predicts for it (N,), and how near that comes.

    `desired`, `predicted` and `band` (2, N), the central 95 % over draws of the parameters, are in
    the response's unit, the second of `units`; `limits` and `slew` in the drive's, the first, and
    that per second.  `numerics`: what halving the grid changes of the prediction, as a share of
    the stroke.  `left_out`: what of the model belonged to the recorded run alone.
    """

    model: str
    source: str
    dt: float
    units: tuple[str, str]
    history: History
    offset: float
    limits: tuple[float, float] | None
    slew: float | None
    regularisation: float
    left_out: tuple[str, ...]
    desired: np.ndarray
    drive: np.ndarray
    predicted: np.ndarray
    band: np.ndarray | None
    method: str
    iterations: int
    converged: bool
    numerics: float

    @property
    def times(self) -> np.ndarray:
        """Sample times from 0, shape (N,) [s]."""
        return self.dt * np.arange(len(self.drive))

    @property
    def stroke(self) -> float:
        """Peak to peak of the desired response."""
        return float(np.ptp(self.desired))

    @property
    def error(self) -> np.ndarray:
        """Predicted minus desired (N,), in the response's unit."""
        return self.predicted - self.desired

    @property
    def max_error(self) -> float:
        return float(np.abs(self.error).max())

    @property
    def rms_error(self) -> float:
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def max_error_of_band(self) -> float | None:
        """The largest error anywhere within the band; None where there is no band."""
        return None if self.band is None else float(np.abs(self.band - self.desired).max())

    @property
    def binding(self) -> tuple[Stretch, ...]:
        """Where the drive rests on a limit, in time's order."""
        slack = 1e-6 * float(np.ptp(self.drive))
        found = []
        if self.limits is not None:
            low, high = self.limits
            found += self._stretches("lower limit", self.drive <= low + slack, low)
            found += self._stretches("upper limit", self.drive >= high - slack, high)
        if self.slew is not None:
            change = np.abs(np.diff(self.drive, prepend=self.drive[0]))
            bound = change >= self.slew * self.dt * (1 - 1e-6)
            found += self._stretches("slew limit", bound, self.slew)
        return tuple(sorted(found, key=lambda stretch: stretch.start))

    @property
    def missed(self) -> tuple[Stretch, ...]:
        """Where the predicted error exceeds 0.1 % of the stroke."""
        return tuple(self._stretches("missed", np.abs(self.error) > _MISSED * self.stroke, None))

    def _stretches(self, kind: str, mask: np.ndarray, level: float | None) -> list[Stretch]:
        return [
            Stretch(
                kind,
                float(start * self.dt),
                float(stop * self.dt),
                float(np.abs(self.error[start:stop]).max()) if level is None else level,
            )
            for start, stop in _runs(mask)
        ]

    @property
    def verdict(self) -> Verdict:
        """followed to 1e-6 of the stroke, limited by the drive's limits, or approximate."""
        if self.max_error <= TOLERANCE * self.stroke:
            return "followed"
        return "limited" if self.binding else "approximate"

    def to_dict(self) -> dict[str, Any]:
        """Plain data, as in compensation.json."""
        return {
            "schema": SCHEMA,
            "model": self.model,
            "trajectory": self.source,
            "units": {"drive": self.units[0], "response": self.units[1]},
            "step_s": self.dt,
            "history": self.history,
            "offset": self.offset,
            "limits": None if self.limits is None else list(self.limits),
            "slew_per_s": self.slew,
            "regularisation_s": self.regularisation,
            "left_out": list(self.left_out),
            "verdict": self.verdict,
            "error": {
                "max": self.max_error,
                "rms": self.rms_error,
                "max_percent_of_stroke": 100 * self.max_error / self.stroke,
                "rms_percent_of_stroke": 100 * self.rms_error / self.stroke,
                "max_of_band": self.max_error_of_band,
            },
            "binding": [asdict(stretch) for stretch in self.binding],
            "missed": [asdict(stretch) for stretch in self.missed],
            "method": self.method,
            "iterations": self.iterations,
            "converged": self.converged,
            "numerics": self.numerics,
            "signals": {
                **{name: getattr(self, name).tolist() for name in _SIGNALS},
                "band": None if self.band is None else self.band.tolist(),
            },
        }

    def write_drive(self, path: str | Path) -> None:
        """Write time, drive and desired response as a recording, in the format the suffix tells."""
        columns = {
            "time_s": self.times,
            column_name("drive", self.units[0]): self.drive,
            column_name("response", self.units[1]): self.desired,
        }
        write(path, columns)

    def save(self, path: str | Path) -> None:
        """Write compensation.json; `load_compensation` reads it back."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def load_compensation(path: str | Path) -> Compensation:
    """The compensation from a compensation.json.  Raises InputError where the file is none."""
    try:
        told = json.loads(Path(path).read_text(encoding="utf-8"))
        if told["schema"] != SCHEMA:
            raise KeyError(told["schema"])
        signals = {name: np.asarray(told["signals"][name]) for name in _SIGNALS}
        band, limits = told["signals"]["band"], told["limits"]
        return Compensation(
            model=told["model"],
            source=told["trajectory"],
            dt=told["step_s"],
            units=(told["units"]["drive"], told["units"]["response"]),
            history=told["history"],
            offset=told["offset"],
            limits=None if limits is None else (limits[0], limits[1]),
            slew=told["slew_per_s"],
            regularisation=told["regularisation_s"],
            left_out=tuple(told["left_out"]),
            band=None if band is None else np.asarray(band),
            method=told["method"],
            iterations=told["iterations"],
            converged=told["converged"],
            numerics=told["numerics"],
            **signals,
        )
    except FileNotFoundError:
        raise InputError.at(
            str(path), "a compensation.json", "no such file", "check the path"
        ) from None
    except (OSError, UnicodeDecodeError, KeyError, TypeError, ValueError, IndexError):
        raise InputError.at(
            str(path),
            f'a compensation saved by fracjax (schema "{SCHEMA}")',
            "something else",
            "save it again by `fracjax compensate`",
        ) from None
