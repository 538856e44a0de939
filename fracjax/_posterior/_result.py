"""The posterior as plain data, saved and loaded without loss."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._recording import InputError

if TYPE_CHECKING:
    from xarray import DataArray, DataTree

SCHEMA = "fracjax.posterior/1"
NETCDF, JSON = "posterior.nc", "posterior.json"
_INSEPARABLE = 0.995
_MEAN_LIMIT, _SD_LIMIT = 0.5, 1.25
_SHARE = 0.95


@dataclass(frozen=True)
class Row:
    """One parameter in `unit`: what was sampled, and what the Laplace approximation says of it.

    `interval` is the shortest that holds 95 %; `prior` holds the prior's central 95 %.
    """

    name: str
    unit: str
    mean: float
    sd: float
    interval: tuple[float, float]
    ess: float
    r_hat: float
    laplace_mean: float
    laplace_sd: float
    prior: tuple[float, float]

    @property
    def agrees(self) -> bool:
        """Means within 0.5 standard deviations, and standard deviations within a factor of 1.25."""
        apart = abs(self.mean - self.laplace_mean) / self.laplace_sd
        ratio = self.sd / self.laplace_sd
        return bool(apart <= _MEAN_LIMIT and 1 / _SD_LIMIT <= ratio <= _SD_LIMIT)


@dataclass(frozen=True)
class Band:
    """A recording (N,), and what the posterior predicts of its response.

    `median` (N,); `model` (2, N) the central 95 % of the response without noise, of `predictive`
    (2, N) with it; `used` (N,) where samples count.
    """

    source: str
    times: np.ndarray
    drive: np.ndarray
    response: np.ndarray
    used: np.ndarray
    median: np.ndarray
    model: np.ndarray
    predictive: np.ndarray


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior, what they amount to, and whether they can be relied on.

    `discrepancy`: whether intervals bear what the model leaves out; `doubt`: what a diagnosis says
    that is, nothing where it found nothing or none was given.

    `samples` (walkers, draws) by name, in the units of `summary`; `prior` (draws,) likewise;
    `log_posterior` (walkers, draws) of what walkers move over, all else integrated out.  `steps`,
    `burn_in`, `thinned` (one step of so many is kept) and `autocorrelation` (of the slowest number)
    are in steps of the ensemble.
    """

    model: str
    noise_model: str
    discrepancy: bool
    doubt: str
    units: tuple[str, str]
    samples: dict[str, np.ndarray]
    log_posterior: np.ndarray
    prior: dict[str, np.ndarray]
    summary: tuple[Row, ...]
    known_only_together: tuple[str, ...]
    bands: tuple[Band, ...]
    steps: int
    burn_in: int
    thinned: int
    autocorrelation: float
    acceptance: float
    seed: int
    converged: bool

    @property
    def disagreeing(self) -> tuple[str, ...]:
        """Names of which sampling and Laplace approximation differ beyond the limits of `Row`."""
        return tuple(row.name for row in self.summary if not row.agrees)

    @property
    def sentence(self) -> str:
        """What came of it, and how far it can be relied on."""
        walkers, draws = self.log_posterior.shape
        least = min(row.ess for row in self.summary)
        worst = max(row.r_hat for row in self.summary)
        after = self.steps - self.burn_in
        ran = (
            f"{after / self.autocorrelation:.0f} autocorrelation times, split R-hat {worst:.3f}, "
            f"{least:.0f} effective draws or more"
        )
        caution = f" {self.doubt}" if self.doubt else ""
        beyond = " and a discrepancy" if self.discrepancy else ""
        if not self.converged:
            return (
                f"The chain of {self.model} has not converged in {self.steps} steps ({ran}): "
                f"its figures are provisional.{caution}"
            )
        agreement = (
            f"the Laplace approximation differs in {', '.join(self.disagreeing)}"
            if self.disagreeing
            else "the Laplace approximation agrees"
        )
        return (
            f"{self.model} with {self.noise_model} noise{beyond}: {walkers * draws} draws kept of "
            f"{self.steps} steps ({ran}); {agreement}.{caution}"
        )

    def to_dict(self) -> dict:
        """Plain data, as in posterior.json; the draws themselves are in posterior.nc."""
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
                for row in self.summary
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
        }

    def save(self, folder: str | Path) -> None:
        """Write posterior.json, and posterior.nc, which ArviZ reads (`arviz.from_netcdf`)."""
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
    """ArviZ's groups as a DataTree, the form that 1.x works on and 0.23 reads from a file."""
    import xarray as xr  # half a second, which other commands need not wait for

    units = {row.name: row.unit for row in posterior.summary}
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
    tree = xr.DataTree.from_dict(groups)
    tree.attrs["schema"] = SCHEMA
    return tree


def load_posterior(folder: str | Path) -> Posterior:
    """The posterior from a folder that `Posterior.save` or `fracjax posterior` wrote.

    Raises InputError where there is none.
    """
    folder = Path(folder)
    for name in (JSON, NETCDF):
        if not (folder / name).is_file():
            raise InputError.at(
                str(folder), f"a folder with {JSON} and {NETCDF}", f"no {name}", "correct the path"
            )
    try:
        told = json.loads((folder / JSON).read_text(encoding="utf-8"))
        if told["schema"] != SCHEMA:
            raise KeyError(told["schema"])
        return _loaded(told, folder / NETCDF)
    except (OSError, KeyError, TypeError, ValueError):
        raise InputError.at(
            str(folder),
            f'a posterior saved by fracjax (schema "{SCHEMA}")',
            "something else",
            "save it again by `fracjax posterior`",
        ) from None


def _array(group: DataTree | DataArray, name: str) -> np.ndarray:
    return np.asarray(group[name])


def _loaded(told: dict, path: Path) -> Posterior:
    import xarray as xr

    with xr.open_datatree(path, engine="h5netcdf") as tree:
        names = list(told["parameters"])
        bands = []
        for at, source in enumerate(told["recordings"]):
            group = tree[f"predictions_{at}"]
            signals = ("drive", "response", "median", "model", "predictive")
            arrays = {name: _array(group, name) for name in signals}
            used = _array(group, "used").astype(bool)
            times = _array(group, f"time_{at}")
            bands.append(Band(source=source, times=times, used=used, **arrays))
        samples = {n: _array(tree["posterior"], n) for n in names}
        prior = {n: _array(tree["prior"], n)[0] for n in names}
        heights = _array(tree["sample_stats"], "lp")
    return Posterior(
        model=told["model"],
        noise_model=told["noise_model"],
        discrepancy=told["discrepancy"],
        doubt=told["doubt"],
        units=(told["units"]["drive"], told["units"]["response"]),
        samples=samples,
        log_posterior=heights,
        prior=prior,
        summary=tuple(_row(name, row) for name, row in told["parameters"].items()),
        known_only_together=tuple(told["known_only_together"]),
        bands=tuple(bands),
        steps=told["steps"],
        burn_in=told["burn_in"],
        thinned=told["thinned"],
        autocorrelation=told["autocorrelation"],
        acceptance=told["acceptance"],
        seed=told["seed"],
        converged=told["converged"],
    )


def _row(name: str, told: dict[str, Any]) -> Row:
    fields: dict[str, Any] = {k: v for k, v in told.items() if k != "agrees_with_laplace"}
    fields |= {"interval": tuple(told["interval"]), "prior": tuple(told["prior"])}
    return Row(name, **fields)


def figures_of(draws: np.ndarray) -> tuple[float, float, tuple[float, float], float]:
    """Mean, standard deviation, shortest 95 % interval and effective draws of (walkers, draws)."""
    import arviz

    low, high = np.asarray(arviz.hdi(draws.ravel(), _SHARE))
    ess = float(np.asarray(arviz.ess(draws)))
    return float(draws.mean()), float(draws.std(ddof=1)), (float(low), float(high)), ess


def inseparable(names: Sequence[str], draws: np.ndarray) -> tuple[str, ...]:
    """Pairs out of (D, draws) that correlate beyond 0.995: the data know them only together."""
    correlation = np.corrcoef(draws)
    return tuple(
        f"{names[i]} and {names[j]} (correlation {correlation[i, j]:+.4f})"
        for i, j in combinations(range(len(names)), 2)
        if abs(correlation[i, j]) > _INSEPARABLE
    )
