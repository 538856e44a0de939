"""The result of a compensation: saved as plain data and loaded without loss."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from .._io import column_name, write
from .._models import Model
from .._operators import History
from .._recording import InputError, Recording, runs_of
from .._show import Shown, Table, View, figure, quantity
from .._simulate import simulate, step_to_predict
from ._unbounded import TOLERANCE

if TYPE_CHECKING:
    import pandas as pd

    from .._show.drawing import Drawing

SCHEMA = "fracjax.compensation/1"
JSON = "compensation.json"
_MISSED = 1e-3
"""A predicted error above this share of the stroke counts as missed; chosen by judgement."""
_TWO_SIDED = 1.96
"""Standard errors on either side of a 95 % interval."""
_NEGLIGIBLE = 0.05
"""A part below this share of the expected error is not named; it adds a thousandth."""
_SIGNALS = ("desired", "drive", "predicted")

Verdict = Literal["followed", "limited", "approximate"]


class ModelError(NamedTuple):
    """What a model left of a recording, the sensor's noise included.

    Attributes:
        rms: The rms error [response].
        on: Of which data, such as "held-out data".
        noise: The rms of the sensor's noise in it [response].
        spread: The standard error of its mean square, by the parts that were held out [response²];
            None where there is one part only.
    """

    rms: float
    on: str
    noise: float = 0.0
    spread: float | None = None

    def without_noise(self, errors: float = 0.0) -> float:
        """The model's part of the error, rms [response], at so many standard errors from the most
        probable value."""
        square = self.rms**2 - self.noise**2 + errors * (self.spread or 0.0)
        return float(np.sqrt(max(square, 0.0)))


@dataclass(frozen=True)
class Stretch:
    """A stretch of time in which a limit binds or the response misses the trajectory.

    Attributes:
        kind: "lower limit", "upper limit", "slew limit" or "missed".
        start: Its beginning [s].
        stop: Its end [s].
        largest: The limit [drive or drive/s], or the largest predicted error [response].
    """

    kind: str
    start: float
    stop: float
    largest: float


@dataclass(frozen=True, eq=False, repr=False)
class Compensation(Shown):
    """A drive (N,), the response (N,) that the model predicts for it, and its error.

    Attributes:
        model: Name of the model.
        source: Name of the trajectory, such as its file.
        dt: The time step [s].
        units: Units of drive and response.
        history: What the drive did before the first sample: "rest", "constant" or "periodic".
        offset: What the sensor reads where the model's response is zero [response].
        limits: Lowest and highest drive [drive]; None without limits.
        slew: Fastest change of the drive [drive/s]; None without a limit.
        regularisation: The time τ below which detail of the drive was damped [s]; 0 for none.
        left_out: Names of the blocks left out because they belong to the recorded run alone.
        desired: The desired response (N,) [response].
        drive: The drive (N,) [drive].
        predicted: The response that the model predicts for this drive (N,) [response].
        band: Central 95 % of the predicted response over draws of the parameters (2, N) [response];
            None without draws.
        method: Name of the method that determined the drive.
        iterations: Number of its iterations.
        converged: Whether the method converged.
        numerics: Largest change of the prediction when the grid's step is halved, as a share of the
            stroke.
        warnings: Sentences about what the model does not allow.
        model_error: What the model left of a recording; None where it is not given.
        inverted: The model that was inverted, without the blocks left out; None of a compensation
            loaded from a file.
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
    warnings: tuple[str, ...] = ()
    model_error: ModelError | None = None
    inverted: Model | None = None

    @property
    def times(self) -> np.ndarray:
        """Sample times (N,) from 0 [s]."""
        return self.dt * np.arange(len(self.drive))

    @property
    def stroke(self) -> float:
        """Peak-to-peak value of the desired response [response]."""
        return float(np.ptp(self.desired))

    @property
    def error(self) -> np.ndarray:
        """Predicted minus desired response (N,) [response]."""
        return self.predicted - self.desired

    @property
    def max_error(self) -> float:
        """The largest absolute error [response]."""
        return float(np.abs(self.error).max())

    @property
    def rms_error(self) -> float:
        """The root mean square error [response]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def max_error_of_band(self) -> float | None:
        """The largest error anywhere within the band [response]; None without a band."""
        return None if self.band is None else float(np.abs(self.band - self.desired).max())

    @property
    def expected_error(self) -> float | None:
        """The rms error to expect of the stage's motion [response]: the model's own and that of the
        prediction, the sensor's noise apart; None where the model's is not given."""
        if self.model_error is None:
            return None
        return float(np.hypot(self.model_error.without_noise(), self.rms_error))

    @property
    def expected(self) -> str:
        """The error to expect on the stage, and of what it consists, in words; empty where the
        model's is not given."""
        error, total = self.model_error, self.expected_error
        if error is None or total is None:
            return ""
        unit = self.units[1]
        share = figure(100 * total / self.stroke)
        own = quantity(error.without_noise(), unit)
        if error.spread is not None:
            low, high = (error.without_noise(errors) for errors in (-_TWO_SIDED, _TWO_SIDED))
            own += f" ({figure(low)} to {quantity(high, unit)})"
        parts = f"{own} of the model, as on {error.on}"
        if self.rms_error > _NEGLIGIBLE * total:
            cause = "the limits" if self.binding else "the inversion"
            parts += f", and {quantity(self.rms_error, unit)} of {cause}"
        noise = f"; the sensor adds {quantity(error.noise, unit)} of noise" if error.noise else ""
        return f"{quantity(total, unit)} rms ({share} % of the stroke): {parts}{noise}"

    @property
    def binding(self) -> tuple[Stretch, ...]:
        """The stretches in which the drive is at a limit, in order of time."""
        # A drive this near to a limit counts as being at it; chosen by judgement.
        slack = 1e-6 * float(np.ptp(self.drive))
        stretches = []
        if self.limits is not None:
            low, high = self.limits
            stretches += self._stretches("lower limit", self.drive <= low + slack, low)
            stretches += self._stretches("upper limit", self.drive >= high - slack, high)
        if self.slew is not None:
            change = np.abs(np.diff(self.drive, prepend=self.drive[0]))
            bound = change >= self.slew * self.dt * (1 - 1e-6)
            stretches += self._stretches("slew limit", bound, self.slew)
        return tuple(sorted(stretches, key=lambda stretch: stretch.start))

    @property
    def missed(self) -> tuple[Stretch, ...]:
        """The stretches in which the predicted error exceeds 0.1 % of the stroke."""
        return tuple(self._stretches("missed", np.abs(self.error) > _MISSED * self.stroke, None))

    def _stretches(self, kind: str, mask: np.ndarray, level: float | None) -> list[Stretch]:
        """The stretches where a mask (N,) holds, with the limit's level or the largest error."""
        return [
            Stretch(
                kind,
                float(start * self.dt),
                float(stop * self.dt),
                float(np.abs(self.error[start:stop]).max()) if level is None else level,
            )
            for start, stop in runs_of(mask)
        ]

    @property
    def verdict(self) -> Verdict:
        """Whether the trajectory is followed to 1e-6 of the stroke.

        "followed", or else "limited" if a limit of the drive binds, or else "approximate".
        """
        if self.max_error <= TOLERANCE * self.stroke:
            return "followed"
        return "limited" if self.binding else "approximate"

    def _view(self) -> View:
        drive, response = self.units

        def error(value: float) -> str:
            share = figure(100 * value / self.stroke)
            return f"{quantity(value, response)}, {share} % of the stroke"

        used = f"{figure(self.drive.min(), 4)} to {quantity(self.drive.max(), drive)}"
        rows = [
            ["drive", used],
            *([["error to expect on the stage", self.expected]] if self.expected else []),
            ["of the inversion, largest", error(self.max_error)],
            ["of the inversion, rms", error(self.rms_error)],
            ["discretisation", f"{figure(100 * self.numerics)} % of the stroke"],
            ["method", f"{self.method}, {self.iterations} iterations"],
        ]
        if self.band is not None:
            width = float(np.max(self.band[1] - self.band[0]))
            rows.append(["95 % band of the parameters", f"{quantity(width, response)} at most"])
        state = "" if self.converged else "; not converged"
        at_limits = [[s.kind, f"{s.start:.4g} to {s.stop:.4g} s"] for s in self.binding]
        missed = [[s.kind, f"{s.start:.4g} to {s.stop:.4g} s"] for s in self.missed]
        return View(
            f"Drive of {self.model} along {Path(self.source).name}: {self.verdict}{state}.",
            [Table([], rows), Table(["stretch", ""], [*at_limits, *missed], detail=True)],
        )

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> np.ndarray:
        """The response that the model predicts for another drive, such as the one that was applied.

        Args:
            drive: (N,) in the compensation's drive unit, or a recording in the same units.
            step: The time between samples [s], by default that of the compensation.
            history: What the drive did before the first sample, as in `simulate`; by default that
                of the compensation.

        Returns:
            The response (N,) in the compensation's response unit, offset included.

        Raises:
            InputError: When the drive is no finite signal, a recording has other units, or the
                compensation was loaded from a file, which holds no model.
        """
        if self.inverted is None:
            raise InputError.at(
                "compensation, predict",
                "a compensation with its model",
                "one loaded from a file",
                "compensate again, or simulate with load_model(fit.json)",
            )
        step = step_to_predict(drive, step, self.dt, self.units, self.source)
        simulation = simulate(self.inverted, drive, step, history or self.history)
        return simulation.response + self.offset

    def plot(self) -> Drawing:
        """Draw the desired and the predicted response, the drive, and the predicted error.

        Returns:
            A matplotlib figure, in the compensation's units.
        """
        from ._picture import draw_compensation

        signals = {"desired": self.desired, "predicted": self.predicted, "drive": self.drive}
        return draw_compensation(self.times, signals, self.band, self.units, self.limits)

    def plot_residuals(self) -> Drawing:
        """Draw the predicted error over time.

        Returns:
            A matplotlib figure, in the response's unit.
        """
        from ._picture import draw_error

        return draw_error(self.times, self.error, self.units[1])

    def to_dataframe(self) -> pd.DataFrame:
        """The signals as a table.

        Returns:
            A pandas table: time [s], and drive, desired and predicted response in their units.
        """
        import pandas as pd

        signals = {name: getattr(self, name) for name in _SIGNALS}
        return pd.DataFrame({"time_s": self.times, **signals})

    def to_dict(self) -> dict[str, Any]:
        """The compensation as plain data, as in compensation.json.

        Returns:
            The content by key; signals as lists of numbers in the units under "units".
        """
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
            "model_error": self.model_error and self.model_error._asdict(),
            "expected_error": self.expected_error,
            "binding": [asdict(stretch) for stretch in self.binding],
            "missed": [asdict(stretch) for stretch in self.missed],
            "method": self.method,
            "iterations": self.iterations,
            "converged": self.converged,
            "numerics": self.numerics,
            "warnings": list(self.warnings),
            "signals": {
                **{name: getattr(self, name).tolist() for name in _SIGNALS},
                "band": None if self.band is None else self.band.tolist(),
            },
        }

    def write_drive(self, path: str | Path) -> None:
        """Write time [s], drive and desired response as a recording.

        Args:
            path: The file; its suffix sets the format, as in `fracjax.write`.

        Raises:
            InputError: When the suffix is unknown.
        """
        columns = {
            "time_s": self.times,
            column_name("drive", self.units[0]): self.drive,
            column_name("response", self.units[1]): self.desired,
        }
        write(path, columns)

    def save(self, path: str | Path) -> None:
        """Write the compensation as JSON, which `load_compensation` reads.

        Args:
            path: The file, usually compensation.json.
        """
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", encoding="utf-8")


def load_compensation(path: str | Path) -> Compensation:
    """The compensation that was saved in a file.

    Args:
        path: A file written by `Compensation.save`, usually compensation.json.

    Returns:
        The compensation, as it was saved.

    Raises:
        InputError: When there is no such file or it holds no compensation.
    """
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise KeyError(content["schema"])
        signals = {name: np.asarray(content["signals"][name]) for name in _SIGNALS}
        band, limits = content["signals"]["band"], content["limits"]
        error = content.get("model_error")
        return Compensation(
            model=content["model"],
            source=content["trajectory"],
            dt=content["step_s"],
            units=(content["units"]["drive"], content["units"]["response"]),
            history=content["history"],
            offset=content["offset"],
            limits=None if limits is None else (limits[0], limits[1]),
            slew=content["slew_per_s"],
            regularisation=content["regularisation_s"],
            left_out=tuple(content["left_out"]),
            band=None if band is None else np.asarray(band),
            method=content["method"],
            iterations=content["iterations"],
            converged=content["converged"],
            numerics=content["numerics"],
            warnings=tuple(content.get("warnings", ())),
            model_error=error and ModelError(**error),
            inverted=None,
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
