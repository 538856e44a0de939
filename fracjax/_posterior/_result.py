"""The posterior as plain data, saved and loaded without loss."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._fit import analyse_whitened
from .._operators import History
from .._recording import InputError, Recording, item
from .._show import Shown, Table, View
from ._prediction import PosteriorPrediction, Predictor, predictor_of
from ._rows import Band, Row, posterior_row

if TYPE_CHECKING:
    import pandas as pd
    from xarray import DataArray, DataTree

    from .._show.drawing import Drawing

SCHEMA = "fracjax.posterior/1"
NETCDF, JSON = "posterior.nc", "posterior.json"
_PREDICTOR, _OFFSETS = "predictor", "sensor_offset"
"""Group of the draws that predict, and the offsets in it."""
_STRONG_CORRELATION = 0.995
"""Correlation beyond which two parameters are reported as a pair; chosen by judgement."""
_HALF_WIDTH = 1.96
"""Half the width of the central 95 % of a normal distribution, in standard deviations."""
_SHARE = 0.95
"""Probability of the reported intervals."""


@dataclass(frozen=True, repr=False)
class Posterior(Shown):
    """Draws from the posterior, their summary, and whether they are reliable.

    Attributes:
        model: Name of the model.
        noise_model: Name of the noise model.
        discrepancy: Whether the intervals include a discrepancy between model and actuator.
        doubt: Why the model does not describe the recording, from the fit or from a diagnosis;
            empty if it does.
        units: Units of drive and response.
        samples: Draws (walkers, draws) by parameter, in the units of `rows`.
        log_posterior: Log density (walkers, draws) of the walkers' parameters, with all others
            integrated out.
        prior: Draws (draws,) from the prior by parameter, in the same units.
        rows: One row per parameter.
        known_only_together: Pairs of parameters that are strongly correlated.
        bands: What the posterior predicts for each recording.
        steps: Steps of the ensemble.
        burn_in: Steps at the start that are left out.
        thinned: One step out of this number is stored.
        autocorrelation: Autocorrelation time of the slowest parameter, in steps.
        acceptance: Share of accepted proposals.
        seed: Seed of all random numbers.
        converged: Whether the chain holds as many effective draws as wanted, with R-hat below 1.01.
        predictor: What `predict` needs; None of a posterior that was saved without it.
    """

    model: str
    noise_model: str
    discrepancy: bool
    doubt: str
    units: tuple[str, str]
    samples: dict[str, np.ndarray]
    log_posterior: np.ndarray
    prior: dict[str, np.ndarray]
    rows: tuple[Row, ...]
    known_only_together: tuple[str, ...]
    bands: tuple[Band, ...]
    steps: int
    burn_in: int
    thinned: int
    autocorrelation: float
    acceptance: float
    seed: int
    converged: bool
    predictor: Predictor | None = None

    @property
    def disagreeing(self) -> tuple[str, ...]:
        """Parameters for which sampling and Laplace approximation disagree (`Row.agrees`)."""
        return tuple(row.name for row in self.rows if not row.agrees)

    @property
    def sentence(self) -> str:
        """The result in one sentence or two, with what limits its reliability."""
        walkers, draws = self.log_posterior.shape
        least = min(row.ess for row in self.rows)
        worst = max(row.r_hat for row in self.rows)
        kept = self.steps - self.burn_in
        length = (
            f"{kept / self.autocorrelation:.0f} autocorrelation times, split R-hat {worst:.3f}, "
            f"{least:.0f} effective draws or more"
        )
        caveat = f"{self.doubt} " if self.doubt else ""
        extra = " and a discrepancy" if self.discrepancy else ""
        if not self.converged:
            return (
                f"{caveat}The chain of {self.model} has not converged in {self.steps} steps "
                f"({length}): its results are provisional."
            )
        agreement = (
            f"the Laplace approximation differs in {', '.join(self.disagreeing)}"
            if self.disagreeing
            else "the Laplace approximation agrees"
        )
        return (
            f"{caveat}{self.model} with {self.noise_model} noise{extra}: {walkers * draws} draws "
            f"kept of {self.steps} steps ({length}); {agreement}."
        )

    def _view(self) -> View:
        headers = ["", "mean", "sd", "95 % interval", "unit", "draws", "R-hat", "Laplace", "remark"]
        table = Table(headers, [list(posterior_row(row).values()) for row in self.rows])
        correlated = [f"Strongly correlated: {pair}." for pair in self.known_only_together]
        return View(self.sentence, [table], correlated)

    def predict(
        self,
        drive: np.ndarray | Recording,
        step: float | str | None = None,
        history: History | None = None,
    ) -> PosteriorPrediction:
        """The response that 200 draws predict for a drive, as the first sensor reads it.

        The discrepancy is not included, as it is known along the recorded drive alone; nor is the
        sensor's noise.

        Args:
            drive: (N,) in the recording's drive unit, or a recording in the same units.
            step: The time between samples [s], by default that of the first recording.
            history: The drive before the first sample, as in `simulate`; by default as it was in
                the first recording, or "constant" where that was estimated.

        Returns:
            Mean (N,) and central 95 % (2, N) in the response's unit, offset included.

        Raises:
            InputError: The drive is no finite signal, a recording has other units, or the posterior
                was loaded and its model is not one that `parse_model` builds.
        """
        if self.predictor is None:
            raise InputError.at(
                "posterior, predict",
                "a posterior that holds its model",
                "one of an older file",
                "sample it again",
            )
        return self.predictor.predict(drive, step, history, self.units, self.bands[0].source)

    def plot(self, recording: int = 0) -> Drawing:
        """Draw what is predicted over time, and the residual within its 95 % band.

        Args:
            recording: Which of the recordings, from 0.

        Returns:
            A matplotlib figure, in the recording's units.

        Raises:
            InputError: When there is no such recording.
        """
        from ._pictures import draw_series

        return draw_series(item(self.bands, recording, "recording"), self.units)

    def plot_loop(self, recording: int = 0) -> Drawing:
        """Draw what is predicted over the drive.

        Args:
            recording: Which of the recordings, from 0.

        Returns:
            A matplotlib figure, in the recording's units.

        Raises:
            InputError: When there is no such recording.
        """
        from ._pictures import draw_loop

        return draw_loop(item(self.bands, recording, "recording"), self.units)

    def plot_residuals(self, recording: int = 0) -> Drawing:
        """Draw the residual of the median prediction: its distribution and its correlations.

        Args:
            recording: Which of the recordings, from 0.

        Returns:
            A matplotlib figure, the residual over the standard deviation of the prediction.

        Raises:
            InputError: When there is no such recording.
        """
        band = item(self.bands, recording, "recording")
        low, high = band.predictive
        scaled = (band.response - band.median) / ((high - low) / (2 * _HALF_WIDTH))
        step = float(band.times[1] - band.times[0])
        return analyse_whitened(scaled, band.used, band.drive, step, band.source).plot()

    def plot_corner(self) -> Drawing:
        """Draw the density of every parameter and of every pair.

        Returns:
            A matplotlib figure, parameters in their units.
        """
        from ._pictures import draw_corner

        return draw_corner(self.rows, self.samples)

    def plot_trace(self) -> Drawing:
        """Draw all walkers over the steps that were kept.

        Returns:
            A matplotlib figure, parameters in their units.
        """
        from ._pictures import draw_trace

        return draw_trace(self.rows, self.samples, self.burn_in, self.thinned)

    def plot_prior(self) -> Drawing:
        """Draw prior and posterior; where they coincide the data contain no information.

        Returns:
            A matplotlib figure, parameters in their units.
        """
        from ._pictures import draw_prior

        return draw_prior(self.rows, self.samples, self.prior)

    def to_dataframe(self) -> pd.DataFrame:
        """The draws as a table, a row per draw of a walker.

        Returns:
            A pandas table with a column per parameter, in its unit, indexed by walker and draw.
        """
        import pandas as pd

        index = pd.MultiIndex.from_product(
            [range(size) for size in self.log_posterior.shape], names=["walker", "draw"]
        )
        return pd.DataFrame({name: draws.ravel() for name, draws in self.samples.items()}, index)

    def to_dict(self) -> dict:
        """The summary as plain data, as in posterior.json; posterior.nc holds the draws.

        Returns:
            A dictionary that JSON can store.
        """
        return {
            "schema": SCHEMA,
            "model": self.model,
            "noise_model": self.noise_model,
            "discrepancy": self.discrepancy,
            "doubt": self.doubt,
            "units": {"drive": self.units[0], "response": self.units[1]},
            "recordings": [band.source for band in self.bands],
            "parameters": {
                row.name: {k: v for k, v in asdict(row).items() if k != "name"}
                | {"agrees_with_laplace": row.agrees}
                for row in self.rows
            },
            "known_only_together": list(self.known_only_together),
            "steps": self.steps,
            "burn_in": self.burn_in,
            "thinned": self.thinned,
            "autocorrelation": self.autocorrelation,
            "acceptance": self.acceptance,
            "seed": self.seed,
            "converged": self.converged,
            "agrees_with_laplace": not self.disagreeing,
            "sentence": self.sentence,
            "predictor": self.predictor and self.predictor.to_dict(),
        }

    def save(self, folder: str | Path) -> None:
        """Write posterior.json, and posterior.nc, which ArviZ reads (`arviz.from_netcdf`).

        Args:
            folder: The folder, which is created if necessary.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        part = folder / f".{NETCDF}.part"
        try:
            _tree_of(self).to_netcdf(part, engine="h5netcdf")
            part.replace(folder / NETCDF)
        finally:
            part.unlink(missing_ok=True)
        text = json.dumps(self.to_dict(), indent=1) + "\n"
        (folder / JSON).write_text(text, encoding="utf-8")


def _tree_of(posterior: Posterior) -> DataTree:
    """ArviZ's groups as a DataTree, which ArviZ 1.x uses and ArviZ 0.23 reads from a file."""
    import xarray as xr  # takes half a second, which other commands save

    units = {row.name: row.unit for row in posterior.rows}
    prior = {
        n: (("chain", "draw"), v[None], {"units": units[n]}) for n, v in posterior.prior.items()
    }
    drawn = {n: (("chain", "draw"), v, {"units": units[n]}) for n, v in posterior.samples.items()}
    groups = {
        "/posterior": xr.Dataset(drawn),
        "/prior": xr.Dataset(prior),
        "/sample_stats": xr.Dataset({"lp": (("chain", "draw"), posterior.log_posterior)}),
    }
    for at, band in enumerate(posterior.bands):
        time, edges = f"time_{at}", ("edge", f"time_{at}")
        groups[f"/predictions_{at}"] = xr.Dataset(
            {
                "drive": (time, band.drive, {"units": posterior.units[0]}),
                "response": (time, band.response, {"units": posterior.units[1]}),
                "used": (time, band.used.astype(np.int8)),
                "median": (time, band.median),
                "model": (edges, band.model),
                "predictive": (edges, band.predictive),
            },
            coords={time: band.times},
        )
    if (predictor := posterior.predictor) is not None:
        drawn = {
            name: (("draw", *(f"{name}_{at}" for at in range(1, draws.ndim))), draws)
            for name, draws in predictor.draws.items()
        }
        groups[f"/{_PREDICTOR}"] = xr.Dataset({**drawn, _OFFSETS: ("draw", predictor.offsets)})
    tree = xr.DataTree.from_dict(groups)
    tree.attrs["schema"] = SCHEMA
    return tree


def load_posterior(folder: str | Path) -> Posterior:
    """Load a posterior that `Posterior.save` or `fracjax posterior` wrote.

    Args:
        folder: The folder with posterior.json and posterior.nc.

    Returns:
        The posterior, equal to the saved one.

    Raises:
        InputError: The folder holds no posterior, or one in another format.
    """
    folder = Path(folder)
    for name in (JSON, NETCDF):
        if not (folder / name).is_file():
            raise InputError.at(
                str(folder), f"a folder with {JSON} and {NETCDF}", f"no {name}", "correct the path"
            )
    try:
        content = json.loads((folder / JSON).read_text(encoding="utf-8"))
        if content["schema"] != SCHEMA:
            raise KeyError(content["schema"])
        return _loaded(content, folder / NETCDF)
    except (OSError, KeyError, TypeError, ValueError):
        raise InputError.at(
            str(folder),
            f'a posterior saved by fracjax (schema "{SCHEMA}")',
            "something else",
            "save it again by `fracjax posterior`",
        ) from None


def _array(group: DataTree | DataArray, name: str) -> np.ndarray:
    """A variable of a group as an array."""
    return np.asarray(group[name])


def _loaded(content: dict, path: Path) -> Posterior:
    """The posterior from the content of posterior.json and the path of posterior.nc."""
    import xarray as xr

    with xr.open_datatree(path, engine="h5netcdf") as tree:
        names = list(content["parameters"])
        bands = []
        for at, source in enumerate(content["recordings"]):
            group = tree[f"predictions_{at}"]
            signals = ("drive", "response", "median", "model", "predictive")
            arrays = {name: _array(group, name) for name in signals}
            used = _array(group, "used").astype(bool)
            times = _array(group, f"time_{at}")
            bands.append(Band(source=source, times=times, used=used, **arrays))
        samples = {n: _array(tree["posterior"], n) for n in names}
        prior = {n: _array(tree["prior"], n)[0] for n in names}
        log_posterior = _array(tree["sample_stats"], "lp")
        predictor = None
        if entry := content.get("predictor"):
            draws = {str(n): _array(tree[_PREDICTOR], str(n)) for n in tree[_PREDICTOR].data_vars}
            predictor = predictor_of(content["model"], entry, draws, draws.pop(_OFFSETS))
    return Posterior(
        model=content["model"],
        noise_model=content["noise_model"],
        discrepancy=content["discrepancy"],
        doubt=content["doubt"],
        units=(content["units"]["drive"], content["units"]["response"]),
        samples=samples,
        log_posterior=log_posterior,
        prior=prior,
        rows=tuple(_row(name, row) for name, row in content["parameters"].items()),
        known_only_together=tuple(content["known_only_together"]),
        bands=tuple(bands),
        steps=content["steps"],
        burn_in=content["burn_in"],
        thinned=content["thinned"],
        autocorrelation=content["autocorrelation"],
        acceptance=content["acceptance"],
        seed=content["seed"],
        converged=content["converged"],
        predictor=predictor,
    )


def _row(name: str, entry: dict[str, Any]) -> Row:
    """The summary of one parameter from its entry in posterior.json."""
    fields: dict[str, Any] = {k: v for k, v in entry.items() if k != "agrees_with_laplace"}
    fields |= {"interval": tuple(entry["interval"]), "prior": tuple(entry["prior"])}
    return Row(name, **fields)


def summary_of(draws: np.ndarray) -> tuple[float, float, tuple[float, float], float]:
    """Mean, standard deviation, shortest 95 % interval and effective number of draws."""
    import arviz

    low, high = np.asarray(arviz.hdi(draws.ravel(), _SHARE))
    ess = float(np.asarray(arviz.ess(draws)))
    return float(draws.mean()), float(draws.std(ddof=1)), (float(low), float(high)), ess


def strongly_correlated_pairs(names: Sequence[str], draws: np.ndarray) -> tuple[str, ...]:
    """Pairs of parameters whose draws (D, draws) correlate beyond 0.995."""
    correlation = np.corrcoef(draws)
    return tuple(
        f"{names[i]} and {names[j]} (correlation {correlation[i, j]:+.4f})"
        for i, j in combinations(range(len(names)), 2)
        if abs(correlation[i, j]) > _STRONG_CORRELATION
    )
