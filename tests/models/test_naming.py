"""Names: of parameters by their blocks, of models and effects by the field's other words."""

import json

import numpy as np
import pytest

import fracjax as fj
from fracjax._aliases import ALIASES
from fracjax._blocks import EFFECTS
from fracjax._models import MODELS
from fracjax._naming import block_name, path_of_name, shown_names


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("lfdh", {"mu": "mu", "k_0": "k_0"}),
        ("foh >> creep", {"first.alpha": "foh.alpha", "second.gamma": "creep.gamma"}),
        ("foh >> creep + resonance", {"second.second.damping": "resonance.damping"}),
        (
            "foh >> resonance >> resonance",
            {
                "first.second.damping": "resonance_1.damping",
                "second.damping": "resonance_2.damping",
            },
        ),
        ("coupled", {"second.mu": "creep.mu"}),
    ],
)
def test_a_parameter_is_named_by_its_block(text, names):
    model = fj.parse_model(text)
    shown = shown_names(model.block)
    assert names.items() <= shown.items()
    assert len(set(shown.values())) == len(shown)
    for path, name in names.items():
        assert path_of_name(name, model.block) == path_of_name(path, model.block) == path
        assert model.parameters[path] is model.parameters[name]
    assert path_of_name("gains[3]@2", model.block) == "gains[3]@2"


def test_indices_of_components_and_recordings_stay():
    block = fj.parse_model("foh >> minor_loop_memory").block
    assert path_of_name("minor_loop_memory.weights[3]@2", block) == "second.weights[3]@2"


class OwnLaw(fj.blocks.Gain):
    """A block of a user, in a file of theirs."""

    def __init__(self):
        super().__init__(0.1)


def test_a_block_from_elsewhere_is_named_by_its_class():
    assert block_name(OwnLaw()) == "own_law"
    assert "own_law.k" in fj.Model(OwnLaw() >> fj.blocks.FOH(), "mine").parameters


def test_an_inverse_has_the_names_of_its_block():
    law = fj.blocks.LFDH()
    assert list(fj.Model(law.inverse(), "inverse").parameters) == list(fj.Model(law).parameters)


@pytest.mark.parametrize("word", ALIASES)
def test_other_words_lead_to_what_there_is(word):
    name = ALIASES[word].name
    if name == "prandtl_ishlinskii" and name not in MODELS:
        pytest.skip("its block is not here yet")
    assert name in MODELS or name in EFFECTS
    assert word not in MODELS
    assert word not in EFFECTS
    for text in (word, f"lfdh >> {word}"):
        model = fj.parse_model(text)
        if ALIASES[word].form:
            assert ALIASES[word].form in str(type(getattr(model.block, "second", None)))
        values = {n: p.value for n, p in model.parameters.items()}
        again = fj.parse_model(model.name, values=values)  # as a saved fit is read
        assert list(again.parameters) == list(values)


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("FOH", "foh"),
        ("Bouc-Wen", "bouc_wen"),
        ("Bouc–Wen >> Kelvin-Voigt", "bouc_wen >> creep"),
        ("thermal drift", "gain + thermal_drift"),
    ],
)
def test_names_may_be_written_as_in_prose(text, name):
    assert fj.parse_model(text).name == name


@pytest.mark.parametrize("name", [name for name in EFFECTS if name not in MODELS])
def test_an_effect_alone_is_that_effect_of_a_proportional_actuator(name):
    model = fj.parse_model(name)
    assert {"gain", name} <= {shown.partition(".")[0] for shown in model.parameters}
    drive = 50 - 50 * np.cos(np.linspace(0, 20, 400))
    assert np.isfinite(fj.simulate(model, drive, 1e-3).response).all()
    assert fj.parse_model(model.name).name == model.name


@pytest.mark.parametrize(
    ("text", "meant"), [("fho", "foh"), ("foh >> resonnance", "resonance"), ("boucwenn", "boucwen")]
)
def test_a_misspelt_name_is_met_with_the_one_meant(text, meant):
    with pytest.raises(fj.InputError, match=rf"\(did you mean {meant}\?\)"):
        fj.parse_model(text)


# fit.json as fracjax wrote it before parameters were named by their blocks, shortened.
OLD = {
    "schema": "fracjax.fit/1",
    "model": "foh >> creep + resonance",
    "setting": {
        "drive_low": 0.0, "drive_high": 100.0, "response_span": 10.0, "step": 1e-3,
        "duration": 10.0, "top_frequency": 10.0, "top_rate": 1e3, "rms_rate": 500.0,
        "response_low": 0.0, "resolution": 0.0,
    },
    "values": {
        "first.k_l": 0.07, "first.k_h": 0.04, "first.k_p": 1.5e-4, "first.alpha": 0.2,
        "first.beta": -0.13, "second.first.fastest": 0.02, "second.first.ratio": 5.0,
        "second.first.gains": [0.01, 0.02, 0.03, 0.04], "second.second.frequency": 90.0,
        "second.second.damping": 0.03,
    },
}  # fmt: skip


def test_an_old_file_is_read(tmp_path):
    path = tmp_path / "fit.json"
    path.write_text(json.dumps(OLD))
    model = fj.load_model(path)
    # The values have also selected the effect's form, four relaxations and not the logarithm.
    assert model.parameters["creep.gains"].value.tolist() == [0.01, 0.02, 0.03, 0.04]
    assert float(model.parameters["resonance.damping"].value) == 0.03
    assert float(model.parameters["second.second.damping"].value) == 0.03
