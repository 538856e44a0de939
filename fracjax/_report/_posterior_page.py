"""The report of a posterior."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .._posterior import Posterior, posterior_row
from .._show import figure
from .._show.drawing import svg
from ._text import download

_MOST_RECORDINGS = 3


def posterior_content(posterior: Posterior) -> dict[str, Any]:
    """The template's content."""
    names = ", ".join(Path(band.source).name for band in posterior.bands)
    drawn = posterior.bands[:_MOST_RECORDINGS]
    return {
        "title": f"Posterior of {names}",
        "sentence": posterior.sentence,
        "badge": "converged" if posterior.converged else "not converged",
        "verdict": "none" if posterior.converged else "unexplained",
        "facts": _facts(posterior),
        "rows": [posterior_row(row) for row in posterior.rows],
        "correlated": posterior.known_only_together,
        "warnings": _warnings(posterior),
        "corner": svg(posterior.plot_corner()),
        "overlay": svg(posterior.plot_prior()),
        "traces": svg(posterior.plot_trace()),
        "recordings": [
            {
                "source": band.source,
                "loops": svg(posterior.plot_loop(index)),
                "series": svg(posterior.plot(index)),
            }
            for index, band in enumerate(drawn)
        ],
        "omitted": len(posterior.bands) - len(drawn),
        "downloads": [download("posterior.json", posterior.to_dict())],
    }


def _facts(posterior: Posterior) -> list[tuple[str, str]]:
    """The table about the chain."""
    walkers, draws = posterior.log_posterior.shape
    return [
        ("Model", posterior.model),
        ("Noise model", posterior.noise_model),
        ("Discrepancy", "modelled" if posterior.discrepancy else "not modelled"),
        ("Walkers", str(walkers)),
        ("Steps", f"{posterior.steps}, of which {posterior.burn_in} burn-in"),
        ("Draws kept", f"{walkers * draws}, one step in {posterior.thinned}"),
        ("Autocorrelation time", f"{figure(posterior.autocorrelation)} steps"),
        ("Moves accepted", f"{100 * posterior.acceptance:.0f} %"),
    ]


def _warnings(posterior: Posterior) -> list[str]:
    """Warnings about the diagnosis, the convergence and the Laplace approximation."""
    warnings = [posterior.doubt] if posterior.doubt else []
    if not posterior.converged:
        warnings.append("The chain has not converged: continue with --resume and more --steps.")
    if posterior.disagreeing:
        warnings.append(
            "The Laplace approximation differs from the chain by more than 0.5 standard deviations "
            f"or a factor of 1.25 in {', '.join(posterior.disagreeing)}: use the chain's values."
        )
    return warnings
