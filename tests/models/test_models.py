"""Models by name, their composition in text, and properties that every one of them has."""

import dataclasses
import json
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fracjax as fj
from fracjax._blocks import EFFECTS, FOH, Creep, Resonance, Setting
from fracjax._blocks._block import LinearParallel, LinearSeries, Parallel, Series
from fracjax._operators import Grid
from fracjax._operators._grid import History
from fracjax._parameters import named_parameters, set_values
from tests.helpers import close, gradient, respond


@pytest.mark.parametrize("name", fj.MODELS)
def test_every_name_is_a_model(name):
    model = fj.parse_model(name)
    assert model.name == name
    assert type(model.block) is type(fj.MODELS[name]())
    assert model.parameters


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_joins_a_model(name):
    model = fj.parse_model(f"foh + {name}")
    assert isinstance(model.block, Parallel)
    assert type(model.block.second) is type(EFFECTS[name].trials(COMMON)[0])


COMMON = Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 10.0, 3e3, 2e3, 0.0, 1e-3)


def shape_of(block) -> str:
    """The block's structure in text."""
    for kind, sign in (((Series, LinearSeries), ">>"), ((Parallel, LinearParallel), "+")):
        if isinstance(block, kind):
            return f"({shape_of(block.first)} {sign} {shape_of(block.second)})"
    return type(block).__name__


@pytest.mark.parametrize(
    ("text", "shape"),
    [
        ("foh >> creep", "(FOH >> LogarithmicCreep)"),
        ("foh >> creep + resonance", "(FOH >> (LogarithmicCreep + Resonance))"),
        ("(foh >> creep) + resonance", "((FOH >> LogarithmicCreep) + Resonance)"),
        ("foh + thermal_drift >> resonance", "((FOH + ThermalDrift) >> Resonance)"),
        ("drive_lag >> foh >> creep", "((DriveLag >> FOH) >> LogarithmicCreep)"),
        ("drive_lag >> (foh >> creep)", "(DriveLag >> (FOH >> LogarithmicCreep))"),
        ("foh + creep + lfdh", "((FOH + LogarithmicCreep) + LFDH)"),
        ("  foh>>creep ", "(FOH >> LogarithmicCreep)"),
        ("((foh))", "FOH"),
        ("coupled >> resonance", "((FOH >> Creep) >> Resonance)"),
    ],
)
def test_grouping(text, shape):
    model = fj.parse_model(text)
    assert shape_of(model.block) == shape
    # The name says the same model again.
    assert shape_of(fj.parse_model(model.name).block) == shape


def test_linear_blocks_join_to_one_law():
    assert isinstance(fj.parse_model("creep >> resonance").block, fj.AbstractLinearBlock)
    assert not isinstance(fj.parse_model("foh >> resonance").block, fj.AbstractLinearBlock)


def test_creep_alone_is_the_power_law_with_its_gain_and_in_a_chain_the_effect():
    alone, coupled = fj.parse_model("creep"), fj.parse_model("coupled")
    assert not alone.parameters["k_c"].fixed
    assert coupled.parameters["creep.k_c"].fixed
    chained = fj.parse_model("foh >> creep").parameters
    assert {"creep.gamma", "creep.onset"} <= chained.keys()


def test_an_effect_is_sized_by_the_setting():
    slow = Setting(0.0, 100.0, 10.0, 1.0, 1e4, 0.01, 3.0, 2.0, 0.0, 0.0)
    common, other = (
        float(fj.parse_model("foh + thermal_drift", s).parameters["second.time_constant"].value)
        for s in (COMMON, slow)
    )
    assert other > 100 * common


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("wumpus", '"wumpus"'),
        ("foh >> wumpus + creep", '"wumpus"'),
        ("foh - creep", '"foh - creep"'),
        ("foh >> 2", '"2"'),
        ("foh(1)", r'"foh\(1\)"'),
        ("foh.block", '"foh.block"'),
        ("__import__('os')", '"__import__'),
        ("", "something else"),
        ("foh >>", "something else"),
        ("(foh", "something else"),
        ("foh; creep", "something else"),
        ("foh\0", "something else"),
    ],
)
def test_other_text_is_refused_in_one_sentence(text, found):
    with pytest.raises(fj.InputError, match=f"expected names joined by .*found {found}") as refusal:
        fj.parse_model(text)
    sentence = str(refusal.value)
    assert all(name in sentence for name in (*fj.MODELS, *EFFECTS))
    assert refusal.value.__cause__ is None
    assert refusal.value.__suppress_context__ or refusal.value.__context__ is None


def test_values_are_exchanged_by_the_name_of_the_block_or_by_place():
    model = fj.parse_model("foh >> creep")
    changed = model.with_values({"foh.alpha": 0.3, "second.gamma": 0.02})
    assert float(changed.parameters["foh.alpha"].value) == 0.3
    assert float(changed.parameters["first.alpha"].value) == 0.3
    assert float(changed.parameters["creep.gamma"].value) == 0.02
    assert changed.name == model.name
    assert float(model.parameters["foh.alpha"].value) == 0.1  # the original is as it was
    with pytest.raises(
        fj.InputError, match=r'"alpha": .*none of that name \(did you mean foh.alpha'
    ):
        model.with_values({"alpha": 0.3})
    with pytest.raises(fj.InputError, match=r"foh\.alpha: expected a value of shape \(\), found"):
        model.with_values({"foh.alpha": [0.3, 0.4]})


def test_a_model_is_named_after_its_block_unless_told():
    assert fj.Model(FOH()).name == "foh"
    assert fj.Model(Resonance(100.0)).name == "Resonance"
    assert fj.Model(FOH() >> Creep() >> Resonance(100.0), "mine").name == "mine"


# Properties of every model, anywhere in its plausible range ---------------------------------------

HISTORIES: tuple[History, ...] = ("rest", "constant", "periodic")
SAMPLES, STEP, PAST = 64, 5e-3, 40
LOOK_AHEAD = 2  # samples of FOH's central difference
each_model = pytest.mark.parametrize("name", fj.MODELS)
some = settings(max_examples=8)
seeds = st.integers(0, 2**32 - 1)


def drawn(name, seed):
    """A model's block at drawn values, a smooth drive (N,) [V] and a generator for the rest."""
    generator = np.random.default_rng(seed)
    block = fj.MODELS[name]()
    values = {
        n: generator.uniform(0.1, 1.0, np.shape(p.value)) if p.gain else p.draw(generator)
        for n, p in named_parameters(block).items()
        if not p.fixed
    }
    times = np.arange(SAMPLES) / SAMPLES
    waves = [
        generator.uniform(1, 10) * np.sin(2 * np.pi * k * times + generator.uniform(0, 6))
        for k in (1, 2, 3)
    ]
    return set_values(block, values), 30 + np.sum(waves, axis=0), generator


@each_model
@some
@given(seed=seeds, history=st.sampled_from(["rest", "constant"]))
def test_no_model_sees_the_future(name, seed, history):
    block, drive, generator = drawn(name, seed)
    changed = drive.copy()
    changed[PAST:] += generator.uniform(-20, 20, SAMPLES - PAST)
    one, other = (respond(block, u, Grid(STEP, history)) for u in (drive, changed))
    until = PAST - LOOK_AHEAD
    close(other[:until], one[:until], 1e-8)


def power_of_time(unit: str, siblings: dict[str, np.ndarray]) -> float:
    """The power of seconds in a parameter's unit: "response/drive*s^alpha" → alpha."""
    if unit in ("s", "Hz"):
        return 1.0 if unit == "s" else -1.0
    power = re.search(r"\bs\^\(?([-+\w]+)\)?", unit)
    return float(eval(power[1], {}, siblings)) if power else 0.0


@each_model
@some
@given(
    seed=seeds,
    factor=st.floats(1e-3, 1e3),
    history=st.sampled_from(["rest", "constant", "periodic"]),
)
def test_no_model_depends_on_the_unit_of_time(name, seed, factor, history):
    """Times in another unit, and every parameter converted by its own: the same response.

    Up to a constant: the value before t = 0, which creep is counted from, is multiplied by the
    number k_c, whatever its unit.
    """
    block, drive, _ = drawn(name, seed)
    parameters = named_parameters(block)
    values, converted = {n: np.asarray(p.value) for n, p in parameters.items()}, {}
    for full, parameter in parameters.items():
        prefix = full[: full.rfind(".") + 1]
        siblings = {n[len(prefix) :]: v for n, v in values.items() if n.startswith(prefix)}
        converted[full] = values[full] * factor ** power_of_time(parameter.unit, siblings)
    found = respond(set_values(block, converted), drive, Grid(STEP * factor, history))
    wanted = respond(block, drive, Grid(STEP, history))
    close(found - found.mean(), wanted - wanted.mean(), 1e-8)


@each_model
@some
@given(seed=seeds)
def test_every_gradient_is_the_finite_difference(name, seed):
    block, drive, _ = drawn(name, seed)
    free = {n: p.value for n, p in named_parameters(block).items() if not p.fixed}
    found = gradient(block, free, jnp.asarray(drive), Grid(np.asarray(STEP), "constant"))
    for parameter, values in free.items():
        for at in np.ndindex(np.shape(values)):
            move = 1e-5 * max(abs(float(np.asarray(values)[at])), 1e-2)
            step = np.zeros(np.shape(values))
            step[at] = move
            ends = [
                respond(set_values(block, {parameter: moved}), drive, Grid(STEP, "constant"))
                for moved in (values + step, values - step)
            ]
            wanted = (ends[0] - ends[1]) / (2 * move)
            rounding = 1e-11 * np.abs(ends[0]).max() / move
            allowed = 1e-4 * np.abs(wanted).max() + rounding
            of_it = np.asarray(found[parameter])[(slice(None), *at)]
            np.testing.assert_allclose(of_it, wanted, rtol=0, atol=allowed)


def test_memory_ahead_of_a_law_is_another_law_than_memory_beside_it():
    def kinds(text: str) -> list[type]:
        parts = jax.tree_util.tree_leaves(
            fj.parse_model(text).block, is_leaf=lambda x: not isinstance(x, Series | Parallel)
        )
        return [type(part) for part in parts]

    ahead, beside = fj.blocks.DriveMemory, fj.blocks.MinorLoopMemory
    assert kinds("minor_loop_memory >> foh") == [ahead, FOH]
    assert kinds("foh + minor_loop_memory") == [FOH, beside]
    assert kinds("(foh + minor_loop_memory) >> creep")[1] is beside
    # In the middle of a chain it drives what follows.
    assert kinds("drive_lag >> minor_loop_memory >> foh")[1] is ahead


SITES = {"drive": "{} >> foh", "additive": "foh + {}"}


def sizes_of(block: fj.AbstractBlock) -> list[int]:
    return [np.size(p.value) for p in named_parameters(block).values()]


LAWS = {
    f"{type(trial).__name__} of {name}, {sizes_of(trial)}": (name, trial)
    for name, effect in EFFECTS.items()
    for trial in effect.trials(COMMON)
}


@pytest.mark.parametrize("law", LAWS)
def test_a_fit_is_loaded_with_the_law_that_it_has(law, tmp_path):
    """Also where its effect has several, and within others."""
    name, trial = LAWS[law]
    inner = EFFECTS[name].insert(FOH(), trial)
    text = SITES.get(EFFECTS[name].site_of(trial), "foh >> {}")
    block = inner >> Resonance(900.0, 0.02)
    model = fj.Model(block, f"({text.format(name)}) >> resonance")
    values = {n: np.asarray(p.value).tolist() for n, p in model.parameters.items()}
    setting = dataclasses.asdict(COMMON)
    told = {"schema": "fracjax.fit/1", "model": model.name, "setting": setting, "values": values}
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(told), encoding="utf-8")
    loaded = fj.load_model(path)
    assert jax.tree_util.tree_structure(loaded.block) == jax.tree_util.tree_structure(block)
    for parameter, value in values.items():
        np.testing.assert_array_equal(loaded.parameters[parameter].value, value)
