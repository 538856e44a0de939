"""The commands info, models and effects."""

import json

import pytest

from fracjax._blocks import EFFECTS
from fracjax._cli import run
from fracjax._models import MODELS


@pytest.mark.parametrize("call", ["info LOOP", "models", "effects", "effects creep"])
def test_quiet_lists_say_nothing(call, loop, capsys):
    assert run([*call.replace("LOOP", loop).split(), "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_info(loop, capsys):
    assert run(["info", loop]) == 0
    text = capsys.readouterr().out
    for said in ("400 at 100 Hz", "sine, 5 to 95 V", "1 s, 4 repeats", "% of the stroke"):
        assert said in text
    assert run(["info", loop, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["noise"]["method"] == "repeats"
    assert told["noise"]["sigma"] == pytest.approx(0.01, rel=0.2)


def test_models_lists_all(capsys):
    assert run(["models", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [law["name"] for law in listed] == list(MODELS)
    assert all(law["sentence"] and law["equation"] and law["parameters"] for law in listed)
    assert run(["models"]) == 0
    assert all(name in capsys.readouterr().out for name in ("foh",))


def test_effects_lists_all(capsys):
    assert run(["effects"]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in EFFECTS)


@pytest.mark.parametrize("name", EFFECTS)
def test_effects_tells_all_about_one(name, capsys):
    assert run(["effects", name]) == 0
    text = " ".join(capsys.readouterr().out.split())
    effect = EFFECTS[name]
    assert effect.equation.split()[0] in text
    assert all(other in text for other in effect.separated_by)
    assert run(["effects", name, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["sentence"] == effect.sentence
    assert told["parameters"]


def test_info_shows_what_a_recording_would_show_as_bars(loop, capsys):
    assert run(["info", loop, "--shows"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "peak to peak" in line]
    bars = {line.split()[0]: line.count("█") for line in lines}
    assert bars
    assert max(bars.values()) == 20
    assert min(bars.values()) >= 1
