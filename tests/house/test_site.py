"""The site's sources: no public name and no effect is left out, and docstrings keep their text."""

import re

import pytest

import fracjax
from docs.docstrings import as_rst
from docs.gallery import anchor, section
from docs.tables import ROOT
from tests.house.test_public_api import public

API = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "api").glob("*.md"))
DIRECTIVE = re.compile(
    r"^\.\. (?:auto)?(currentmodule|function|class|data|exception):: (\S+)", re.M
)


def documented() -> set[str]:
    """The full names of what the API's pages have."""
    names, module = set(), ""
    for kind, name in DIRECTIVE.findall(API):
        if kind == "currentmodule":
            module = name
        else:
            names.add(f"{module}.{name}")
    return names


def test_every_public_name_has_its_place():
    expected = {f"fracjax.{name}" for name in fracjax.__all__} - {
        "fracjax.blocks",
        "fracjax.operators",
    }
    for part in ("blocks", "operators"):
        names = public(getattr(fracjax, part))
        expected |= {f"fracjax.{part}.{name}" for name in names if name not in fracjax.__all__}
    assert expected <= documented()


def test_no_page_has_a_name_that_is_none():
    for name in documented():
        module, _, member = name.removeprefix("fracjax.").rpartition(".")
        assert hasattr(getattr(fracjax, module) if module else fracjax, member), name


@pytest.mark.parametrize("name", fracjax.EFFECTS)
def test_the_gallery_says_what_the_catalogue_does(name):
    effect, text = fracjax.EFFECTS[name], section(fracjax.EFFECTS[name])
    assert effect.sentence[1:] in text
    assert effect.equation in text
    assert f"effects/{name}.svg" in text
    assert all(
        how in text and f"(#{anchor(other)})" in text for other, how in effect.separated_by.items()
    )


def test_equations_are_literal_and_other_text_is_no_markup():
    docstring = [
        "The law:",
        "",
        "    y = k*|u|_2",
        "",
        "with |u| of `a*b`.",
        "Args:",
        "    k: gain*.",
    ]
    assert as_rst(docstring) == [
        *("The law:", "", "::", "", "    y = k*|u|_2", ""),
        *(r"with \|u\| of `a*b`.", "Args:", r"    k: gain\*."),
    ]
