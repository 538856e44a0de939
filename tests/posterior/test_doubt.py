"""The verdict of a diagnosis, carried by a posterior."""

import pytest

import fracjax as fj
from fracjax._posterior._doubt import doubt_of
from tests.posterior.helpers import diagnosis_file


@pytest.mark.parametrize(
    ("verdict", "names", "others", "told"),
    [
        ("none", [], [], ""),
        ("missing", ["creep", "backlash"], [], "leaves creep and backlash unexplained"),
        ("confusable", ["delay"], ["drive_lag"], "leaves delay or drive_lag unexplained"),
        ("unexplained", [], [], "leaves part of the response unexplained"),
    ],
)
def test_a_posterior_carries_the_verdict_of_a_diagnosis(tmp_path, verdict, names, others, told):
    effects = [{"name": name, "confusable_with": others} for name in names]
    doubt = doubt_of(diagnosis_file(tmp_path, verdict=verdict, effects=effects), "law")
    assert told in doubt
    assert doubt.endswith("intervals hold only if the model is right.") == bool(told)


def test_a_diagnosis_of_something_else_is_refused(tmp_path, cubic):
    with pytest.raises(fj.InputError, match=r"expected a diagnosis of law, found one of foh"):
        fj.sample_posterior(cubic, diagnosis=diagnosis_file(tmp_path, model="foh"))
    for content in ("", "[]", '{"schema": "fracjax.fit/1"}'):
        (tmp_path / "diagnosis.json").write_text(content, encoding="utf-8")
        with pytest.raises(fj.InputError, match=r"expected a diagnosis .* found something else"):
            fj.sample_posterior(cubic, diagnosis=tmp_path / "diagnosis.json")
