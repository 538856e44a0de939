"""What tests of several folders use."""

import re
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

import fracjax as fj
from fracjax._operators import Grid
from fracjax._parameters import set_values

_respond = eqx.filter_jit(lambda block, drive, grid: block(drive, grid))


def smooth(times: Any) -> Any:
    """A drive [V] that leaves 40 V slowly and turns several times between 40 and 85 V."""
    return 40 + 20 * (1 - np.cos(5 * np.pi * times)) + 5 * np.sin(11 * times) ** 4


def respond(block: fj.AbstractBlock, drive, grid: Grid) -> np.ndarray:
    """The block's response (N,), compiled once per structure: the step is an argument of the
    program."""
    grid = Grid(np.asarray(grid.step), grid.history)
    return np.asarray(_respond(block, jnp.asarray(drive), grid))


@eqx.filter_jit
def gradient(block: fj.AbstractBlock, values: dict, drive, grid: Grid) -> dict:
    """The response's derivatives (N,) in the values, by name."""
    return jax.jacfwd(lambda v: set_values(block, v)(drive, grid))(values)


def close(found, wanted, share: float, scale=None) -> None:
    """Equal to a share of the peak of `scale`, or of what is wanted."""
    found, wanted = np.asarray(found), np.asarray(wanted)
    peak = np.abs(wanted if scale is None else np.asarray(scale)).max()
    np.testing.assert_allclose(found, wanted, rtol=0, atol=share * peak)


def by_name(fit: fj.Fit | fj.FrequencyFit) -> dict[str, fj.Estimate]:
    """The fit's estimates."""
    return {estimate.name: estimate for estimate in fit.estimates}


def specified(sigma: float) -> fj.Noise:
    """White noise of a size [um] that a data sheet gives."""
    return fj.Noise(sigma, "um", "specification", np.ones(1), sigma)


def without_progress(err: str) -> str:
    """What a command wrote on stderr beside its stages, each a line that begins with the time."""
    return re.sub(r"(?m)^ *\d+\.\d s  .*\n", "", err)


def failure(capsys, status: int = 2) -> str:
    """The one sentence on stderr, nothing being on stdout."""
    out, err = capsys.readouterr()
    err = without_progress(err)
    assert out == "" or status != 2
    assert err.count("\n") == 1
    assert err.endswith(".\n")
    assert "Traceback" not in err
    return err.strip()
