"""Blocks in series and in parallel, and their gains."""

from functools import reduce

import jax.numpy as jnp
import pytest

from fracjax._blocks import AbstractLinearBlock, Creep, PEADynamics, linear_gains
from fracjax._operators import Grid, kernel
from tests.blocks.helpers import (
    DRIVE,
    SAMPLES,
    STEP,
    bouc_wen,
    creep,
    drift,
    foh,
    inverse_lfdh,
    lag,
    lfdh,
    mains,
    pea,
    resonance,
    saturation,
)
from tests.helpers import close, respond

HISTORIES = ("rest", "constant", "periodic")


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("pair", [(lag, lfdh), (creep, lag), (lfdh, creep)])
def test_linear_blocks_in_series_are_one_after_the_other(pair, history):
    first, second = pair
    grid = Grid(STEP, history)
    joined = first >> second
    assert isinstance(joined, AbstractLinearBlock)
    close(respond(joined, DRIVE, grid), second(first(DRIVE, grid), grid), 1e-10)


@pytest.mark.parametrize("history", HISTORIES)
@pytest.mark.parametrize("pair", [(lag, lfdh), (foh, drift), (bouc_wen, creep)])
def test_parallel_blocks_add(pair, history):
    grid = Grid(STEP, history)
    first, second = pair
    wanted = respond(first, DRIVE, grid) + respond(second, DRIVE, grid)
    close(respond(first + second, DRIVE, grid), wanted, 1e-11)


def test_a_sum_takes_the_lower_order_of_quadrature():
    """That is the only difference from the two responses, and small on a smooth drive."""
    joined = lag + resonance
    assert isinstance(joined, AbstractLinearBlock)
    assert joined.accuracy == resonance.accuracy
    grid = Grid(STEP, "constant")
    wanted = respond(lag, DRIVE, grid) + respond(resonance, DRIVE, grid)
    close(respond(joined, DRIVE, grid), wanted, 1e-4)


def test_a_series_with_a_nonlinear_block_is_one_after_the_other():
    grid = Grid(STEP, "constant")
    joined = foh >> saturation >> creep
    assert not isinstance(joined, AbstractLinearBlock)
    assert not joined.linear
    close(respond(joined, DRIVE, grid), creep(saturation(foh(DRIVE, grid), grid), grid), 1e-12)


def test_a_linear_kernel_is_the_response_to_one_sample():
    impulse = jnp.zeros(SAMPLES).at[0].set(1.0)
    for block in (lag, lfdh, creep, lag >> resonance):
        assert isinstance(block, AbstractLinearBlock)
        weights = kernel(block.symbol, SAMPLES, Grid(STEP), block.accuracy)
        close(respond(block, impulse, Grid(STEP, "rest")), weights, 1e-10)


@pytest.mark.parametrize(
    ("block", "gains"),
    [
        (foh, {"k_l", "k_h", "k_p"}),
        (lfdh, {"k_0", "k_delta"}),
        (resonance, set()),
        (pea, {"gain", "creep_gain"}),
        (inverse_lfdh, {"c_0", "c_mu"}),
        (lfdh.inverse(), set()),
        (bouc_wen >> PEADynamics(fixed_gain=True), {"first.k_u", "first.k_h"}),
        (foh >> Creep(fixed_gain=True), {"first.k_l", "first.k_h", "first.k_p"}),
        (foh >> creep, {"first.k_l", "first.k_h", "first.k_p"}),
        (lag >> foh, {"second.k_l", "second.k_h", "second.k_p"}),
        (foh >> saturation, set()),
        (foh >> saturation >> creep, {"second.k_c"}),
        (foh >> bouc_wen, {"second.k_u", "second.k_h"}),
        (lfdh + drift, {"first.k_0", "first.k_delta", "second.amplitude", "second.slope"}),
        ((lfdh + mains) >> resonance, {
            "first.first.k_0", "first.first.k_delta", "first.second.cosines", "first.second.sines",
        }),
        (lag >> creep >> resonance, {"first.second.k_c"}),
    ],
)  # fmt: skip
def test_gains_of_compositions(block, gains):
    assert set(linear_gains(block)) == gains


def test_long_chains_join():
    grid = Grid(STEP, "periodic")
    chain = reduce(lambda a, b: a >> b, [Creep(1.0, 0.01)] * 10)
    close(respond(chain, DRIVE, grid), respond(Creep(1.0, 0.1), DRIVE, grid), 1e-11)
