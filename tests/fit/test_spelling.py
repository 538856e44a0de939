"""Options as they are written."""

import pytest

import fracjax as fj
from fracjax._prepare import options_of


def test_options_as_they_are_written():
    found = options_of(
        fix=["k_p=0"], bound=["mu=0.1..0.2"], prior=["alpha = 0.1±0.02", "beta=-1e-1+-2"],
        tie=["second.mu=first.mu", "b = 2*a"], own=["k_p"], mask=["3 s..4 s", "10ms..20ms"],
    )  # fmt: skip
    assert found["fixed"] == {"k_p": 0.0}
    assert found["bounds"] == {"mu": (0.1, 0.2)}
    assert (float(found["priors"]["alpha"].mean), float(found["priors"]["alpha"].sd)) == (0.1, 0.02)
    assert float(found["priors"]["beta"].mean) == -0.1
    assert found["tied"] == {"second.mu": ("first.mu", 1.0), "b": ("a", 2.0)}
    assert found["own"] == ("k_p",)
    assert found["mask"] == ((3.0, 4.0), pytest.approx((0.01, 0.02)))
    assert options_of() == {}


@pytest.mark.parametrize(
    ("option", "text"),
    [
        ("fix", "k_p"), ("bound", "k_p=1"), ("prior", "k_p=1"), ("tie", "k_p=2"),
        ("mask", "3 s"), ("mask", "3 s..x"),
    ],
)  # fmt: skip
def test_options_written_otherwise_are_refused(option, text):
    with pytest.raises(fj.InputError, match=f"--{option}: expected a"):
        options_of(**{option: [text]})  # type: ignore[arg-type]
