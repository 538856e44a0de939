"""Whatever a call in Python gives, it works or one sentence says why not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fracjax as fj

STEP = 1 / 500
TIMES = STEP * np.arange(1000)
DRIVE = 50 + 40 * np.sin(2 * np.pi * TIMES)
NOISE = 1e-3 * np.random.default_rng(0).standard_normal(TIMES.size)
RECORDING = fj.Recording(DRIVE, 0.1 * DRIVE + NOISE, STEP, "V", "um")
FOH = fj.parse_model("foh")
ANYTHING = object()
loose: Any = fj  # what a type checker would refuse


@pytest.fixture(scope="module")
def found() -> fj.Fit:
    return fj.fit("foh", RECORDING, noise="1 nm", starts=2)


def test_a_rest_is_fitted_beside_what_moves_and_alone_refused(tmp_path):
    """It tells the noise of a drive that neither rests nor comes again."""
    drive = 50 + 40 * np.sin(2 * np.pi * (1 + TIMES) * TIMES)
    noise = 2e-3 * np.random.default_rng(1).standard_normal((2, TIMES.size))
    moving = fj.Recording(drive, 0.1 * drive + noise[0], STEP, "V", "um", "moving")
    rest = fj.Recording(np.full(TIMES.size, 5.0), 0.5 + noise[1], STEP, "V", "um", "rest")
    with pytest.raises(fj.InputError, match="rest, drive: expected a signal that varies, found"):
        fj.fit("foh", [rest])
    found = fj.fit("foh", [moving, rest])
    for take in found.preparation.takes:
        assert take.noise is not None
        assert take.noise.method == "static"
        assert take.noise.sigma == pytest.approx(2e-3, rel=0.1)
    assert found.scores.rmse == pytest.approx(2e-3, rel=0.1)
    fj.write_report(found, tmp_path / "report.html")


def test_a_model_may_be_given_by_its_name_and_the_noise_as_text(found):
    same = fj.fit(FOH, [RECORDING], noise=1e-3, starts=2)
    assert same.to_dict() == found.to_dict()
    noise = found.preparation.takes[0].noise
    assert noise is not None
    assert noise.sigma == pytest.approx(1e-3, rel=0.2)
    drive = fj.simulate("foh", DRIVE, STEP)
    assert np.array_equal(drive.response, fj.simulate(FOH, DRIVE, STEP).response)


CALLS: dict[str, tuple[Callable, str]] = {
    "no model": (lambda: loose.fit(ANYTHING, RECORDING), "expected a Model, found a object"),
    "unknown model": (lambda: loose.fit("fox", RECORDING), 'model "fox": expected'),
    "a path": (lambda: loose.fit(FOH, "a.csv"), 'found "a.csv"; read a file by fracjax.read'),
    "a path among": (lambda: loose.fit(FOH, [RECORDING, "a.csv"]), "recording 2: expected"),
    "nothing": (lambda: loose.fit(FOH, []), "at least one recording, found none"),
    "a number": (lambda: loose.fit(FOH, 3), "expected a Recording, found 3"),
    "no starts": (lambda: loose.fit(FOH, RECORDING, starts=0), "starts: expected a whole"),
    "half a start": (lambda: loose.fit(FOH, RECORDING, starts=2.5), "found 2.5"),
    "a truth": (lambda: loose.fit(FOH, RECORDING, starts=True), "found True"),
    "negative seed": (lambda: loose.fit(FOH, RECORDING, seed=-1), "seed: expected"),
    "history": (lambda: loose.fit(FOH, RECORDING, history="old"), "history: expected one of rest"),
    "settling": (lambda: loose.fit(FOH, RECORDING, settling=969), "at most 968 samples, found 969"),
    "before it": (lambda: loose.fit(FOH, RECORDING, settling=-1), "settling: expected a"),
    "no noise": (lambda: loose.fit(FOH, RECORDING, noise=0.0), "noise: expected a number above 0"),
    "nan": (lambda: loose.fit(FOH, RECORDING, noise=float("nan")), "found nan"),
    "noise in V": (lambda: loose.fit(FOH, RECORDING, noise="1 V"), "noise: expected a value in um"),
    "noise of none": (lambda: loose.fit(FOH, RECORDING, noise=ANYTHING), "found a object"),
    "mask": (lambda: loose.fit(FOH, RECORDING, mask="abc"), "mask: expected pairs of times"),
    "one time": (lambda: loose.fit(FOH, RECORDING, mask=[(1,)]), "mask: expected pairs of times"),
    "bounds": (lambda: loose.fit(FOH, RECORDING, bounds={"alpha": 3}), 'bounds of "alpha"'),
    "prior": (lambda: loose.fit(FOH, RECORDING, priors={"alpha": 3}), "expected a Normal, found 3"),
    "fixed": (lambda: loose.fit(FOH, RECORDING, fixed={"alpha": "x"}), 'parameter "alpha"'),
    "diagnose": (lambda: loose.diagnose(3, RECORDING), "expected a Model, found 3"),
    "holdout": (lambda: loose.diagnose(FOH, RECORDING, holdout="b.csv"), "holdout: expected a"),
    "repeat": (lambda: loose.diagnose(FOH, RECORDING, repeat=1), "repeat: expected a Recording"),
    "limits": (lambda: loose.diagnose(FOH, RECORDING, limits="high"), "expected a range and"),
    "less noise": (lambda: loose.diagnose(FOH, RECORDING, noise="-1 um"), "noise: expected"),
    "crosscheck": (lambda: loose.crosscheck(FOH, RECORDING, population=0), "a population of at"),
    "compare": (lambda: loose.compare(["foh", 3], RECORDING), "expected a Model, found 3"),
    "table": (lambda: loose.fit_frequency_response("lfdh", RECORDING), "expected a FrequencyTable"),
    "posterior": (lambda: loose.sample_posterior(RECORDING), "expected a Fit, found a Recording"),
    "profile": (lambda: loose.profile(RECORDING, "alpha"), "expected a Fit, found a Recording"),
    "residuals": (lambda: loose.analyse_residuals(RECORDING), "expected a Fit"),
    "simulate": (lambda: loose.simulate(3, DRIVE, STEP), "expected a Model, found 3"),
    "compensate": (lambda: loose.compensate("foh", DRIVE), "expected a Trajectory"),
    "parse": (lambda: loose.parse_model(3), "expected a str, found 3"),
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_what_cannot_be_used_is_refused_in_one_sentence(name):
    call, said = CALLS[name]
    with pytest.raises(fj.InputError) as refused:
        call()
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_batch_and_a_report_refuse_what_they_cannot_use(tmp_path):
    for asked, said in (
        ({"recordings": 3}, "recordings: expected Recordings, files"),
        ({"recordings": [RECORDING, 3]}, "found 3"),
        ({"recordings": RECORDING, "model": 3}, "expected a Model, found 3"),
        ({"recordings": RECORDING, "starts": 0}, "starts: expected"),
        ({"recordings": RECORDING, "chunk": 0}, "chunk: expected"),
        ({"recordings": RECORDING, "history": "old"}, "history: expected"),
    ):
        with pytest.raises(fj.InputError, match=said):
            loose.fit_batch(**{"model": "foh", "out": tmp_path / "out", **asked})
    assert not (tmp_path / "out").exists()
    with pytest.raises(fj.InputError, match="report: expected a result of fracjax, found 3"):
        loose.write_report(3, tmp_path / "report.html")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "remedy"), [("clock", "give time_unit for it"), ("inptu", "did you mean input?")]
)
def test_an_option_that_there_is_not_is_not_passed_over(name, remedy, tmp_path):
    """Of `clock`, the shell's word, nothing was said, and the file was refused for its clock."""
    (tmp_path / "loop.csv").write_text("t [s],u [V],y [um]\n0,0,0\n1,1,1\n")
    with pytest.raises(fj.InputError, match="read: expected options time, input") as refused:
        loose.read(tmp_path / "loop.csv", **{name: "s"})
    assert remedy in str(refused.value)
