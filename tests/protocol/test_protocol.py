"""A designed drive: better than the recipe, written and read back, refused in one sentence."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import wavfile

import fracjax as fj
from fracjax._io import read_drive
from fracjax._path import detectabilities
from fracjax._protocol import ASKED, Limits
from fracjax._protocol._design import Task, designed, worth
from fracjax._protocol._recipe import Recipe
from fracjax._protocol._signals import few_samples, ideal_signal, noise_level

RATE, DURATION = 200.0, 12.0
CALL = {"limits": "0..100 V, 1 V/ms", "rate": RATE, "duration": DURATION}


@pytest.fixture(scope="module", autouse=True)
def few_recipes():
    """A short search: what it finds is another test's."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fracjax._protocol._protocol._MOST", 8)
        yield


@pytest.fixture(scope="module")
def small() -> fj.Protocol:
    """A protocol that is quickly designed: 1,200 samples, one effect."""
    return fj.protocol(**CALL, effects=["creep"], stroke="20 um", noise="5 nm")


def test_the_search_shows_the_worst_seen_effect_better_than_the_recipe():
    task = Task(Limits(0.0, 100.0, 1e3), 20.0, 0.008, 25.0, 0.01, 1e-3, ASKED)
    tried: list[str] = []
    best = designed(task, 30, tried.append)
    plain, found = task.coarse().seen(Recipe()), task.coarse().seen(best)
    assert min(found.values()) > 1.5 * min(plain.values())
    assert worth(found) > worth(plain)
    assert len(tried) == 30
    assert task.drive(best) is not None


def test_what_is_asked_for_decides():
    task = Task(Limits(0.0, 100.0, 1e3), 20.0, 0.008, 25.0, 0.01, 1e-3, ("creep",))
    creep = task.coarse().seen(designed(task, 16, lambda text: None))["creep"]
    assert creep > 1.5 * task.coarse().seen(Recipe())["creep"]


def test_recipes_are_compared_alike_at_a_lower_rate():
    asked = ("creep", "gain_drift", "thermal_drift")
    task = Task(Limits(0.0, 100.0, 1e6), 60.0, 1 / 160, 32.0, 0.01, 1e-3, asked)
    other = Recipe(holds=0.6, rungs=1, again=1.0)
    fine, coarse = (
        {name: each.seen(other)[name] / value for name, value in each.seen(Recipe()).items()}
        for each in (task, task.coarse())
    )
    assert min(*fine.values(), *coarse.values()) > 1.2


def test_detectabilities_fall_with_the_noise():
    task = Task(Limits(0.0, 100.0, 1e3), 20.0, 0.008, 25.0, 0.01, 1e-3, ASKED)
    drive = task.drive(Recipe())
    assert drive is not None
    signal = ideal_signal(drive.values, drive.step, 0.01, 1e-3)
    noisy = replace(signal, taps=np.array([500.0]))
    quiet, loud = (
        detectabilities([each], ["clock_skew"])["clock_skew"] for each in (signal, noisy)
    )
    assert loud == pytest.approx(quiet / 2, rel=0.1)


def test_the_result_says_what_it_is_and_shows(small):
    assert small.drive.values.size == RATE * DURATION
    assert (small.units, small.noise, small.stroke) == (("V", "um"), pytest.approx(5e-3), 20.0)
    assert small.least.effect == "creep"
    assert small.sentence.startswith("A drive of 12 s from 0 to 100 V: at a noise of 0.005 µm it ")
    headers, rows = small.table()
    assert headers == ["effect", "in 12 s"]
    assert len(rows) == len(small.shows)
    assert [part[0] for part in small.timetable()[1]][:2] == ["rest", "slow path"]
    content = small.to_dict()
    assert content["can_show"][0].keys() == {"effect", "size", "unit", "reason"}
    assert "creep" in repr(small)


@pytest.mark.parametrize("suffix", ["csv", "npz", "mat", "tdms"])
def test_a_written_drive_is_read_back(small, tmp_path, suffix):
    file = tmp_path / f"drive.{suffix}"
    small.write(file)
    values, step, unit = read_drive(file)
    assert values == pytest.approx(small.drive.values, abs=1e-12)
    assert (step, unit) == (pytest.approx(small.drive.step), "V")


def test_sound_has_the_range_for_its_full_scale(small, tmp_path):
    small.write(tmp_path / "drive.wav")
    rate, sound = wavfile.read(tmp_path / "drive.wav")
    assert rate == RATE
    assert 100 * sound == pytest.approx(small.drive.values, abs=1e-4)


def test_its_picture_and_its_sheet(small, tmp_path):
    panels = small.plot().axes
    assert [line.get_ydata().max() for line in panels[0].lines] == [pytest.approx(100)]
    assert len(panels[2].patches) == len(small.shows)
    fj.write_report(small, tmp_path / "report.html", command="fracjax protocol")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "fracjax diagnose recorded.csv" in page
    for part in small.drive.parts:
        assert part.purpose in page


def test_after_a_recording_what_it_lacks_is_designed(monkeypatch):
    """A triangle at one rate shows a lag or a hum, but no drift; range and noise are its own."""
    monkeypatch.setattr("fracjax._protocol._protocol._MOST", 30)
    rng, times = np.random.default_rng(0), np.arange(3000) / RATE
    drive = np.interp(times, [0, 2, 5, 8, 11, 15], [0, 0, 100, 0, 50, 0])
    response = 0.2 * drive + 0.01 * rng.standard_normal(times.size)
    loop = fj.Recording(drive, response, 1 / RATE, "V", "um", "loop")
    done = fj.protocol(after=loop, effects=["gain_drift", "creep"])
    assert (done.limits.low, done.limits.high) == (0, 100)
    assert done.noise == pytest.approx(0.01, rel=0.15)
    assert (done.units, done.after) == (("V", "um"), ("loop",))
    before, now = (
        {v.effect: np.inf if v.size is None else v.size for v in shown}
        for shown in (done.before, done.shows)
    )
    for name in ("gain_drift", "creep"):
        assert now[name] < before[name] == np.inf
    assert done.table()[0] == ["effect", "before", "with this drive"]
    assert len(done.plot().axes[2].patches) == 2 * len(now)


def test_fewer_samples_keep_the_noise_as_it_is():
    """Of an autoregression e = .8 e' + w the variance is that of w over 1 - .64."""
    signal = ideal_signal(np.sin(np.arange(2000) / 50), 0.01, 1.0, 1.0)
    coloured = replace(signal, taps=np.array([1.0, -0.8]))
    assert noise_level(coloured) == pytest.approx(1 / 0.6, rel=1e-6)
    few = few_samples(coloured, 500)
    assert (few.drive.size, few.step) == (500, 0.04)
    assert 1 / few.taps == pytest.approx([1 / 0.6])
    assert few_samples(coloured, 2000) is coloured


@pytest.mark.parametrize(
    ("changed", "where", "remedy"),
    [
        ({"limits": None}, "--limits", "--capacitance"),
        ({"limits": "0..100 V"}, "--limits", "add the slew rate"),
        ({"limits": "0..100 V, 10 V/s"}, "--limits", "V/s or more"),
        ({"duration": "2 s"}, "--duration", "s or more"),
        ({"duration": 0}, "--duration", "correct it"),
        ({"duration": "1 year", "rate": "1 MHz"}, "--duration", "change one"),
        ({"rate": None}, "--rate", "give it"),
        ({"modes": "100 Hz"}, "--rate", "raise it, or ask for modes up to 20 Hz"),
        ({"effects": ["crep"]}, "--for", "did you mean creep?"),
        ({"effects": []}, "--for", "name one"),
        ({"resolution": "10 V"}, "--limits", "Hz or less"),
        ({"resolution": "-1 V"}, "--resolution", "correct it"),
        ({"noise": "5 nm"}, "--noise", "--stroke"),
        ({"noise": "0 %"}, "--noise", "correct it"),
        ({"stroke": "20 V s um", "noise": "5 nm"}, "--stroke", ""),
        ({"after": 3}, "after", ""),
    ],
)
def test_what_cannot_be_designed_is_refused_in_one_sentence(changed, where, remedy):
    with pytest.raises(fj.InputError) as refused:
        fj.protocol(**CALL | changed)
    message = str(refused.value)
    assert message.startswith(where)
    assert remedy in message
    assert message.count(".\n") == 0


def test_the_smallest_change_is_enough_and_hardly_more():
    """The slew that a refusal names is accepted, and a tenth less is not."""
    with pytest.raises(fj.InputError) as refused:
        fj.protocol("0..100 V, 10 V/s", RATE, duration=DURATION)
    slew = float(str(refused.value).split("a slew of ")[1].split()[0])
    task = Task(Limits(0.0, 100.0, 1.01 * slew), DURATION, 1 / RATE, 40.0, 0.01, 1e-3, ASKED)
    assert task.drive(Recipe()) is not None
    slower = replace(task, limits=Limits(0.0, 100.0, 0.9 * slew))
    assert slower.drive(Recipe()) is None
