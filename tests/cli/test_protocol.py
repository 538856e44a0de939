"""The command protocol: a drive, its picture, its sheet, a table; a bad call in one sentence."""

import json

import numpy as np
import pytest

from fracjax._cli import run

CALL = (
    'protocol --limits "0..100 V, 30 mA" --capacitance "3 uF" --rate 200Hz --duration "12 s" '
    "--for creep,resonance --out out"
)


@pytest.fixture(autouse=True)
def few_recipes(monkeypatch, tmp_path):
    monkeypatch.setattr("fracjax._protocol._protocol._MOST", 4)
    monkeypatch.chdir(tmp_path)


def called(text: str) -> int:
    import shlex

    return run(shlex.split(text))


def test_it_writes_the_drive_its_picture_and_its_sheet(capsys, tmp_path):
    assert called(f"{CALL} --format csv --format wav") == 0
    said = capsys.readouterr().out
    assert "whatever the hysteresis" in " ".join(said.split())
    assert "resonance" in said
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"drive.csv", "drive.wav", "drive.png", "protocol.json", "report.html"}
    columns = np.loadtxt(tmp_path / "out" / "drive.csv", delimiter=",", skiprows=1)
    assert columns.shape == (2400, 2)
    assert np.abs(np.diff(columns[:, 1])).max() <= 0.03 / 3e-6 / 200
    content = json.loads((tmp_path / "out" / "protocol.json").read_text(encoding="utf-8"))
    assert content["effects"] == ["creep", "resonance"]
    assert content["limits"]["slew_per_s"] == pytest.approx(1e4)
    sheet = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "fracjax protocol --limits" in sheet


def test_after_a_recording_its_range_rate_and_noise_are_taken(loop, capsys):
    assert called(f"protocol --after {loop} --for creep --duration '40 s' --out out --json") == 0
    content = json.loads(capsys.readouterr().out)
    assert content["after"] == [loop]
    assert content["drive"]["step_s"] == pytest.approx(0.01)
    assert (content["limits"]["low"], content["limits"]["high"]) == pytest.approx((5, 95), abs=0.1)
    assert content["noise"]["sigma"] == pytest.approx(0.01, rel=0.2)
    assert {one["effect"] for one in content["before"]} >= {"creep"}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ("--limits '0..100 V, 1 V/s'", "V/s or more"),
        ("--for crep", "did you mean creep?"),
        ("--modes 50Hz", "ask for modes up to 20 Hz"),
    ],
)
def test_a_bad_call_ends_in_one_sentence_and_leaves_no_folder(changed, words, capsys, tmp_path):
    assert called(f"{CALL} {changed}") == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert said.count("\n") == 0
    assert not (tmp_path / "out").exists()
