"""Derivatives of a composition, law by law, beside those of the whole."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fracjax as fj
from fracjax._operators import Grid
from fracjax._parameters import named_parameters, set_values
from tests.settings import DRIVE, TIMES


@pytest.mark.parametrize(
    "text",
    [
        "foh",
        "foh >> creep",
        "drive_lag >> foh >> resonance",
        "electrostriction >> foh + minor_loop_memory",
        "saturation >> (foh + thermal_drift) >> creep",
        "lfdh >> resonance",
        "bouc_wen >> drive_lag",
    ],
)
def test_derivatives_law_by_law_are_those_of_the_whole(text, setting):
    """Against JAX through the whole composition at once."""
    with jax.enable_x64(True):
        block = fj.parse_model(text, setting).block
        grid, drive = Grid(np.asarray(TIMES[1]), "constant"), jnp.asarray(DRIVE)
        names = list(named_parameters(block))
        response, columns, changes = block.linearise(DRIVE, grid, names, [np.sin(DRIVE)])
        # Two programs, which round differently: to what a kernel is as good as.
        alone = block.respond(DRIVE, grid)
        np.testing.assert_allclose(alone, response, atol=1e-11 * np.abs(response).max(), rtol=0)
        values = {n: jnp.asarray(p.value) for n, p in named_parameters(block).items()}

        @jax.jit
        def whole(values, drive):
            def respond(values, drive):
                return set_values(block, values)(drive, grid)

            along = jax.jvp(lambda u: respond(values, u), (drive,), (jnp.sin(drive),))[1]
            return respond(values, drive), jax.jacfwd(respond)(values, drive), along

        wanted, derivatives, along = whole(values, drive)
        np.testing.assert_allclose(response, wanted, atol=1e-9 * np.abs(response).max())
        np.testing.assert_allclose(changes[0], along, atol=1e-9 * np.abs(along).max())
        for name in names:
            column = derivatives[name].reshape(drive.size, -1)
            size = np.abs(column).max() + 1e-300
            np.testing.assert_allclose(columns[name], column, atol=1e-8 * size)


@pytest.mark.parametrize("history", ["rest", "constant", "periodic"])
@pytest.mark.parametrize("count", [1, 3, 4])
def test_changes_pass_a_linear_law_beside_its_drive(count, history, setting):
    with jax.enable_x64(True):
        block = fj.parse_model("creep", setting).block
        grid = Grid(np.asarray(TIMES[1]), history)
        along = [np.sin(DRIVE + k) for k in range(count)]
        response, columns, changes = block.linearise(DRIVE, grid, [], along)
        assert (columns, len(changes)) == ({}, count)
        for signal, found in zip([DRIVE, *along], [response, *changes], strict=True):
            wanted = block.respond(signal, grid)
            np.testing.assert_allclose(found, wanted, atol=1e-11 * np.abs(wanted).max(), rtol=0)
