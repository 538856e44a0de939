"""Models by name and their composition in text."""

import pytest

import fracjax as fj
from fracjax._blocks import EFFECTS, FOH, Creep, Resonance, Setting
from fracjax._blocks._block import LinearParallel, LinearSeries, Parallel, Series


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


COMMON = Setting(0.0, 100.0, 10.0, 1e-3, 10.0, 10.0)


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
    assert coupled.parameters["second.k_c"].fixed
    chained = fj.parse_model("foh >> creep").parameters
    assert {"second.gamma", "second.onset"} <= chained.keys()


def test_an_effect_is_sized_by_the_setting():
    slow = Setting(0.0, 100.0, 10.0, 1.0, 1e4, 0.01)
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
        ("FOH", '"FOH"'),
        ("resonance", '"resonance"'),
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


def test_values_are_exchanged_by_dotted_name():
    model = fj.parse_model("foh >> creep")
    changed = model.with_values({"first.alpha": 0.3, "second.gamma": 0.02})
    assert float(changed.parameters["first.alpha"].value) == 0.3
    assert float(changed.parameters["second.gamma"].value) == 0.02
    assert changed.name == model.name
    assert float(model.parameters["first.alpha"].value) == 0.1  # the original is as it was
    with pytest.raises(KeyError):
        model.with_values({"alpha": 0.3})


def test_a_model_is_named_after_its_block_unless_told():
    assert fj.Model(FOH()).name == "foh"
    assert fj.Model(Resonance(100.0)).name == "Resonance"
    assert fj.Model(FOH() >> Creep() >> Resonance(100.0), "mine").name == "mine"
