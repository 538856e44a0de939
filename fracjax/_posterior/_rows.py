"""What a posterior says of each parameter and of each recording."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._show import figure, pretty_unit, rounded

_MEAN_LIMIT, _SD_LIMIT = 0.5, 1.25
"""Up to where the Laplace approximation agrees: difference of the means in standard deviations, and
ratio of the standard deviations; chosen by judgement."""


@dataclass(frozen=True)
class Row:
    """Summary of one parameter, all values in `unit`.

    Attributes:
        name: The parameter's name.
        unit: Its unit.
        mean: Mean of the draws.
        sd: Standard deviation of the draws.
        interval: Shortest interval that holds 95 % of them.
        ess: Effective number of draws.
        r_hat: Split R-hat.
        laplace_mean: Mean of the Laplace approximation.
        laplace_sd: Standard deviation of the Laplace approximation.
        prior: The prior's central 95 %.
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
    """A recording, and what the posterior predicts for its response.

    Attributes:
        source: The recording's name.
        times: Times (N,) [s].
        drive: Drive (N,), in its unit.
        response: Measured response (N,), in its unit.
        used: Whether each sample counts (N,).
        median: Median (N,) of the predicted response without noise, in its unit.
        model: Lower and upper end (2, N) of its central 95 %, in the same unit.
        predictive: Lower and upper end (2, N) of the central 95 % with noise, in the same unit.
    """

    source: str
    times: np.ndarray
    drive: np.ndarray
    response: np.ndarray
    used: np.ndarray
    median: np.ndarray
    model: np.ndarray
    predictive: np.ndarray


def posterior_row(row: Row) -> dict[str, str]:
    """A parameter as a row of the table, with as many digits as its uncertainty justifies."""
    return {
        "name": row.name,
        "mean": rounded(row.mean, row.sd),
        "sd": figure(row.sd, 2),
        "interval": " to ".join(rounded(end, row.sd) for end in row.interval),
        "unit": pretty_unit(row.unit),
        "ess": f"{row.ess:.0f}",
        "r_hat": f"{row.r_hat:.3f}",
        "laplace": f"{rounded(row.laplace_mean, row.laplace_sd)} ± {figure(row.laplace_sd, 2)}",
        "remark": "" if row.agrees else "sampling and Laplace approximation differ",
    }
