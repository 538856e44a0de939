"""Models as far as effects have been added: layers, paths, and the model without one of them."""

import jax
import numpy as np
import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS
from fracjax._diagnose._stage import Layer, Stage, path_of, wrapped
from fracjax._parameters import named_parameters
from fracjax._prepare import prepare
from fracjax._solve import solve_from
from tests.settings import DRIVE, TIMES

ORDERS = [
    ("creep", "electrostriction", "thermal_drift"),
    ("drive_lag", "minor_loop_memory", "resonance"),
    ("mains_interference", "creep", "saturation"),
]


def layers_of(names, setting) -> tuple[Layer, ...]:
    return tuple(Layer(EFFECTS[n], EFFECTS[n].trials(setting)[0]) for n in names)


def stage_of(names, setting) -> Stage:
    recording = fj.Recording(DRIVE, 0.1 * DRIVE, TIMES[1], "V", "um")
    preparation = prepare([recording], history="constant")
    base = fj.parse_model("foh", setting).block
    layers = layers_of(names, setting)
    block = wrapped(base, [(layer, layer.trial) for layer in layers])
    with jax.enable_x64(True):
        solved = solve_from([block], preparation, hopeless=0.0)
    return Stage("foh", base, layers, solved)


@pytest.mark.parametrize("names", ORDERS)
def test_a_path_leads_to_each_effects_own_parameters(names, setting):
    layers = layers_of(names, setting)
    block = wrapped(fj.blocks.FOH(), [(layer, layer.trial) for layer in layers])
    known = named_parameters(block)
    for k, layer in enumerate(layers):
        own = {f"{path_of(layers, k)}{name}" for name in named_parameters(layer.trial)}
        assert own == {name for name in known if name.startswith(path_of(layers, k))}


@pytest.mark.parametrize("names", ORDERS)
@pytest.mark.parametrize("dropped", [0, 1, 2])
def test_the_model_without_a_layer_is_the_model_of_the_others(names, dropped, setting):
    stage = stage_of(names, setting)
    kept = [name for k, name in enumerate(names) if k != dropped]
    less = stage.fitted_without(dropped)
    shaped = wrapped(stage.nominal, [(x, x.trial) for x in layers_of(kept, setting)])
    assert jax.tree_util.tree_structure(less) == jax.tree_util.tree_structure(shaped)
    whole, values = named_parameters(stage.solved.block), named_parameters(less)
    k = 0 if dropped else 1
    layers = layers_of(kept, setting)
    for name in named_parameters(layers[0].trial):
        left = values[f"{path_of(layers, 0)}{name}"].value
        assert np.array_equal(left, whole[f"{path_of(stage.layers, k)}{name}"].value)


def test_a_name_is_written_as_one_would_write_the_model(setting):
    assert stage_of(ORDERS[0], setting).name == (
        "(electrostriction >> (foh >> creep)) + thermal_drift"
    )
